// SPDX-License-Identifier: Apache-2.0
#include "planner_client/coverage_client/coverage_client.h"

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "core/inspection/inspection.h"
#include "core/inspection/vector_proto.h"
#include "core/status/status_macros.h"
#include "planner_client/coverage_client/scene_connection.h"
#include "proto/status/rpc_status.h"
#include "sightline/v1/coverage_service.grpc.pb.h"

namespace sightline {
namespace {

constexpr int64_t kMaxCoverageBytesPerRequest = 8 << 20;
// Some seconds' work, so that a request that is tried again repeats little.
constexpr size_t kExplanationsPerRequest = 2048;

absl::StatusOr<ScanFeasibility> FeasibilityFromProto(v1::Feasibility feasibility) {
  switch (feasibility) {
    case v1::FEASIBILITY_FEASIBLE:
      return ScanFeasibility::kFeasible;
    case v1::FEASIBILITY_COLLISION:
      return ScanFeasibility::kCollision;
    case v1::FEASIBILITY_TRAVEL:
      return ScanFeasibility::kTravel;
    case v1::FEASIBILITY_OUT_OF_BOUNDS:
      return ScanFeasibility::kOutOfBounds;
    default:
      return absl::InternalError(
          absl::StrCat("server answered an unknown feasibility ", feasibility));
  }
}

v1::ScanDisplacement DisplacementToProto(const ScanDisplacement& displacement) {
  const auto convert = [](const Displacement& from) {
    v1::Displacement message;
    *message.mutable_rotation_rad() = VectorToProto(from.rotation_rad);
    *message.mutable_translation_m() = VectorToProto(from.translation_m);
    return message;
  };
  v1::ScanDisplacement message;
  *message.mutable_part() = convert(displacement.part);
  *message.mutable_camera() = convert(displacement.camera);
  *message.mutable_laser() = convert(displacement.laser);
  return message;
}

std::vector<CallSlice> Cut(size_t count, size_t batch) {
  std::vector<CallSlice> slices;
  for (size_t begin = 0; begin < count; begin += batch) {
    slices.push_back({begin, std::min(count, begin + batch)});
  }
  return slices;
}

class CoverageClientImpl final : public CoverageClient {
 public:
  CoverageClientImpl(CoverageClientOptions options, CoverageTask task)
      : scene_(std::move(options), std::move(task)) {}

  absl::Status Prepare() { return scene_.Prepare(); }

  const SceneInfo& scene() const override { return scene_.info(); }
  const TargetSet& targets() const override { return scene_.targets(); }
  const TargetBits& measurable() const override { return scene_.measurable(); }
  std::span<const uint64_t> measurable_orientations() const override {
    return scene_.measurable_orientations();
  }
  int64_t evaluations() const override { return evaluations_; }
  int recoveries() const override { return scene_.recoveries(); }

  absl::StatusOr<std::vector<ScanGain>> Gains(std::span<const Measurement> measurements,
                                              std::span<const float> known) override {
    return GainsOf(measurements, [&](v1::EvaluateGainsRequest* request) {
      request->set_covered_targets(Satisfied(scene_.measurable(), known).ToBytes());
    });
  }

  absl::StatusOr<std::vector<ScanGain>> WeightedGains(std::span<const Measurement> measurements,
                                                      std::span<const float> weights) override {
    return GainsOf(measurements, [&](v1::EvaluateGainsRequest* request) {
      request->mutable_target_weights()->Add(weights.begin(), weights.end());
    });
  }

  absl::StatusOr<std::vector<ScanGain>> UncertaintyGains(std::span<const Measurement> measurements,
                                                         const UncertaintyQuery& query,
                                                         std::span<const float> known_density,
                                                         std::span<const float> weights) override {
    return GainsOf(
        measurements,
        [&](v1::EvaluateGainsRequest* request) {
          v1::UncertaintyGain& gain = *request->mutable_uncertainty_gain();
          gain.mutable_weights()->set_coverage(query.weights.coverage);
          gain.mutable_weights()->set_admissible(query.weights.admissible);
          gain.mutable_weights()->set_relaxed(query.weights.relaxed);
          gain.mutable_weights()->set_information(query.weights.information);
          gain.mutable_weights()->set_total_uncertainty(query.weights.total_uncertainty);
          gain.mutable_admissible_uncertainty_m()->Add(query.admissible_uncertainty_m.begin(),
                                                       query.admissible_uncertainty_m.end());
          gain.set_relaxed_uncertainty_m(query.relaxed_uncertainty_m);
          if (query.covered.size() > 0) request->set_covered_targets(query.covered.ToBytes());
          gain.mutable_known_information_per_m4()->Add(known_density.begin(), known_density.end());
          request->mutable_target_weights()->Add(weights.begin(), weights.end());
        },
        true);
  }

  absl::StatusOr<std::vector<InformedScan>> FastInformation(
      std::span<const Measurement> measurements) override {
    std::vector<InformedScan> result;
    result.reserve(measurements.size());
    absl::Status status = AskCoverage(
        measurements, v1::EVALUATOR_FAST, FastBatch(measurements.size()),
        [&](ScanFeasibility feasibility, const v1::Coverage& message) -> absl::Status {
          if (message.informed_targets_size() != message.information_per_m4_size()) {
            return absl::InternalError("server answered information of unequal length");
          }
          for (const uint32_t target : message.informed_targets()) {
            if (target >= scene_.targets().size()) {
              return absl::InternalError("server answered information of an unknown target");
            }
          }
          InformedScan& scan = result.emplace_back();
          scan.feasibility = feasibility;
          scan.covered = TargetBits::FromBytes(scene_.targets().size(), message.covered_targets());
          scan.covered &= scene_.measurable();
          scan.targets.assign(message.informed_targets().begin(), message.informed_targets().end());
          scan.density.assign(message.information_per_m4().begin(),
                              message.information_per_m4().end());
          return absl::OkStatus();
        });
    if (!status.ok()) return status;
    evaluations_ += static_cast<int64_t>(measurements.size());
    return result;
  }

  absl::StatusOr<PosteriorUncertainties> Uncertainties(std::span<const Measurement> scans,
                                                       std::span<const uint32_t> targets,
                                                       bool after_each_scan,
                                                       std::span<const float> enough_m) override {
    const size_t count = targets.empty() ? scene_.targets().size() : targets.size();
    // Queries after an interruption serve the plan that is kept.
    const bool kept = scene_.options().interrupted != nullptr && *scene_.options().interrupted;
    PosteriorUncertainties result;
    absl::Status status = scene_.WithRetries([&](CoverageConnection& connection) -> absl::Status {
      result = {};
      grpc::ClientContext context;
      v1::EvaluateUncertaintyRequest request;
      request.set_scene_digest(scene_.info().scene_digest);
      for (const Measurement& scan : scans) *request.add_measurements() = MeasurementToProto(scan);
      request.mutable_targets()->Add(targets.begin(), targets.end());
      request.set_after_each_scan(after_each_scan);
      request.mutable_enough_m()->Add(enough_m.begin(), enough_m.end());
      auto reader = connection.coverage->EvaluateUncertainty(&context, request);
      v1::EvaluateUncertaintyResponse response;
      while (reader->Read(&response)) {
        const auto append = [](const auto& from, auto& to) {
          to.insert(to.end(), from.begin(), from.end());
        };
        append(response.uncertainty_m(), result.total_m);
        append(response.noise_m(), result.noise_m);
        append(response.sampling_m(), result.sampling_m);
        append(response.calibration_m(), result.calibration_m);
        append(response.points(), result.points);
        append(response.after_each_scan_m(), result.after_each_scan_m);
        if (!kept && scene_.options().interrupted != nullptr && *scene_.options().interrupted)
          context.TryCancel();
      }
      return FromGrpcStatus(reader->Finish());
    });
    if (!status.ok()) return status;
    if (result.total_m.size() != count || result.noise_m.size() != count ||
        result.sampling_m.size() != count || result.calibration_m.size() != count ||
        result.points.size() != count ||
        result.after_each_scan_m.size() != (after_each_scan ? count * scans.size() : 0)) {
      return absl::InternalError("server answered another number of uncertainties than asked");
    }
    return result;
  }

  absl::StatusOr<std::vector<ScanCoverage>> FastCoverage(
      std::span<const Measurement> measurements) override {
    auto coverages = CoverageOf(measurements, v1::EVALUATOR_FAST, FastBatch(measurements.size()));
    if (coverages.ok()) evaluations_ += static_cast<int64_t>(measurements.size());
    return coverages;
  }

  absl::StatusOr<std::vector<ScanCoverage>> ExactCoverage(
      std::span<const Measurement> measurements) override {
    // Slow queries: one each keeps all cores of the server busy.
    return CoverageOf(measurements, v1::EVALUATOR_EXACT, 1);
  }

  absl::StatusOr<std::vector<ScanCoverage>> DisplacedCoverage(
      std::span<const Measurement> measurements,
      std::span<const ScanDisplacement> displacements) override {
    if (displacements.size() != measurements.size()) {
      return absl::InvalidArgumentError("displaced scans need one displacement each");
    }
    return CoverageOf(measurements, v1::EVALUATOR_EXACT, 1, displacements);
  }

  absl::StatusOr<std::vector<ScanPoint>> MeasurementPoints(
      const Measurement& measurement) override {
    std::vector<ScanPoint> points;
    absl::Status status = scene_.WithRetries([&](CoverageConnection& connection) -> absl::Status {
      points.clear();
      grpc::ClientContext context;
      v1::StreamMeasurementPointsRequest request;
      request.set_scene_digest(scene_.info().scene_digest);
      *request.mutable_measurement() = MeasurementToProto(measurement);
      auto reader = connection.coverage->StreamMeasurementPoints(&context, request);
      v1::StreamMeasurementPointsResponse response;
      while (reader->Read(&response)) {
        const int count = response.frames_size();
        if (response.positions_m_size() != 3 * count || response.normals_size() != 3 * count ||
            response.columns_px_size() != count) {
          context.TryCancel();
          return absl::InternalError("server answered measurement points of unequal length");
        }
        for (int i = 0; i < count; ++i) {
          points.push_back({VectorAt(response.positions_m(), i), VectorAt(response.normals(), i),
                            response.frames(i), response.columns_px(i)});
        }
      }
      return FromGrpcStatus(reader->Finish());
    });
    if (!status.ok()) return status;
    return points;
  }

  absl::StatusOr<std::vector<TargetReason>> ExplainTargets(
      std::span<const uint32_t> targets) override {
    const std::vector<CallSlice> slices = Cut(targets.size(), kExplanationsPerRequest);
    std::vector<v1::ExplainTargetsResponse> responses;
    absl::Status status = scene_.Pipeline<v1::ExplainTargetsRequest, v1::ExplainTargetsResponse>(
        slices,
        [&](const CallSlice& slice, v1::ExplainTargetsRequest* request) {
          request->set_scene_digest(scene_.info().scene_digest);
          request->mutable_targets()->Add(targets.begin() + slice.begin,
                                          targets.begin() + slice.end);
        },
        &v1::CoverageService::Stub::AsyncExplainTargets, &responses);
    if (!status.ok()) return status;
    std::vector<TargetReason> reasons;
    reasons.reserve(targets.size());
    for (size_t s = 0; s < slices.size(); ++s) {
      if (static_cast<size_t>(responses[s].explanations_size()) !=
          slices[s].end - slices[s].begin) {
        return absl::InternalError("server answered another number of explanations than asked");
      }
      for (const auto& explanation : responses[s].explanations()) {
        // A collision may be with the part.
        const bool hidden = explanation.reason() == v1::UNCOVERED_REASON_OBSTACLE;
        const bool named = hidden || (explanation.reason() == v1::UNCOVERED_REASON_COLLISION &&
                                      explanation.obstacle() >= 0);
        if (!v1::UncoveredReason_IsValid(explanation.reason()) ||
            explanation.reason() == v1::UNCOVERED_REASON_UNSPECIFIED ||
            (named && (explanation.obstacle() < 0 ||
                       explanation.obstacle() >= scene_.spec().obstacles_size()))) {
          return absl::InternalError("server answered an unknown reason or obstacle");
        }
        const bool light = explanation.reason() == v1::UNCOVERED_REASON_TOO_DARK ||
                           explanation.reason() == v1::UNCOVERED_REASON_TOO_BRIGHT;
        reasons.push_back({explanation.reason(), named ? explanation.obstacle() : -1,
                           light ? explanation.exposure_time_s() : 0});
      }
    }
    return reasons;
  }

  absl::StatusOr<std::string> RenderView(v1::RenderViewRequest request) override {
    request.set_scene_digest(scene_.info().scene_digest);
    v1::RenderViewResponse response;
    absl::Status status = scene_.WithRetries([&](CoverageConnection& connection) {
      grpc::ClientContext context;
      return FromGrpcStatus(connection.coverage->RenderView(&context, request, &response));
    });
    if (!status.ok()) return status;
    return std::move(*response.mutable_png());
  }

 private:
  // Enough requests to keep the server busy, each long enough to be worth its overhead.
  size_t FastBatch(size_t count) const {
    const size_t share =
        count / static_cast<size_t>(std::max(1, scene_.options().outstanding_requests));
    return std::clamp(share, static_cast<size_t>(scene_.options().min_batch),
                      static_cast<size_t>(scene_.options().max_batch));
  }

  // `complete` adds the query about the measurements to every request.
  absl::StatusOr<std::vector<ScanGain>> GainsOf(
      std::span<const Measurement> measurements,
      const std::function<void(v1::EvaluateGainsRequest*)>& complete, bool by_uncertainty = false) {
    const std::vector<CallSlice> slices = Cut(measurements.size(), FastBatch(measurements.size()));
    std::vector<v1::EvaluateGainsResponse> responses;
    absl::Status status = scene_.Pipeline<v1::EvaluateGainsRequest, v1::EvaluateGainsResponse>(
        slices,
        [&](const CallSlice& slice, v1::EvaluateGainsRequest* request) {
          request->set_scene_digest(scene_.info().scene_digest);
          request->set_evaluator(v1::EVALUATOR_FAST);
          for (size_t i = slice.begin; i < slice.end; ++i) {
            *request->add_measurements() = MeasurementToProto(measurements[i]);
          }
          complete(request);
        },
        &v1::CoverageService::Stub::AsyncEvaluateGains, &responses);
    if (!status.ok()) return status;
    std::vector<ScanGain> gains;
    gains.reserve(measurements.size());
    for (size_t s = 0; s < slices.size(); ++s) {
      if (static_cast<size_t>(responses[s].gains_size()) != slices[s].end - slices[s].begin) {
        return absl::InternalError("server answered another number of gains than asked");
      }
      for (const v1::Gain& gain : responses[s].gains()) {
        SIGHTLINE_ASSIGN_OR_RETURN(ScanFeasibility feasibility,
                                   FeasibilityFromProto(gain.feasibility()));
        // Without an uncertainty gain covered targets count.
        gains.push_back({feasibility, gain.new_targets(), gain.covered_targets(),
                         gain.weighted_gain(), by_uncertainty ? gain.gain() : gain.new_targets()});
      }
    }
    evaluations_ += static_cast<int64_t>(measurements.size());
    return gains;
  }

  // Calls take(feasibility, answer) for every measurement, in order.
  absl::Status AskCoverage(
      std::span<const Measurement> measurements, v1::Evaluator evaluator, size_t batch,
      const std::function<absl::Status(ScanFeasibility, const v1::Coverage&)>& take,
      std::span<const ScanDisplacement> displacements = {}) {
    const bool informed = evaluator == v1::EVALUATOR_FAST && scene_.task().uncertainty;
    const int64_t bytes_each =
        scene_.info().target_count / 4 + 64 + (informed ? 8 * scene_.info().target_count : 0);
    batch = std::min(
        batch, static_cast<size_t>(std::max<int64_t>(1, kMaxCoverageBytesPerRequest / bytes_each)));
    const std::vector<CallSlice> slices = Cut(measurements.size(), batch);
    std::vector<v1::EvaluateCoverageResponse> responses;
    absl::Status status =
        scene_.Pipeline<v1::EvaluateCoverageRequest, v1::EvaluateCoverageResponse>(
            slices,
            [&](const CallSlice& slice, v1::EvaluateCoverageRequest* request) {
              request->set_scene_digest(scene_.info().scene_digest);
              request->set_evaluator(evaluator);
              for (size_t i = slice.begin; i < slice.end; ++i) {
                *request->add_measurements() = MeasurementToProto(measurements[i]);
                if (!displacements.empty()) {
                  *request->add_displacements() = DisplacementToProto(displacements[i]);
                }
              }
            },
            &v1::CoverageService::Stub::AsyncEvaluateCoverage, &responses);
    if (!status.ok()) return status;
    for (size_t s = 0; s < slices.size(); ++s) {
      if (static_cast<size_t>(responses[s].coverages_size()) != slices[s].end - slices[s].begin) {
        return absl::InternalError("server answered another number of coverages than asked");
      }
      for (const v1::Coverage& message : responses[s].coverages()) {
        SIGHTLINE_ASSIGN_OR_RETURN(ScanFeasibility feasibility,
                                   FeasibilityFromProto(message.feasibility()));
        if (status = take(feasibility, message); !status.ok()) return status;
      }
    }
    return absl::OkStatus();
  }

  absl::StatusOr<std::vector<ScanCoverage>> CoverageOf(
      std::span<const Measurement> measurements, v1::Evaluator evaluator, size_t batch,
      std::span<const ScanDisplacement> displacements = {}) {
    std::vector<ScanCoverage> coverages;
    coverages.reserve(measurements.size());
    const size_t target_count = scene_.targets().size();
    absl::Status status = AskCoverage(
        measurements, evaluator, batch,
        [&](ScanFeasibility feasibility, const v1::Coverage& message) -> absl::Status {
          ScanCoverage coverage;
          coverage.feasibility = feasibility;
          coverage.covered = TargetBits::FromBytes(target_count, message.covered_targets());
          coverage.covered &= scene_.measurable();
          if (evaluator == v1::EVALUATOR_EXACT) {
            coverage.covered_without_normal_gate =
                TargetBits::FromBytes(target_count, message.covered_targets_without_normal_gate());
            coverage.covered_without_normal_gate &= scene_.measurable();
            coverage.first_frame = message.first_frame();
            coverage.last_frame = message.last_frame();
            coverage.measurement_points = message.measurement_points();
          }
          coverages.push_back(std::move(coverage));
          return absl::OkStatus();
        },
        displacements);
    if (!status.ok()) return status;
    return coverages;
  }

  SceneConnection scene_;
  std::atomic<int64_t> evaluations_ = 0;
};

}  // namespace

absl::StatusOr<std::unique_ptr<CoverageClient>> CoverageClient::Open(CoverageClientOptions options,
                                                                     CoverageTask task) {
  if (task.part == nullptr) return absl::InvalidArgumentError("a coverage task needs a part");
  auto client = std::make_unique<CoverageClientImpl>(std::move(options), std::move(task));
  SIGHTLINE_RETURN_IF_ERROR(client->Prepare());
  return client;
}

}  // namespace sightline
