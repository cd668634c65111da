// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/service/query_validation.h"

#include <cmath>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "core/inspection/vector_proto.h"
#include "core/status/status_macros.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

constexpr int kMinViewSize_px = 16;
constexpr int kMaxViewSize_px = 4096;
constexpr double kLargestDisplacement_m = 1;

bool AllFinite(const Measurement& measurement) {
  for (const double value : ToArray(measurement)) {
    if (!std::isfinite(value)) return false;
  }
  return true;
}

// Measurement has nothing but doubles: reflection names the one at fault.
std::vector<FieldViolation> NotFinite(const v1::Measurement& measurement,
                                      const std::string& field) {
  std::vector<FieldViolation> violations;
  const auto* reflection = measurement.GetReflection();
  const auto* descriptor = measurement.GetDescriptor();
  for (int i = 0; i < descriptor->field_count(); ++i) {
    const double value = reflection->GetDouble(measurement, descriptor->field(i));
    if (!std::isfinite(value)) {
      violations.push_back({absl::StrCat(field, ".", descriptor->field(i)->name()),
                            absl::StrCat(value, ": must be finite")});
    }
  }
  return violations;
}

const MeasurementDomain& Bounds() {
  static const MeasurementDomain* const domain = new MeasurementDomain(ThesisDomain());
  return *domain;
}

}  // namespace

absl::StatusOr<MeasurementBatch> ParseMeasurements(
    const google::protobuf::RepeatedPtrField<v1::Measurement>& measurements) {
  if (measurements.size() > kMaxMeasurementsPerRequest) {
    return InvalidFields({{"measurements", absl::StrCat(measurements.size(), ": at most ",
                                                        kMaxMeasurementsPerRequest)}});
  }
  MeasurementBatch batch;
  batch.size = static_cast<size_t>(measurements.size());
  batch.inside.reserve(batch.size);
  batch.inside_index.reserve(batch.size);
  std::vector<FieldViolation> violations;
  for (int i = 0; i < measurements.size(); ++i) {
    const Measurement measurement = MeasurementFromProto(measurements[i]);
    if (!AllFinite(measurement)) {
      for (FieldViolation& violation :
           NotFinite(measurements[i], absl::StrCat("measurements[", i, "]"))) {
        violations.push_back(std::move(violation));
      }
    } else if (Bounds().Contains(measurement)) {
      batch.inside.push_back(measurement);
      batch.inside_index.push_back(static_cast<size_t>(i));
    }
  }
  SIGHTLINE_RETURN_IF_ERROR(InvalidFields(violations));
  return batch;
}

absl::StatusOr<std::vector<ScanDisplacement>> ParseDisplacements(
    const google::protobuf::RepeatedPtrField<v1::ScanDisplacement>& displacements,
    const MeasurementBatch& batch) {
  std::vector<ScanDisplacement> inside;
  if (displacements.empty()) return inside;
  if (static_cast<size_t>(displacements.size()) != batch.size) {
    return InvalidFields({{"displacements", absl::StrCat(displacements.size(), ": must be ",
                                                         batch.size, ", one per measurement")}});
  }
  std::vector<FieldViolation> violations;
  const auto parse = [&](const v1::Displacement& message, const std::string& field) {
    const Displacement parsed{VectorFromProto(message.rotation_rad()),
                              VectorFromProto(message.translation_m())};
    // Comparisons with NaN are false.
    if (!(parsed.rotation_rad.norm() <= std::numbers::pi)) {
      violations.push_back({field + ".rotation_rad", "must be at most pi long"});
    }
    if (!(parsed.translation_m.cwiseAbs().maxCoeff() <= kLargestDisplacement_m)) {
      violations.push_back({field + ".translation_m", "every coordinate in [-1, 1] m"});
    }
    return parsed;
  };
  for (const size_t index : batch.inside_index) {
    const v1::ScanDisplacement& message = displacements[static_cast<int>(index)];
    const std::string field = absl::StrCat("displacements[", index, "]");
    inside.push_back({parse(message.part(), field + ".part"),
                      parse(message.camera(), field + ".camera"),
                      parse(message.laser(), field + ".laser")});
  }
  SIGHTLINE_RETURN_IF_ERROR(InvalidFields(violations));
  return inside;
}

absl::StatusOr<Measurement> ParseMeasurement(const v1::Measurement& measurement,
                                             const std::string& field) {
  SIGHTLINE_RETURN_IF_ERROR(InvalidFields(NotFinite(measurement, field)));
  const Measurement parsed = MeasurementFromProto(measurement);
  if (!Bounds().Contains(parsed)) {
    return InvalidFields({{field, "a parameter is outside Table 2.1"}});
  }
  return parsed;
}

absl::Status CheckEvaluator(v1::Evaluator evaluator) {
  if (evaluator == v1::EVALUATOR_FAST || evaluator == v1::EVALUATOR_EXACT) {
    return absl::OkStatus();
  }
  return InvalidFields({{"evaluator", "must be EVALUATOR_FAST or EVALUATOR_EXACT"}});
}

absl::StatusOr<std::optional<TargetBits>> ParseTargetBits(const std::string& bytes, size_t targets,
                                                          const std::string& field) {
  if (bytes.empty()) return std::optional<TargetBits>();
  const size_t expected = (targets + 7) / 8;
  if (bytes.size() != expected) {
    return InvalidFields({{field, absl::StrCat(bytes.size(), " bytes; ", targets, " targets need ",
                                               expected, " (or none)")}});
  }
  return std::optional<TargetBits>(TargetBits::FromBytes(targets, bytes));
}

absl::Status CheckWeights(const google::protobuf::RepeatedField<float>& weights, size_t targets) {
  if (weights.empty()) return absl::OkStatus();
  if (static_cast<size_t>(weights.size()) != targets) {
    return InvalidFields(
        {{"target_weights", absl::StrCat(weights.size(), " weights for ", targets, " targets")}});
  }
  for (int i = 0; i < weights.size(); ++i) {
    if (!std::isfinite(weights[i]) || weights[i] < 0) {
      return InvalidFields({{absl::StrCat("target_weights[", i, "]"),
                             absl::StrCat(weights[i], ": must be finite and >= 0")}});
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<UncertaintyRequirement> ParseUncertaintyGain(const v1::UncertaintyGain& gain,
                                                            size_t targets) {
  std::vector<FieldViolation> violations;
  const v1::GainWeights& w = gain.weights();
  double sum = 0;
  for (const auto& [name, value] :
       {std::pair("coverage", w.coverage()), std::pair("admissible", w.admissible()),
        std::pair("relaxed", w.relaxed()), std::pair("information", w.information()),
        std::pair("total_uncertainty", w.total_uncertainty())}) {
    if (!(value >= 0 && std::isfinite(value))) {
      violations.push_back({absl::StrCat("uncertainty_gain.weights.", name),
                            absl::StrCat(value, ": must be finite and >= 0")});
    }
    sum += value;
  }
  if (violations.empty() && sum == 0) {
    violations.push_back({"uncertainty_gain.weights", "one must be above 0"});
  }
  const auto check = [&](const char* field, const google::protobuf::RepeatedField<float>& values,
                         bool may_be_one, bool may_be_none) {
    const std::string path = absl::StrCat("uncertainty_gain.", field);
    const auto size = static_cast<size_t>(values.size());
    if (!(size == targets || (may_be_one && size == 1) || (may_be_none && size == 0))) {
      violations.push_back({path, absl::StrCat(size, " values for ", targets, " targets")});
      return;
    }
    for (int i = 0; i < values.size(); ++i) {
      if (values[i] >= 0 && std::isfinite(values[i])) continue;
      violations.push_back(
          {absl::StrCat(path, "[", i, "]"), absl::StrCat(values[i], ": must be finite and >= 0")});
      return;
    }
  };
  check("admissible_uncertainty_m", gain.admissible_uncertainty_m(), true, false);
  check("known_information_per_m4", gain.known_information_per_m4(), false, true);
  if (!(gain.relaxed_uncertainty_m() >= 0 && std::isfinite(gain.relaxed_uncertainty_m()))) {
    violations.push_back({"uncertainty_gain.relaxed_uncertainty_m",
                          absl::StrCat(gain.relaxed_uncertainty_m(), ": must be finite and >= 0")});
  }
  SIGHTLINE_RETURN_IF_ERROR(InvalidFields(violations));
  UncertaintyRequirement requirement;
  requirement.weights = {w.coverage(), w.admissible(), w.relaxed(), w.information(),
                         w.total_uncertainty()};
  requirement.admissible_uncertainty_m = {
      gain.admissible_uncertainty_m().data(),
      static_cast<size_t>(gain.admissible_uncertainty_m().size())};
  requirement.relaxed_uncertainty_m = gain.relaxed_uncertainty_m();
  requirement.known_density = {gain.known_information_per_m4().data(),
                               static_cast<size_t>(gain.known_information_per_m4().size())};
  return requirement;
}

absl::StatusOr<std::vector<uint32_t>> ParseTargetIndices(
    const google::protobuf::RepeatedField<uint32_t>& indices, size_t targets,
    const std::string& field) {
  std::vector<uint32_t> result(indices.begin(), indices.end());
  if (result.size() > targets) {
    return InvalidFields(
        {{field, absl::StrCat(result.size(), " entries for ", targets, " targets")}});
  }
  for (size_t i = 0; i < result.size(); ++i) {
    if (result[i] < targets) continue;
    return InvalidFields({{absl::StrCat(field, "[", i, "]"),
                           absl::StrCat(result[i], ": there are ", targets, " targets")}});
  }
  if (result.empty()) {
    for (size_t t = 0; t < targets; ++t) result.push_back(static_cast<uint32_t>(t));
  }
  return result;
}

absl::StatusOr<ViewRequest> ParseViewRequest(const v1::RenderViewRequest& request, size_t targets) {
  ViewRequest view;
  std::vector<FieldViolation> violations;
  switch (request.view()) {
    case v1::RenderViewRequest::VIEW_FREE:
      view.kind = ViewKind::kFree;
      break;
    case v1::RenderViewRequest::VIEW_CAMERA:
      view.kind = ViewKind::kCamera;
      break;
    case v1::RenderViewRequest::VIEW_COVERAGE:
      view.kind = ViewKind::kCoverage;
      break;
    case v1::RenderViewRequest::VIEW_MEASURABILITY:
      view.kind = ViewKind::kMeasurability;
      break;
    default:
      violations.push_back({"view", "must be given"});
  }
  if (view.kind == ViewKind::kCamera && !request.has_measurement()) {
    violations.push_back({"measurement", "must be given for VIEW_CAMERA"});
  }
  const auto number = [&violations](const char* field, double value, double min, double max) {
    if (!(value >= min && value <= max)) {  // also NaN
      violations.push_back({field, absl::StrCat(value, ": must be in [", min, ", ", max, "]")});
    }
  };
  number("stage_position_m", request.stage_position_m(), -100, 100);
  number("azimuth_deg", request.azimuth_deg(), -360, 360);
  number("elevation_deg", request.elevation_deg(), -90, 90);
  number("distance_m", request.distance_m(), 0, 100);
  if (request.columns_px() != 0) view.columns_px = request.columns_px();
  if (request.rows_px() != 0) view.rows_px = request.rows_px();
  number("columns_px", view.columns_px, kMinViewSize_px, kMaxViewSize_px);
  number("rows_px", view.rows_px, kMinViewSize_px, kMaxViewSize_px);
  SIGHTLINE_RETURN_IF_ERROR(InvalidFields(violations));

  if (request.has_measurement()) {
    SIGHTLINE_ASSIGN_OR_RETURN(view.measurement,
                               ParseMeasurement(request.measurement(), "measurement"));
  }
  SIGHTLINE_ASSIGN_OR_RETURN(
      std::optional<TargetBits> covered,
      ParseTargetBits(request.covered_targets(), targets, "covered_targets"));
  view.covered = covered.has_value() ? *std::move(covered) : TargetBits(targets);
  view.stage_m = request.stage_position_m();
  view.azimuth_rad = request.azimuth_deg() * std::numbers::pi / 180;
  view.elevation_rad = request.elevation_deg() * std::numbers::pi / 180;
  view.distance_m = request.distance_m();
  return view;
}

}  // namespace sightline
