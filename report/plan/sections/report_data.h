// SPDX-License-Identifier: Apache-2.0
// The data of a plan's report.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "core/part/mesh.h"
#include "core/rig/rig.h"
#include "core/targets/target_set.h"
#include "core/targets/uncovered_reason.h"
#include "report/plan/sections/robot_section.h"
#include "report/uncertainty/target_uncertainty.h"
#include "sightline/v1/pareto.pb.h"
#include "sightline/v1/part.pb.h"
#include "sightline/v1/plan.pb.h"
#include "sightline/v1/rig.pb.h"

namespace sightline {

// Data of a scan that the report shows beside the plan's own numbers.
struct ReportScan {
  TargetBits covered;             // exact, of this scan alone, one bit per target
  std::string rendered_view_png;  // part, camera and laser; empty: none
  std::string near_view_png;      // of the first scan of a set-up: the part as it lies; empty: none
};

struct NamedTiming {
  std::string name;
  double seconds = 0;
};

// Scans that one strategy needed over several seeds.
struct StrategyComparison {
  // For one goal, over the seeds that reached it.
  struct Scans {
    double median = 0;
    int min = 0;
    int max = 0;
    int seeds_reached = 0;  // 0: the other fields are undefined
  };
  std::string strategy;
  int seeds = 0;
  std::vector<Scans> scans;  // one per goal
};

struct ComparisonTable {
  std::vector<double> goals;  // fraction of the measurable targets, e.g. 0.9, 0.95
  std::vector<StrategyComparison> strategies;
};

// A deviation of a measured part from the CAD model, in coordinates of the model.
struct ReportDeviation {
  Eigen::Vector3f position_m, normal;
  float deviation_m = 0;
  bool significant = false;
};

// Drawn around the part.
struct ReportObstacle {
  std::string name;
  v1::Obstacle::Frame frame = v1::Obstacle::FRAME_PART;
  std::shared_ptr<const TriangleMesh> mesh;  // in coordinates of its frame
};

// The plan's index, poses and numbers are used unchanged.
struct ReportData {
  v1::Plan plan;
  v1::PartHealth health;
  std::string part_name;  // as the engineer knows it, e.g. the file name
  TriangleMesh mesh;
  Rig rig;
  TargetSet targets;
  TargetSampling sampling;
  TargetBits measurable;
  std::vector<ReportScan> scans;  // in the order of plan.scans
  std::string measurability_png;  // empty: none
  std::string coverage_png;       // after the last scan; empty: none
  // A picture for each of plan.resting_faces, seen square-on from outside; or empty.
  std::vector<std::string> face_pictures_png;
  bool one_housing = false;  // camera and laser are moved as one
  // Reasons why targets are not covered, one per target; empty: unknown.
  std::vector<TargetReason> reasons;
  std::optional<ExposureLimits> permitted_exposures;  // unset: light limits no target
  // In the order of the indices in `reasons`.
  std::vector<ReportObstacle> obstacles;
  std::vector<NamedTiming> timings;
  std::optional<ComparisonTable> comparison;
  std::optional<v1::ParetoFront> pareto;  // the front that contains the plan
  // Only for plans for uncertainty: values shown on the part. plan.uncertainty is always shown.
  std::optional<TargetUncertainties> uncertainty;
  // Only for plans with plan.as_measured.
  std::vector<ReportDeviation> deviations;
  std::optional<ReportRobot> robot;
  std::vector<std::string> notes;
  // Depth per pixel of every target by the scan that covers it best [m], 0: none; empty: not shown.
  std::vector<float> depth_per_pixel_m;
  std::string set_up_sheet;  // file beside the report; empty: none
};

// INVALID_ARGUMENT names the field whose size does not agree: scans (also of the robot) with
// plan.scans; bit sets, depths, reasons and uncertainties with targets; poses without 16 numbers.
// It is also returned for uncertainties that are negative or not finite. Needs at least one target
// and one triangle; scans may be empty.
absl::Status CheckReportData(const ReportData& data);

}  // namespace sightline
