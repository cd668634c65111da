// SPDX-License-Identifier: Apache-2.0
// Uncertainty of each target after a plan, as values for reports and files.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "core/targets/target_set.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

// Standard uncertainty of single points of one scan along the surface's normal, before any
// inference from several points (sensitivity map, thesis Fig. 3.5). Structure of arrays; part
// coordinates.
struct ScanSensitivityMap {
  std::vector<Eigen::Vector3f> positions_m;
  std::vector<float> detection_m;
  std::vector<float> calibration_m;  // empty: no calibration errors
};

// Values after all scans of a plan, one element per target in each array. The components are those
// of SurfaceUncertainty: total^2 = noise^2 + sampling^2 + calibration^2 + registration^2. Finite,
// >= 0.
struct TargetUncertainties {
  std::vector<double> total_m, noise_m, sampling_m, calibration_m;
  std::vector<double> registration_m;  // empty: no set-ups are joined
  std::vector<double> admissible_m;    // 0: no tolerance binds the target
  double relaxed_m = 0;                // 0: none
  // The limit of each target that is not admissible (inadmissible.h); empty: unknown.
  std::vector<v1::UncertaintyLimit> limits;
  // Optional: one map per scan of the plan, empty for scans without.
  std::vector<ScanSensitivityMap> scan_sensitivities;
  // Optional: targets of each feature of plan.uncertainty, to highlight them.
  std::vector<std::vector<uint32_t>> feature_targets;
};

// The numbers are those in files and in the report's viewer.
enum class UncertaintyClass : uint8_t {
  kAdmissible = 0,     // u <= admissible uncertainty
  kRelaxed = 1,        // above it, u <= relaxed uncertainty
  kNotReached = 2,     // above both
  kNotToleranced = 3,  // measurable, but no tolerance binds it
  kNotMeasurable = 4,  // not measurable by any scan
};
inline constexpr int kUncertaintyClasses = 5;

UncertaintyClass ClassOfTarget(const TargetUncertainties& uncertainties,
                               const TargetBits& measurable, size_t target);

enum class UncertaintyPart : uint8_t { kNoise, kSampling, kCalibration, kRegistration };

// The largest component; the first one if several are equal.
UncertaintyPart DominatingPart(const TargetUncertainties& uncertainties, size_t target);

// INVALID_ARGUMENT names `context`, the field, its size or value, and what is allowed. `scans` and
// `features` are those of the plan.
absl::Status CheckTargetUncertainties(const TargetUncertainties& uncertainties, size_t targets,
                                      size_t scans, size_t features, const std::string& context);

}  // namespace sightline
