// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/service/coverage_service.h"

#include <spdlog/spdlog.h>

#include <algorithm>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "core/inspection/vector_proto.h"
#include "core/part/load_part.h"
#include "core/part/part_health_proto.h"
#include "core/process/program_build.h"
#include "core/spelling/one_of.h"
#include "core/status/status_macros.h"
#include "coverage_server/service/query_answers.h"
#include "proto/status/rpc_status.h"
#include "rpc_server/job_service.h"

namespace sightline {
namespace {

// At most about 40 bytes each on the wire: below 1 MiB.
constexpr size_t kPointsPerMessage = 16384;
constexpr int64_t kMaxCoverageResponseBytes = kMaxMessageBytes / 2;

void AddVector(const Eigen::Vector3f& vector, google::protobuf::RepeatedField<float>* field) {
  field->Add(vector.x());
  field->Add(vector.y());
  field->Add(vector.z());
}

// Gain as the fast evaluator would state it, from an exact coverage.
FastGain GainOfCoverage(const CoverageScene& scene, const ExactCoverage& coverage,
                        const TargetBits* covered, std::span<const float> weights) {
  FastGain gain{.feasibility = coverage.feasibility};
  if (coverage.feasibility != Feasibility::kFeasible) return gain;
  TargetBits bits = coverage.covered;
  bits &= scene.measurable();
  gain.covered_targets = static_cast<int32_t>(bits.Count());
  if (covered != nullptr) bits.Subtract(*covered);
  gain.new_targets = static_cast<int32_t>(bits.Count());
  if (!weights.empty()) {
    for (size_t i = 0; i < bits.size(); ++i) {
      if (bits.Test(i)) gain.weighted_gain += weights[i];
    }
  }
  return gain;
}

}  // namespace

absl::Status CoverageServiceImpl::Evaluate(grpc::ServerContext* context, size_t items, size_t chunk,
                                           const EvaluationPool::Body& body) {
  return p_.pool->Run(
      items, chunk, [this, context] { return p_.calls->CheckStop(context); }, body);
}

grpc::Status CoverageServiceImpl::UploadPart(grpc::ServerContext* context,
                                             grpc::ServerReader<v1::UploadPartRequest>* reader,
                                             v1::UploadPartResponse* response) {
  return p_.calls->Run(
      "UploadPart", context, [&] { return ReceivePart(context, reader, response); },
      CallKind::kStream);
}

absl::Status CoverageServiceImpl::ReceivePart(grpc::ServerContext* context,
                                              grpc::ServerReader<v1::UploadPartRequest>* reader,
                                              v1::UploadPartResponse* response) {
  const auto too_large = [this](int64_t bytes) {
    return WithErrorInfo(absl::ResourceExhaustedError(absl::StrCat(
                             "part file of ", bytes, " bytes or more: the server accepts at most ",
                             p_.max_part_file_bytes)),
                         "PART_TOO_LARGE",
                         {{"max_part_bytes", absl::StrCat(p_.max_part_file_bytes)}});
  };
  v1::UploadPartRequest message;
  SIGHTLINE_ASSIGN_OR_RETURN(const bool begun,
                             p_.calls->Read(context, [&] { return reader->Read(&message); }));
  if (!begun || !message.has_header()) {
    return InvalidFields({{"header", "must be the first message"}});
  }
  const v1::UploadPartRequest::Header header = message.header();
  const std::string name = header.file_name().empty()
                               ? "part"
                               : absl::Utf8SafeCEscape(header.file_name().substr(0, 200));
  std::vector<FieldViolation> violations;
  const std::vector<std::string> formats = PartFormatsInMemory();
  if (std::find(formats.begin(), formats.end(), header.format()) == formats.end()) {
    violations.push_back({"header.format", absl::StrCat("must be ", OneOf(formats))});
  }
  if (header.size_bytes() <= 0) {
    violations.push_back({"header.size_bytes", absl::StrCat(header.size_bytes(), ": must be > 0")});
  }
  SIGHTLINE_RETURN_IF_ERROR(InvalidFields(violations));
  if (header.size_bytes() > p_.max_part_file_bytes) return too_large(header.size_bytes());
  SIGHTLINE_ASSIGN_OR_RETURN(ReceivedFile file, ReceiveChunks(p_.calls, context, reader,
                                                              header.size_bytes(), upload_memory_));
  SIGHTLINE_ASSIGN_OR_RETURN(auto turn, reading_turns_.Wait(PeerOf(*context), [&] {
    return p_.calls->CheckStop(context);
  }));
  absl::StatusOr<TriangleMesh> mesh =
      LoadPartFromMemory(file.bytes, header.format(), header.unit(), name,
                         [&] { return p_.calls->CheckStop(context); });
  if (!mesh.ok()) {
    if (absl::IsInvalidArgument(mesh.status())) {
      return WithErrorInfo(mesh.status(), "PART_INVALID");
    }
    if (absl::IsResourceExhausted(mesh.status())) {
      return WithErrorInfo(mesh.status(), "PART_TOO_LARGE");
    }
    return mesh.status();
  }
  SIGHTLINE_RETURN_IF_ERROR(p_.calls->CheckStop(context));
  file.bytes = std::string();
  auto part = std::make_shared<StoredPart>();
  part->mesh = *std::move(mesh);
  part->health = CheckPartHealth(part->mesh);
  *response->mutable_health() = PartHealthToProto(part->health);
  SIGHTLINE_ASSIGN_OR_RETURN(std::string digest, p_.registry->AddPart(part));
  response->set_part_digest(digest);
  spdlog::info("event=part_uploaded part={} bytes={} triangles={} name={:?}", digest,
               header.size_bytes(), part->health.triangle_count, name);
  return absl::OkStatus();
}

grpc::Status CoverageServiceImpl::CreateScene(grpc::ServerContext* context,
                                              const v1::CreateSceneRequest* request,
                                              v1::CreateSceneResponse* response) {
  return p_.calls->Run("CreateScene", context, [&]() -> absl::Status {
    SIGHTLINE_ASSIGN_OR_RETURN(
        JobRecord job,
        p_.registry->CreateScene(PeerOf(*context), request->request_id(), request->spec()));
    *response->mutable_job() = JobToProto(job);
    return absl::OkStatus();
  });
}

grpc::Status CoverageServiceImpl::GetScene(grpc::ServerContext* context,
                                           const v1::GetSceneRequest* request,
                                           v1::GetSceneResponse* response) {
  return p_.calls->Run("GetScene", context, [&]() -> absl::Status {
    SIGHTLINE_ASSIGN_OR_RETURN(auto stored, p_.registry->FindScene(request->scene_digest()));
    const CoverageScene& scene = *stored->scene;
    response->set_scene_digest(request->scene_digest());
    *response->mutable_spec() = stored->spec;
    response->set_target_count(static_cast<int64_t>(scene.targets().size()));
    response->set_measurable_count(scene.measurable().Count());
    response->set_measurable_in_free_space_count(scene.measurable_in_free_space().Count());
    *response->mutable_part_centre_m() = VectorToProto(scene.part_centre_m());
    *response->mutable_part_size_m() = VectorToProto(scene.part().BoundingBox().sizes());
    response->set_field_bytes(scene.field_bytes());
    response->set_targets_time_s(scene.timings().targets_s);
    response->set_field_time_s(scene.timings().field_s);
    response->set_measurability_time_s(scene.timings().measurability_s);
    response->set_server_build(ProgramBuild());
    return absl::OkStatus();
  });
}

grpc::Status CoverageServiceImpl::StreamTargets(
    grpc::ServerContext* context, const v1::StreamTargetsRequest* request,
    grpc::ServerWriter<v1::StreamTargetsResponse>* writer) {
  const auto stream = [&]() -> absl::Status {
    SIGHTLINE_ASSIGN_OR_RETURN(auto stored, p_.registry->FindScene(request->scene_digest()));
    const TargetSet& targets = stored->scene->targets();
    const TargetBits& measurable = stored->scene->measurable();
    const TargetBits& in_free_space = stored->scene->measurable_in_free_space();
    const std::span<const uint64_t> orientations = stored->scene->measurable_orientations();
    for (size_t begin = 0; begin < targets.size(); begin += kPointsPerMessage) {
      SIGHTLINE_RETURN_IF_ERROR(p_.calls->CheckStop(context));
      v1::StreamTargetsResponse response;
      for (size_t i = begin; i < std::min(targets.size(), begin + kPointsPerMessage); ++i) {
        AddVector(targets.positions_m[i], response.mutable_positions_m());
        AddVector(targets.normals[i], response.mutable_normals());
        response.add_measurable(measurable.Test(i));
        response.add_measurable_in_free_space(in_free_space.Test(i));
        if (!orientations.empty()) response.add_measurable_orientations(orientations[i]);
        response.add_regions(targets.regions[i]);
      }
      SIGHTLINE_RETURN_IF_ERROR(p_.calls->Write(context, [&] { return writer->Write(response); }));
    }
    return absl::OkStatus();
  };
  return p_.calls->Run("StreamTargets", context, stream, CallKind::kStream);
}

grpc::Status CoverageServiceImpl::EvaluateGains(grpc::ServerContext* context,
                                                const v1::EvaluateGainsRequest* request,
                                                v1::EvaluateGainsResponse* response) {
  return p_.calls->Run("EvaluateGains", context,
                       [&] { return Gains(context, *request, response); });
}

grpc::Status CoverageServiceImpl::StreamGains(
    grpc::ServerContext* context,
    grpc::ServerReaderWriter<v1::StreamGainsResponse, v1::StreamGainsRequest>* stream) {
  const auto answer_all = [&]() -> absl::Status {
    v1::StreamGainsRequest request;
    while (true) {
      SIGHTLINE_ASSIGN_OR_RETURN(const bool more,
                                 p_.calls->Read(context, [&] { return stream->Read(&request); }));
      if (!more) return p_.calls->CheckStop(context);
      if (p_.calls->draining()) {
        return WithErrorInfo(absl::UnavailableError("the server is shutting down"), "DRAINING");
      }
      v1::StreamGainsResponse response;
      SIGHTLINE_RETURN_IF_ERROR(Gains(context, request.request(), response.mutable_response()));
      SIGHTLINE_RETURN_IF_ERROR(p_.calls->Write(context, [&] { return stream->Write(response); }));
    }
  };
  return p_.calls->Run("StreamGains", context, answer_all, CallKind::kStream);
}

absl::Status CoverageServiceImpl::Gains(grpc::ServerContext* context,
                                        const v1::EvaluateGainsRequest& request,
                                        v1::EvaluateGainsResponse* response) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto stored, p_.registry->FindScene(request.scene_digest()));
  const CoverageScene& scene = *stored->scene;
  const size_t targets = scene.targets().size();
  SIGHTLINE_RETURN_IF_ERROR(CheckEvaluator(request.evaluator()));
  SIGHTLINE_ASSIGN_OR_RETURN(MeasurementBatch batch, ParseMeasurements(request.measurements()));
  SIGHTLINE_ASSIGN_OR_RETURN(
      std::optional<TargetBits> covered,
      ParseTargetBits(request.covered_targets(), targets, "covered_targets"));
  SIGHTLINE_RETURN_IF_ERROR(CheckWeights(request.target_weights(), targets));
  const TargetBits* covered_bits = covered.has_value() ? &*covered : nullptr;
  if (request.has_uncertainty_gain()) {
    return GainsByUncertainty(context, scene, request, batch, covered_bits, response);
  }
  const std::span<const float> weights(request.target_weights().data(),
                                       static_cast<size_t>(request.target_weights().size()));
  const std::span<const Measurement> inside(batch.inside);
  std::vector<FastGain> gains(inside.size());
  const bool fast = request.evaluator() == v1::EVALUATOR_FAST;
  absl::Status status = Evaluate(
      context, inside.size(), fast ? FastChunk(inside.size(), p_.pool->threads()) : kExactChunk,
      [&](size_t begin, size_t end, const std::atomic<bool>& cancelled) {
        if (fast) {
          scene.EvaluateGains(inside.subspan(begin, end - begin), covered_bits, weights,
                              std::span(gains).subspan(begin, end - begin), &cancelled);
          return;
        }
        for (size_t i = begin; i < end; ++i) {
          const ExactCoverage coverage = scene.EvaluateExact(inside[i], nullptr, &cancelled);
          // A cancelled scan has no valid result, not even a number of targets.
          if (cancelled) return;
          gains[i] = GainOfCoverage(scene, coverage, covered_bits, weights);
        }
      });
  if (!status.ok()) return status;
  p_.metrics->CountQueries(fast ? "fast" : "exact", static_cast<int64_t>(inside.size()));

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
    if (!weights.empty()) gain->set_weighted_gain(gains[i].weighted_gain);
  }
  return absl::OkStatus();
}

grpc::Status CoverageServiceImpl::EvaluateCoverage(grpc::ServerContext* context,
                                                   const v1::EvaluateCoverageRequest* request,
                                                   v1::EvaluateCoverageResponse* response) {
  return p_.calls->Run("EvaluateCoverage", context,
                       [&] { return Coverage(context, *request, response); });
}

absl::Status CoverageServiceImpl::Coverage(grpc::ServerContext* context,
                                           const v1::EvaluateCoverageRequest& request,
                                           v1::EvaluateCoverageResponse* response) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto stored, p_.registry->FindScene(request.scene_digest()));
  const CoverageScene& scene = *stored->scene;
  const size_t targets = scene.targets().size();
  SIGHTLINE_RETURN_IF_ERROR(CheckEvaluator(request.evaluator()));
  SIGHTLINE_ASSIGN_OR_RETURN(MeasurementBatch batch, ParseMeasurements(request.measurements()));
  const bool fast = request.evaluator() == v1::EVALUATOR_FAST;
  if (fast && request.displacements_size() > 0) {
    return InvalidFields({{"displacements", "need EVALUATOR_EXACT"}});
  }
  SIGHTLINE_ASSIGN_OR_RETURN(const auto displacements,
                             ParseDisplacements(request.displacements(), batch));
  // Bytes of the informed targets: a number, at most four bytes, and the information.
  const size_t informed_bytes = fast && scene.uncertainty() != nullptr ? 8 * targets : 0;
  const auto bytes_each =
      static_cast<int64_t>((targets + 7) / 8 * (fast ? 1 : 2) + informed_bytes + 64);
  if (static_cast<int64_t>(batch.size) * bytes_each > kMaxCoverageResponseBytes) {
    return InvalidFields({{"measurements", absl::StrCat(batch.size, ": at most ",
                                                        kMaxCoverageResponseBytes / bytes_each,
                                                        " with ", targets, " targets")}});
  }
  const std::span<const Measurement> inside(batch.inside);
  std::vector<ExactCoverage> coverages(inside.size());
  const bool with_information = fast && scene.uncertainty() != nullptr;
  std::vector<ScanInformation> information(with_information ? inside.size() : 0);
  absl::Status status = Evaluate(
      context, inside.size(), fast ? FastChunk(inside.size(), p_.pool->threads()) : kExactChunk,
      [&](size_t begin, size_t end, const std::atomic<bool>& cancelled) {
        if (!fast) {
          for (size_t i = begin; i < end; ++i) {
            coverages[i] = displacements.empty()
                               ? scene.EvaluateExact(inside[i], nullptr, &cancelled)
                               : scene.EvaluateDisplaced(inside[i], displacements[i], &cancelled);
          }
          return;
        }
        if (with_information) {
          std::vector<FastInformation> chunk(end - begin);
          scene.EvaluateInformation(inside.subspan(begin, end - begin), chunk, &cancelled);
          for (size_t i = begin; i < end; ++i) {
            coverages[i].feasibility = chunk[i - begin].feasibility;
            coverages[i].covered = std::move(chunk[i - begin].covered);
            information[i] = std::move(chunk[i - begin].information);
          }
          return;
        }
        std::vector<FastCoverage> chunk(end - begin);
        scene.EvaluateFastCoverage(inside.subspan(begin, end - begin), chunk, &cancelled);
        for (size_t i = begin; i < end; ++i) {
          coverages[i].feasibility = chunk[i - begin].feasibility;
          coverages[i].covered = std::move(chunk[i - begin].covered);
        }
      });
  if (!status.ok()) return status;
  p_.metrics->CountQueries(fast ? "fast" : "exact", static_cast<int64_t>(inside.size()));

  const std::string none = TargetBits(targets).ToBytes();
  for (size_t i = 0; i < batch.size; ++i) {
    v1::Coverage* coverage = response->add_coverages();
    coverage->set_feasibility(v1::FEASIBILITY_OUT_OF_BOUNDS);
    coverage->set_covered_targets(none);
    if (!fast) coverage->set_covered_targets_without_normal_gate(none);
    coverage->set_last_frame(-1);
  }
  for (size_t i = 0; i < inside.size(); ++i) {
    v1::Coverage* coverage = response->mutable_coverages(static_cast<int>(batch.inside_index[i]));
    const ExactCoverage& result = coverages[i];
    coverage->set_feasibility(FeasibilityToProto(result.feasibility));
    if (result.feasibility != Feasibility::kFeasible) continue;
    coverage->set_covered_targets(result.covered.ToBytes());
    if (with_information) {
      coverage->mutable_informed_targets()->Add(information[i].targets.begin(),
                                                information[i].targets.end());
      coverage->mutable_information_per_m4()->Add(information[i].density.begin(),
                                                  information[i].density.end());
    }
    if (fast) continue;
    coverage->set_covered_targets_without_normal_gate(result.covered_without_normal_gate.ToBytes());
    coverage->set_first_frame(result.first_frame);
    coverage->set_last_frame(result.last_frame);
    coverage->set_measurement_points(result.measurement_points);
  }
  return absl::OkStatus();
}

grpc::Status CoverageServiceImpl::StreamMeasurementPoints(
    grpc::ServerContext* context, const v1::StreamMeasurementPointsRequest* request,
    grpc::ServerWriter<v1::StreamMeasurementPointsResponse>* writer) {
  const auto measure = [&]() -> absl::Status {
    SIGHTLINE_ASSIGN_OR_RETURN(auto stored, p_.registry->FindScene(request->scene_digest()));
    const CoverageScene& scene = *stored->scene;
    SIGHTLINE_ASSIGN_OR_RETURN(Measurement measurement,
                               ParseMeasurement(request->measurement(), "measurement"));
    std::vector<MeasurementPoint> points;
    ExactCoverage coverage;
    SIGHTLINE_RETURN_IF_ERROR(
        Evaluate(context, 1, 1, [&](size_t, size_t, const std::atomic<bool>& cancelled) {
          coverage = scene.EvaluateExact(measurement, &points, &cancelled);
        }));
    p_.metrics->CountQueries("exact", 1);
    if (coverage.feasibility != Feasibility::kFeasible) {
      return InfeasibleScan("measurement", coverage.feasibility);
    }
    for (size_t begin = 0; begin < points.size(); begin += kPointsPerMessage) {
      SIGHTLINE_RETURN_IF_ERROR(p_.calls->CheckStop(context));
      v1::StreamMeasurementPointsResponse response;
      for (size_t i = begin; i < std::min(points.size(), begin + kPointsPerMessage); ++i) {
        AddVector(points[i].position_m, response.mutable_positions_m());
        AddVector(points[i].normal, response.mutable_normals());
        response.add_frames(points[i].frame);
        response.add_columns_px(points[i].column_px);
      }
      SIGHTLINE_RETURN_IF_ERROR(p_.calls->Write(context, [&] { return writer->Write(response); }));
    }
    return absl::OkStatus();
  };
  return p_.calls->Run("StreamMeasurementPoints", context, measure, CallKind::kStream);
}

grpc::Status CoverageServiceImpl::RenderView(grpc::ServerContext* context,
                                             const v1::RenderViewRequest* request,
                                             v1::RenderViewResponse* response) {
  return p_.calls->Run("RenderView", context, [&]() -> absl::Status {
    SIGHTLINE_ASSIGN_OR_RETURN(auto stored, p_.registry->FindScene(request->scene_digest()));
    const CoverageScene& scene = *stored->scene;
    SIGHTLINE_ASSIGN_OR_RETURN(ViewRequest view,
                               ParseViewRequest(*request, scene.targets().size()));
    absl::StatusOr<std::string> png = absl::InternalError("not rendered");
    SIGHTLINE_RETURN_IF_ERROR(
        Evaluate(context, 1, 1, [&](size_t, size_t, const std::atomic<bool>&) {
          png = p_.backend.render_view(scene, view);
        }));
    if (!png.ok()) return png.status();
    response->set_png(*std::move(png));
    return absl::OkStatus();
  });
}

}  // namespace sightline
