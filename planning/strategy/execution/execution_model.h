// SPDX-License-Identifier: Apache-2.0
// Model of executing a plan: places of the sensors, set-ups, and the time of each change according
// to the inspection's costs.
//
// A *set-up* is a resting face with a place of the sensors. Between two scans the part is laid
// (another resting face) or turned (another turn or shift on the same face), and the sensors are
// moved (another place). The times of all changes add up, since one person makes them.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/inspection/inspection.h"
#include "core/rig/measurement.h"

namespace sightline {

struct ExecutionModel {
  CostModel costs;
  double scan_step_m = 0.001;
  // False: the height of the table below the sensors is part of their place.
  bool stage_moves_in_height = true;
  // A robot that holds the sensor head moves it by itself: one place of the sensors serves all
  // azimuths and polar angles. One that holds the part lays and turns it.
  bool robot_holds_head = false;
  bool robot_holds_part = false;
  // As Rig::part_support_points_m; null: no table.
  std::shared_ptr<const std::vector<Eigen::Vector3d>> support_points_m = nullptr;
};

// The model of an inspection whose part is held (HoldPart).
ExecutionModel ExecutionModelOf(const Inspection& inspection);

// Height of the table's upper face above the origin of the world [m]; without a table, the height
// of the part's centre.
double TableHeight(const ExecutionModel& model, const Measurement& scan);

// True if both scans have one place of the sensors: angles, lengths differ by < 1e-9 rad or
// m.
bool SamePlaceOfSensors(const ExecutionModel& model, const Measurement& a, const Measurement& b);
bool SameRest(const ExecutionModel& model, const Measurement& a, const Measurement& b);

// The scan made from the place of the sensors of `place`, the part lying as in `scan`.
Measurement AtPlaceOf(const ExecutionModel& model, const Measurement& place, Measurement scan);

// Seconds between two scans.
struct ChangeTimes {
  double lay_s = 0;
  double turn_s = 0;
  double move_sensors_s = 0;
  // CostModel's fixed time of every repositioning, and its speeds.
  double reposition_s = 0;

  double Total_s() const { return lay_s + turn_s + move_sensors_s + reposition_s; }
};

ChangeTimes TimesBetween(const ExecutionModel& model, const Measurement& from,
                         const Measurement& to);
// Changes before the first scan: the part is laid down and the sensors are placed.
ChangeTimes TimesBeforeFirst(const ExecutionModel& model);

// Sequence numbers of the placing of the sensors and of the part for one scan. Between scans with
// the same number these are not touched.
struct Placings {
  size_t sensors = 0, part = 0;
};

// Placings of scans in the order of execution. A person touches the part to turn or shift it on the
// table. A robot approaches every scan anew.
std::vector<Placings> PlacingsOf(const ExecutionModel& model, std::span<const Measurement> scans);

// Consecutive scans without a change of resting face or place of the sensors.
struct SetupRun {
  // Index of the first scan, and index behind the last one.
  size_t begin = 0, end = 0;
  // Numbers of the place of the sensors and of the resting face, in order of first use.
  size_t place = 0, rest = 0;
};

// Set-ups of scans in the order of execution.
std::vector<SetupRun> SetupsOf(const ExecutionModel& model, std::span<const Measurement> scans);

// Numbers of distinct set-ups, places of the sensors and resting faces; scans in any order.
struct SetupCounts {
  int setups = 0, places = 0, rests = 0;
};
SetupCounts CountSetups(const ExecutionModel& model, std::span<const Measurement> scans);

}  // namespace sightline
