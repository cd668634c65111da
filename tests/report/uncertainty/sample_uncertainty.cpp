// SPDX-License-Identifier: Apache-2.0
#include "tests/report/uncertainty/sample_uncertainty.h"

#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "report/uncertainty/inadmissible.h"

namespace sightline {
namespace {

struct Parts {
  double noise_um, sampling_um, calibration_um;
};

Parts PartsOfColumn(int column) {
  if (column == 0) return {4, 3, 0};
  if (column <= 2) return {30, 0, 40};
  if (column <= 4) return {60, 0, 0};
  if (column <= 6) return {60, 0, 80};
  if (column == 7) return {0, 2000, 0};
  return {0, 10000, 0};
}

v1::FeatureVerdict Feature(const char* id, const char* name, const char* kind, double zone_um,
                           double u_um, bool proven, const char* because) {
  v1::FeatureVerdict feature;
  feature.set_id(id);
  feature.set_name(name);
  feature.set_kind(kind);
  feature.set_zone_width_m(1e-6 * zone_um);
  feature.set_targets(20);
  feature.set_measured_targets(proven ? 20 : 10);
  feature.set_admissible_targets(proven ? 20 : 0);
  feature.set_uncertainty_m(1e-6 * u_um);
  feature.set_noise_m(0.6e-6 * u_um);
  feature.set_sampling_m(0);
  feature.set_calibration_m(0.8e-6 * u_um);
  feature.set_admissible_uncertainty_m(0.25e-6 * zone_um);
  feature.set_acceptance_zone_m(1e-6 * (zone_um - 4 * u_um));
  feature.set_probability_wrong_acceptance(0.0004);
  feature.set_probability_wrong_rejection(0.031);
  feature.set_can_be_proven(proven);
  feature.set_verdict(proven ? v1::FeatureVerdict::CAN_BE_PROVEN
                             : v1::FeatureVerdict::CANNOT_BE_PROVEN);
  feature.set_because(because);
  return feature;
}

}  // namespace

ReportData SampleUncertaintyPlan() {
  ReportData data;
  data.mesh.positions_m = {{0, 0, 0}, {0.05f, 0, 0}, {0.05f, 0.05f, 0}, {0, 0.05f, 0}};
  data.mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  data.part_name = "plate.glb";
  data.plan.set_inspection_name("plate");
  TargetUncertainties u;
  u.relaxed_m = 1e-3;
  data.measurable = TargetBits(100);
  int64_t admissible = 0, relaxed = 0, toleranced = 0;
  for (int i = 0; i < 100; ++i) {
    const int column = i % 10, row = i / 10;
    data.targets.positions_m.push_back(
        {0.005f * static_cast<float>(column), 0.005f * static_cast<float>(row), 0});
    data.targets.normals.push_back({0, 0, 1});
    data.targets.regions.push_back(-1);
    data.targets.triangles.push_back(0);
    if (i != 1) data.measurable.Set(i);
    const Parts parts = PartsOfColumn(column);
    u.noise_m.push_back(1e-6 * parts.noise_um);
    u.sampling_m.push_back(1e-6 * parts.sampling_um);
    u.calibration_m.push_back(1e-6 * parts.calibration_um);
    u.total_m.push_back(1e-6 * std::hypot(parts.noise_um, parts.sampling_um, parts.calibration_um));
    u.admissible_m.push_back(column == 0 ? 0 : 50e-6);
    if (column == 0 || i == 1) continue;
    ++toleranced;
    admissible += column <= 2;
    relaxed += column <= 6;
  }
  for (int k = 0; k < 2; ++k) {
    ReportScan extra;
    extra.covered = TargetBits(100);
    ScanSensitivityMap map;
    for (int i = 0; i < 100; ++i) {
      if (i == 1 || i % 10 < 3 * k || i % 10 > 4 + 3 * k) continue;
      extra.covered.Set(i);
      // A point 1 mm beside the target, so that the nearest one is its own.
      map.positions_m.push_back(data.targets.positions_m[i] + Eigen::Vector3f(0.001f, 0, 0));
      map.detection_m.push_back(1e-6f * static_cast<float>(100 + i));
      map.calibration_m.push_back(0);
    }
    if (k == 1) map = {};
    v1::PlannedScan* scan = data.plan.add_scans();
    scan->set_index(k + 1);
    scan->mutable_measurement()->set_camera_distance_m(0.3);
    scan->mutable_measurement()->set_triangulation_angle_deg(30);
    scan->set_stage_start_m(-0.011);
    scan->set_stage_end_m(0.044);
    scan->add_trigger_positions_m(-0.011);
    scan->add_trigger_positions_m(0.044);
    scan->set_cumulative_targets(extra.covered.Count());
    scan->set_cumulative_admissible_targets(k == 0 ? 10 : admissible);
    scan->set_cumulative_relaxed_targets(k == 0 ? 40 : relaxed);
    for (v1::Pose* pose :
         {scan->mutable_camera_pose(), scan->mutable_laser_pose(), scan->mutable_part_pose()}) {
      for (int i = 0; i < 16; ++i) pose->add_matrix(i % 5 == 0);
    }
    data.scans.push_back(std::move(extra));
    u.scan_sensitivities.push_back(std::move(map));
  }
  v1::PlanCoverage& coverage = *data.plan.mutable_coverage();
  coverage.set_targets(100);
  coverage.set_measurable_targets(99);
  coverage.set_covered_targets(79);
  coverage.set_coverage(79.0 / 99);
  coverage.set_goal(0.95);
  v1::PlanUncertainty& uncertainty = *data.plan.mutable_uncertainty();
  uncertainty.set_judged_targets(toleranced);
  uncertainty.set_admissible_fraction(static_cast<double>(admissible) /
                                      static_cast<double>(toleranced));
  uncertainty.set_relaxed_fraction(static_cast<double>(relaxed) / static_cast<double>(toleranced));
  uncertainty.set_fresh_admissible_fraction(0.2);
  uncertainty.set_fresh_relaxed_fraction(0.6);
  uncertainty.set_fresh_judged_targets(1234);
  uncertainty.set_goal(0.8);
  uncertainty.set_relaxed_uncertainty_m(1e-3);
  uncertainty.set_median_uncertainty_m(60e-6);
  *uncertainty.add_features() = Feature("#1", "top", "flatness", 100, 10, true, "");
  *uncertainty.add_features() =
      Feature("#2", "bore", "position", 200, 71, false, "u exceeds the admissible 50 um");
  *uncertainty.add_features() = Feature("#3", "rail", "linear size", 300, 60, true, "");
  *uncertainty.add_features() =
      Feature("#4", "pocket", "cylindricity", 50, std::numeric_limits<double>::infinity(), false,
              "not measured");
  *uncertainty.add_features() = Feature("#5", "edge", "parallelism", 100, 24, true, "");
  TargetBits covered(100);
  for (const ReportScan& scan : data.scans) covered |= scan.covered;
  std::vector<int32_t> points;
  for (int i = 0; i < 100; ++i) points.push_back(i % 10 == 3 ? 25 : 100);
  u.limits = UncertaintyLimits(u, data.measurable, covered, points, data.targets.regions);
  for (v1::InadmissibleCount& count : CountInadmissible(u)) {
    *uncertainty.add_inadmissible() = std::move(count);
  }
  for (uint32_t f = 0; f < 5; ++f) u.feature_targets.push_back({10 * f, 10 * f + 5});
  data.plan.set_stop_reason(v1::Plan::STOP_REASON_STALLED);
  data.uncertainty = std::move(u);
  return data;
}

}  // namespace sightline
