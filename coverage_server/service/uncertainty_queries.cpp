// SPDX-License-Identifier: Apache-2.0
// Queries about how well scans make the surface known.
#include <algorithm>
#include <memory>
#include <span>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"
#include "coverage_server/service/coverage_service.h"
#include "coverage_server/service/query_answers.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

constexpr int kMaxScansTogether = 256;
// Inference at a target takes tens to hundreds of microseconds.
constexpr size_t kInferenceChunk = 64;
// Four bytes each: below 1 MiB.
constexpr size_t kNumbersPerMessage = 1 << 17;

absl::Status CheckHasUncertainty(const CoverageScene& scene) {
  if (scene.uncertainty() != nullptr) return absl::OkStatus();
  return WithErrorInfo(
      absl::FailedPreconditionError("the scene was created without spec.uncertainty"),
      "SCENE_WITHOUT_UNCERTAINTY");
}

}  // namespace

absl::Status CoverageServiceImpl::GainsByUncertainty(grpc::ServerContext* context,
                                                     const CoverageScene& scene,
                                                     const v1::EvaluateGainsRequest& request,
                                                     const MeasurementBatch& batch,
                                                     const TargetBits* covered,
                                                     v1::EvaluateGainsResponse* response) {
  SIGHTLINE_RETURN_IF_ERROR(CheckHasUncertainty(scene));
  if (request.evaluator() != v1::EVALUATOR_FAST) {
    return InvalidFields({{"evaluator",
                           "must be EVALUATOR_FAST with uncertainty_gain; "
                           "EvaluateUncertainty is exact"}});
  }
  SIGHTLINE_ASSIGN_OR_RETURN(
      UncertaintyRequirement requirement,
      ParseUncertaintyGain(request.uncertainty_gain(), scene.targets().size()));
  requirement.covered = covered;
  requirement.target_weights = {request.target_weights().data(),
                                static_cast<size_t>(request.target_weights().size())};
  const std::span<const Measurement> inside(batch.inside);
  std::vector<UncertaintyGain> gains(inside.size());
  SIGHTLINE_RETURN_IF_ERROR(Evaluate(
      context, inside.size(), FastChunk(inside.size(), p_.pool->threads()),
      [&](size_t begin, size_t end, const std::atomic<bool>& cancelled) {
        scene.EvaluateUncertaintyGains(inside.subspan(begin, end - begin), requirement,
                                       std::span(gains).subspan(begin, end - begin), &cancelled);
      }));
  p_.metrics->CountQueries("uncertainty", static_cast<int64_t>(inside.size()));
  response->mutable_gains()->Reserve(static_cast<int>(batch.size));
  for (size_t i = 0; i < batch.size; ++i) {
    response->add_gains()->set_feasibility(v1::FEASIBILITY_OUT_OF_BOUNDS);
  }
  for (size_t i = 0; i < inside.size(); ++i) {
    v1::Gain* gain = response->mutable_gains(static_cast<int>(batch.inside_index[i]));
    gain->set_feasibility(FeasibilityToProto(gains[i].feasibility));
    if (gains[i].feasibility != Feasibility::kFeasible) continue;
    gain->set_new_targets(gains[i].new_targets);
    gain->set_covered_targets(gains[i].covered_targets);
    if (request.target_weights().empty()) {
      gain->set_gain(gains[i].gain);
    } else {
      gain->set_weighted_gain(gains[i].gain);
    }
  }
  return absl::OkStatus();
}

grpc::Status CoverageServiceImpl::EvaluateUncertainty(
    grpc::ServerContext* context, const v1::EvaluateUncertaintyRequest* request,
    grpc::ServerWriter<v1::EvaluateUncertaintyResponse>* writer) {
  return p_.calls->Run(
      "EvaluateUncertainty", context, [&] { return Uncertainty(context, *request, writer); },
      CallKind::kStream);
}

absl::Status CoverageServiceImpl::Uncertainty(
    grpc::ServerContext* context, const v1::EvaluateUncertaintyRequest& request,
    grpc::ServerWriter<v1::EvaluateUncertaintyResponse>* writer) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto stored, p_.registry->FindScene(request.scene_digest()));
  const CoverageScene& scene = *stored->scene;
  SIGHTLINE_RETURN_IF_ERROR(CheckHasUncertainty(scene));
  if (request.measurements_size() > kMaxScansTogether) {
    return InvalidFields({{"measurements", absl::StrCat(request.measurements_size(), ": at most ",
                                                        kMaxScansTogether)}});
  }
  std::vector<Measurement> measurements;
  for (int i = 0; i < request.measurements_size(); ++i) {
    SIGHTLINE_ASSIGN_OR_RETURN(
        Measurement measurement,
        ParseMeasurement(request.measurements(i), absl::StrCat("measurements[", i, "]")));
    measurements.push_back(measurement);
  }
  SIGHTLINE_ASSIGN_OR_RETURN(
      std::vector<uint32_t> targets,
      ParseTargetIndices(request.targets(), scene.targets().size(), "targets"));

  const auto enough_count = static_cast<size_t>(request.enough_m_size());
  if (enough_count > 1 && enough_count != targets.size()) {
    return InvalidFields(
        {{"enough_m", absl::StrCat(enough_count, " values for ", targets.size(), " targets")}});
  }
  if (enough_count > 0 && request.after_each_scan()) {
    return InvalidFields({{"enough_m", "cannot be given with after_each_scan"}});
  }
  std::vector<float> enough_m(request.enough_m().begin(), request.enough_m().end());
  for (size_t i = 0; i < enough_count; ++i) {
    if (enough_m[i] >= 0) continue;  // not so for NaN
    return InvalidFields(
        {{absl::StrCat("enough_m[", i, "]"), absl::StrCat(enough_m[i], ": must be >= 0")}});
  }
  if (enough_count == 1) enough_m.assign(targets.size(), enough_m[0]);

  std::vector<MeasuredScan> scans(measurements.size());
  absl::Status status = Evaluate(context, scans.size(), kExactChunk,
                                 [&](size_t begin, size_t end, const std::atomic<bool>& cancelled) {
                                   for (size_t i = begin; i < end; ++i) {
                                     scans[i] =
                                         scene.MeasureForInference(measurements[i], &cancelled);
                                   }
                                 });
  if (!status.ok()) return status;
  std::vector<std::shared_ptr<const ScanPoints>> points;
  for (size_t i = 0; i < scans.size(); ++i) {
    if (scans[i].feasibility != Feasibility::kFeasible) {
      return InfeasibleScan(absl::StrCat("measurements[", i, "]"), scans[i].feasibility);
    }
    points.push_back(scans[i].points);
  }
  std::vector<TargetUncertainty> results(targets.size());
  status =
      Evaluate(context, results.size(), kInferenceChunk,
               [&](size_t begin, size_t end, const std::atomic<bool>& cancelled) {
                 scene.Infer(points, std::span(targets).subspan(begin, end - begin),
                             request.after_each_scan(),
                             std::span<const float>(enough_m).subspan(
                                 enough_m.empty() ? 0 : begin, enough_m.empty() ? 0 : end - begin),
                             std::span(results).subspan(begin, end - begin), &cancelled);
               });
  if (!status.ok()) return status;
  p_.metrics->CountQueries("inference", 1);
  const size_t numbers_each = 5 + (request.after_each_scan() ? scans.size() : 0);
  const size_t targets_each = std::max<size_t>(1, kNumbersPerMessage / numbers_each);
  for (size_t begin = 0; begin < results.size(); begin += targets_each) {
    SIGHTLINE_RETURN_IF_ERROR(p_.calls->CheckStop(context));
    v1::EvaluateUncertaintyResponse response;
    for (size_t i = begin; i < std::min(results.size(), begin + targets_each); ++i) {
      const SurfaceUncertainty& u = results[i].uncertainty;
      response.add_uncertainty_m(static_cast<float>(u.total_m));
      response.add_noise_m(static_cast<float>(u.noise_m));
      response.add_sampling_m(static_cast<float>(u.sampling_m));
      response.add_calibration_m(static_cast<float>(u.calibration_m));
      response.add_points(results[i].points);
      response.mutable_after_each_scan_m()->Add(results[i].after_each_scan_m.begin(),
                                                results[i].after_each_scan_m.end());
    }
    SIGHTLINE_RETURN_IF_ERROR(p_.calls->Write(context, [&] { return writer->Write(response); }));
  }
  return absl::OkStatus();
}

}  // namespace sightline
