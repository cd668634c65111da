// SPDX-License-Identifier: Apache-2.0
#include "planning/strategy/execution/execution_model.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <utility>

#include "core/rig/scan_geometry.h"

namespace sightline {
namespace {

constexpr double kSame = 1e-9;  // rad or m

double TurnBetween(double a_rad, double b_rad) {
  return std::abs(std::remainder(a_rad - b_rad, 2 * std::numbers::pi));
}

bool SameValue(double a, double b) { return std::abs(a - b) < kSame; }
bool SameAngle(double a_rad, double b_rad) { return TurnBetween(a_rad, b_rad) < kSame; }

double RepositionByCosts(const CostModel& costs, const Measurement& from, const Measurement& to) {
  const double rotation_rad =
      std::max({std::abs(from.triangulation_angle_rad - to.triangulation_angle_rad),
                std::abs(from.camera_polar_rad - to.camera_polar_rad),
                TurnBetween(from.camera_azimuth_rad, to.camera_azimuth_rad),
                TurnBetween(from.part_alpha_rad, to.part_alpha_rad),
                TurnBetween(from.part_beta_rad, to.part_beta_rad),
                TurnBetween(from.part_gamma_rad, to.part_gamma_rad)});
  const double translation_m = std::max({std::abs(from.camera_distance_m - to.camera_distance_m),
                                         std::abs(from.offset_y_m - to.offset_y_m),
                                         std::abs(from.offset_z_m - to.offset_z_m)});
  double moving_s = 0;
  if (costs.reposition_speed_rad_per_s) {
    moving_s = rotation_rad / *costs.reposition_speed_rad_per_s;
  }
  if (costs.reposition_speed_m_per_s) {
    moving_s = std::max(moving_s, translation_m / *costs.reposition_speed_m_per_s);
  }
  return costs.reposition_time_s.value_or(0) + moving_s;
}

// Height of the part's lowest point above its centre [m].
double LowestOverCentre(const ExecutionModel& model, const Measurement& scan) {
  if (model.support_points_m == nullptr || model.support_points_m->empty()) return 0;
  Measurement rest;
  rest.part_alpha_rad = scan.part_alpha_rad;
  rest.part_beta_rad = scan.part_beta_rad;
  Rig rig;
  rig.part_support_points_m = model.support_points_m;
  return MakeScanGeometry(rig, rest).table_height_m;
}

}  // namespace

ExecutionModel ExecutionModelOf(const Inspection& inspection) {
  ExecutionModel model;
  model.costs = inspection.costs;
  model.scan_step_m = inspection.rig.scan_step_m;
  model.stage_moves_in_height = inspection.stage_moves_in_height;
  if (inspection.robot) {
    model.robot_holds_head = inspection.robot->load == RobotMount::Load::kSensorHead;
    model.robot_holds_part = inspection.robot->load == RobotMount::Load::kPart;
  }
  model.support_points_m = inspection.rig.part_support_points_m;
  return model;
}

double TableHeight(const ExecutionModel& model, const Measurement& scan) {
  return scan.offset_z_m + LowestOverCentre(model, scan);
}

bool SamePlaceOfSensors(const ExecutionModel& model, const Measurement& a, const Measurement& b) {
  if (!SameValue(a.camera_distance_m, b.camera_distance_m) ||
      !SameValue(a.triangulation_angle_rad, b.triangulation_angle_rad)) {
    return false;
  }
  if (model.robot_holds_head) return true;
  if (!SameAngle(a.camera_azimuth_rad, b.camera_azimuth_rad) ||
      !SameValue(a.camera_polar_rad, b.camera_polar_rad)) {
    return false;
  }
  return model.stage_moves_in_height || model.robot_holds_part ||
         SameValue(TableHeight(model, a), TableHeight(model, b));
}

bool SameRest(const ExecutionModel& model, const Measurement& a, const Measurement& b) {
  return model.robot_holds_part || (SameAngle(a.part_alpha_rad, b.part_alpha_rad) &&
                                    SameAngle(a.part_beta_rad, b.part_beta_rad));
}

Measurement AtPlaceOf(const ExecutionModel& model, const Measurement& place, Measurement scan) {
  scan.camera_distance_m = place.camera_distance_m;
  scan.triangulation_angle_rad = place.triangulation_angle_rad;
  if (model.robot_holds_head) return scan;
  scan.camera_azimuth_rad = place.camera_azimuth_rad;
  scan.camera_polar_rad = place.camera_polar_rad;
  if (!model.stage_moves_in_height && !model.robot_holds_part) {
    scan.offset_z_m = TableHeight(model, place) - LowestOverCentre(model, scan);
  }
  return scan;
}

ChangeTimes TimesBetween(const ExecutionModel& model, const Measurement& from,
                         const Measurement& to) {
  ChangeTimes times;
  times.reposition_s = RepositionByCosts(model.costs, from, to);
  if (!SamePlaceOfSensors(model, from, to)) {
    times.move_sensors_s = model.costs.move_sensors_time_s;
  }
  if (!SameRest(model, from, to)) {
    times.lay_s = model.costs.lay_time_s;
  } else if (!SameAngle(from.part_gamma_rad, to.part_gamma_rad) ||
             !SameValue(from.offset_y_m, to.offset_y_m) ||
             (model.stage_moves_in_height && !SameValue(from.offset_z_m, to.offset_z_m))) {
    times.turn_s = model.costs.turn_time_s;
  }
  return times;
}

ChangeTimes TimesBeforeFirst(const ExecutionModel& model) {
  ChangeTimes times;
  times.lay_s = model.costs.lay_time_s;
  times.move_sensors_s = model.costs.move_sensors_time_s;
  return times;
}

std::vector<Placings> PlacingsOf(const ExecutionModel& model, std::span<const Measurement> scans) {
  std::vector<Placings> placings;
  for (size_t i = 0; i < scans.size(); ++i) {
    Placings placing{i, i};
    if (i > 0) {
      const Measurement &before = scans[i - 1], &scan = scans[i];
      const bool sensors_stay = !model.robot_holds_head && SamePlaceOfSensors(model, before, scan);
      const bool part_stays = !model.robot_holds_part && SameRest(model, before, scan) &&
                              SameAngle(before.part_gamma_rad, scan.part_gamma_rad) &&
                              SameValue(before.offset_y_m, scan.offset_y_m) &&
                              SameValue(before.offset_z_m, scan.offset_z_m);
      if (sensors_stay) placing.sensors = placings.back().sensors;
      if (part_stays) placing.part = placings.back().part;
    }
    placings.push_back(placing);
  }
  return placings;
}

std::vector<SetupRun> SetupsOf(const ExecutionModel& model, std::span<const Measurement> scans) {
  std::vector<SetupRun> runs;
  // The first scan with each place and each resting face.
  std::vector<size_t> places, rests;
  const auto number = [&](std::vector<size_t>& known, size_t scan, const auto& same) {
    const auto found = std::find_if(known.begin(), known.end(), [&](size_t other) {
      return same(model, scans[other], scans[scan]);
    });
    const auto index = static_cast<size_t>(found - known.begin());
    if (found == known.end()) known.push_back(scan);
    return index;
  };
  for (size_t i = 0; i < scans.size(); ++i) {
    const size_t place = number(places, i, SamePlaceOfSensors);
    const size_t rest = number(rests, i, SameRest);
    if (runs.empty() || runs.back().place != place || runs.back().rest != rest) {
      runs.push_back({i, i, place, rest});
    }
    runs.back().end = i + 1;
  }
  return runs;
}

SetupCounts CountSetups(const ExecutionModel& model, std::span<const Measurement> scans) {
  std::set<std::pair<size_t, size_t>> setups;
  std::set<size_t> places, rests;
  for (const SetupRun& run : SetupsOf(model, scans)) {
    setups.insert({run.place, run.rest});
    places.insert(run.place);
    rests.insert(run.rest);
  }
  return {static_cast<int>(setups.size()), static_cast<int>(places.size()),
          static_cast<int>(rests.size())};
}

}  // namespace sightline
