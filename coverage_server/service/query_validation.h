// SPDX-License-Identifier: Apache-2.0
// Checks requests once, at the border of the service.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"
#include "core/targets/target_set.h"
#include "coverage_server/scene/coverage_scene.h"
#include "coverage_server/view/render_view.h"
#include "sightline/v1/coverage_service.pb.h"

namespace sightline {

inline constexpr int kMaxMeasurementsPerRequest = 4096;

// The measurements of a batch. Those outside Table 2.1 are separated: their answer is
// OUT_OF_BOUNDS, without a query of the scene.
struct MeasurementBatch {
  size_t size = 0;
  std::vector<Measurement> inside;
  std::vector<size_t> inside_index;  // position of inside[i] in the batch
};

// INVALID_ARGUMENT with field violations for a parameter that is not finite or more than 4096
// measurements.
absl::StatusOr<MeasurementBatch> ParseMeasurements(
    const google::protobuf::RepeatedPtrField<v1::Measurement>& measurements);

// One measurement that must be inside Table 2.1; `field` is its path in the request.
absl::StatusOr<Measurement> ParseMeasurement(const v1::Measurement& measurement,
                                             const std::string& field);

// `displacements` is empty or has one entry per measurement of the batch. Returns the entries of
// the measurements inside Table 2.1. INVALID_ARGUMENT: another number of entries, or coordinates
// that are not finite or too large.
absl::StatusOr<std::vector<ScanDisplacement>> ParseDisplacements(
    const google::protobuf::RepeatedPtrField<v1::ScanDisplacement>& displacements,
    const MeasurementBatch& batch);

// EVALUATOR_FAST or EVALUATOR_EXACT.
absl::Status CheckEvaluator(v1::Evaluator evaluator);

// Empty bytes: nullopt. Otherwise exactly (targets + 7) / 8 bytes.
absl::StatusOr<std::optional<TargetBits>> ParseTargetBits(const std::string& bytes, size_t targets,
                                                          const std::string& field);

// OK: `weights` is empty or has one finite weight >= 0 per target.
absl::Status CheckWeights(const google::protobuf::RepeatedField<float>& weights, size_t targets);

// Checks a gain by uncertainty: weights, not all 0; one admissible uncertainty, or one per target;
// accumulated information of no or of every target; all numbers finite and >= 0. The spans of the
// result point into the message.
absl::StatusOr<UncertaintyRequirement> ParseUncertaintyGain(const v1::UncertaintyGain& gain,
                                                            size_t targets);

// Indices below `targets`, empty: all of them.
absl::StatusOr<std::vector<uint32_t>> ParseTargetIndices(
    const google::protobuf::RepeatedField<uint32_t>& indices, size_t targets,
    const std::string& field);

// `targets`: number of targets of the scene.
absl::StatusOr<ViewRequest> ParseViewRequest(const v1::RenderViewRequest& request, size_t targets);

}  // namespace sightline
