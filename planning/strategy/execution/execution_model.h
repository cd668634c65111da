// SPDX-License-Identifier: Apache-2.0
// Model of executing a plan: places of the sensors, set-ups, and the time of every change by the
// inspection's costs.
//
// A *set-up* is a resting face with a place of the sensors. Between two scans the part is laid anew
// (another resting face) or turned (another turn or shift on the same face), and the sensors are
// moved (another place); the times of what changes add up, since one person does it.
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
  // If not, the table's height under the sensors is part of their place.
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

// Height of the table's upper face over the origin of the world [m]; of parts without a table that
// of their centre.
double TableHeight(const ExecutionModel& model, const Measurement& scan);

// Angles and lengths that differ by less than 1e-9 rad or m are the same.
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
// Before the first scan: the part is laid down and the sensors are put in their place.
ChangeTimes TimesBeforeFirst(const ExecutionModel& model);

// Numbers of the placing of the sensors and of the placing of the part that a scan is made with.
// Scans with the same number follow one another without these being touched.
struct Placings {
  size_t sensors = 0, part = 0;
};

// The placings of scans that are made in this order. A person who turns or shifts the part on the
// table touches it. A robot comes to every scan anew.
std::vector<Placings> PlacingsOf(const ExecutionModel& model, std::span<const Measurement> scans);

// Scans that follow one another without a change of resting face or place of the sensors.
struct SetupRun {
  // Positions of the first scan and behind the last one.
  size_t begin = 0, end = 0;
  // Number of the place of the sensors, and of the resting face, by first use.
  size_t place = 0, rest = 0;
};

// The set-ups of scans that are made in this order.
std::vector<SetupRun> SetupsOf(const ExecutionModel& model, std::span<const Measurement> scans);

// Distinct set-ups, places of the sensors and resting faces of scans in any order.
struct SetupCounts {
  int setups = 0, places = 0, rests = 0;
};
SetupCounts CountSetups(const ExecutionModel& model, std::span<const Measurement> scans);

}  // namespace sightline
