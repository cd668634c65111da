// SPDX-License-Identifier: Apache-2.0
// Queries for the reasons of uncovered targets.
#include <span>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/inspection/inspection.h"
#include "core/status/status_macros.h"
#include "coverage_server/service/coverage_service.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

constexpr int kMaxTargets = 100'000;
// Targets between two checks of the deadline; an explanation takes about a millisecond.
constexpr size_t kExplanationChunk = 64;

v1::UncoveredReason ReasonToProto(UncoveredReason reason) {
  switch (reason) {
    case UncoveredReason::kNotChosen:
      return v1::UNCOVERED_REASON_NOT_CHOSEN;
    case UncoveredReason::kAngle:
      return v1::UNCOVERED_REASON_ANGLE;
    case UncoveredReason::kFootprint:
      return v1::UNCOVERED_REASON_FOOTPRINT;
    case UncoveredReason::kDefocus:
      return v1::UNCOVERED_REASON_DEFOCUS;
    case UncoveredReason::kRange:
      return v1::UNCOVERED_REASON_RANGE;
    case UncoveredReason::kOwnOcclusion:
      return v1::UNCOVERED_REASON_OWN_OCCLUSION;
    case UncoveredReason::kObstacle:
      return v1::UNCOVERED_REASON_OBSTACLE;
    case UncoveredReason::kCollision:
      return v1::UNCOVERED_REASON_COLLISION;
    case UncoveredReason::kTravel:
      return v1::UNCOVERED_REASON_TRAVEL;
    case UncoveredReason::kTooDark:
      return v1::UNCOVERED_REASON_TOO_DARK;
    case UncoveredReason::kTooBright:
      return v1::UNCOVERED_REASON_TOO_BRIGHT;
  }
  return v1::UNCOVERED_REASON_UNSPECIFIED;
}

}  // namespace

grpc::Status CoverageServiceImpl::ExplainTargets(grpc::ServerContext* context,
                                                 const v1::ExplainTargetsRequest* request,
                                                 v1::ExplainTargetsResponse* response) {
  return p_.calls->Run("ExplainTargets", context,
                       [&] { return Explain(context, *request, response); });
}

absl::Status CoverageServiceImpl::Explain(grpc::ServerContext* context,
                                          const v1::ExplainTargetsRequest& request,
                                          v1::ExplainTargetsResponse* response) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto stored, p_.registry->FindScene(request.scene_digest()));
  const CoverageScene& scene = *stored->scene;
  if (request.targets_size() > kMaxTargets) {
    return InvalidFields(
        {{"targets", absl::StrCat(request.targets_size(), ": at most ", kMaxTargets)}});
  }
  const std::vector<uint32_t> targets(request.targets().begin(), request.targets().end());
  for (size_t i = 0; i < targets.size(); ++i) {
    if (targets[i] < scene.targets().size()) continue;
    return InvalidFields(
        {{absl::StrCat("targets[", i, "]"),
          absl::StrCat(targets[i], ": there are ", scene.targets().size(), " targets")}});
  }
  if (!stored->spec.has_measurement()) {
    return WithErrorInfo(
        absl::FailedPreconditionError("the scene was created without spec.measurement, so no "
                                      "domain of scans is known"),
        "SCENE_WITHOUT_DOMAIN");
  }
  SIGHTLINE_ASSIGN_OR_RETURN(const auto domain,
                             ParseMeasurementDomain(stored->spec.measurement(), "spec"));
  std::vector<TargetExplanation> explanations(targets.size());
  SIGHTLINE_RETURN_IF_ERROR(
      Evaluate(context, targets.size(), kExplanationChunk,
               [&](size_t begin, size_t end, const std::atomic<bool>& cancelled) {
                 scene.Explain(domain, std::span(targets).subspan(begin, end - begin),
                               std::span(explanations).subspan(begin, end - begin), &cancelled);
               }));
  p_.metrics->CountQueries("explanation", static_cast<int64_t>(targets.size()));
  response->mutable_explanations()->Reserve(static_cast<int>(targets.size()));
  for (const TargetExplanation& explanation : explanations) {
    v1::ExplainTargetsResponse::Explanation& message = *response->add_explanations();
    message.set_reason(ReasonToProto(explanation.reason));
    message.set_obstacle(explanation.obstacle);
    message.set_tried_scans(explanation.tried_scans);
    message.set_scans_with_reason(explanation.scans_with_reason);
    message.set_exposure_time_s(explanation.exposure_time_s);
  }
  return absl::OkStatus();
}

}  // namespace sightline
