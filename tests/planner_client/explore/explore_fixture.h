// SPDX-License-Identifier: Apache-2.0
// A session about a plate with targets on a line, whose coverage is a formula.
#pragma once

#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "planner_client/explore/explore_session.h"
#include "tests/planning/analytic_gain_model.h"

namespace sightline {

// Targets every centimetre from y = -0.5 m to 0.5 m.
inline constexpr size_t kLineTargets = 101;

// A scan at offset y covers the targets within 0.1 m of y; nearer than 0.15 m the camera collides.
inline FunctionGainModel LineGainModel() {
  FunctionGainModel gain_model(kLineTargets, [](const Measurement& m, size_t t) {
    return std::abs(0.01 * static_cast<double>(t) - 0.5 - m.offset_y_m) < 0.1001;
  });
  gain_model.set_feasibility([](const Measurement& m) {
    return m.camera_distance_m < 0.15 ? ScanFeasibility::kCollision : ScanFeasibility::kFeasible;
  });
  return gain_model;
}

inline ExploreTask LineTask(GainModel* gain_model) {
  ExploreTask task;
  task.inspection.name = "line";
  task.inspection.part_file = "parts/plate.stl";
  task.inspection.domain = ThesisDomain();
  task.inspection.rig.lens = Lens{};
  auto mesh = std::make_shared<TriangleMesh>();
  mesh->positions_m = {{-0.1f, -0.5f, 0}, {0.1f, -0.5f, 0}, {0.1f, 0.5f, 0}, {-0.1f, 0.5f, 0}};
  mesh->triangles = {{0, 1, 2}, {0, 2, 3}};
  task.part = mesh;
  for (size_t t = 0; t < kLineTargets; ++t) {
    task.targets.positions_m.emplace_back(0.0f, 0.01f * static_cast<float>(t) - 0.5f, 0.0f);
    task.targets.normals.emplace_back(0.0f, 0.0f, 1.0f);
    task.targets.regions.push_back(-1);
  }
  task.gain_model = gain_model;
  task.no_pictures = "inspection.json: materials is missing: images need the part's materials";
  task.folder = "/nowhere/plan";
  task.saved_before = [] { return false; };
  task.save = [](const std::vector<ExploredScan>&) -> absl::StatusOr<SavedPlan> {
    return SavedPlan{{"/nowhere/plan/plan.json"}};
  };
  return task;
}

inline Json LineMeasurement(double offset_y_m, double camera_distance_m = 0.4) {
  return {{"camera_distance_m", camera_distance_m},
          {"triangulation_angle_deg", 30},
          {"camera_azimuth_deg", 0},
          {"camera_polar_deg", 20},
          {"part_alpha_deg", 0},
          {"part_beta_deg", 0},
          {"part_gamma_deg", 0},
          {"offset_y_m", offset_y_m},
          {"offset_z_m", 0}};
}

}  // namespace sightline
