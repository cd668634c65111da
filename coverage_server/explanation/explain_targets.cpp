// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/explanation/explain_targets.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <map>
#include <numbers>

#include "core/random/counter_random.h"
#include "core/rig/sensor_bodies.h"
#include "coverage_server/explanation/aimed_scan.h"
#include "coverage_server/scan/place_conditions.h"
#include "coverage_server/scan/scan_in_part.h"

namespace sightline {
namespace {

// Local search: in each round, kScansAboutEach scans near each of the kKeptAims best, within a
// shrinking radius. Every second one has any triangulation angle, so that laser and camera can both
// look into a passage.
constexpr size_t kKeptAims = 16;
constexpr int kScansAboutEach = 12;
constexpr int kTriangulationDimension = 1;
constexpr std::array<double, 3> kRoundRadius = {0.12, 0.05, 0.02};
// Factor on the steps of parameters whose domain is a full turn.
constexpr double kTurnStep = 0.25;

// Conditions that a scan can violate, as bits; ties go by the order of UncoveredReason.
enum Condition : uint32_t {
  kCameraAngle = 1 << 0,
  kLaserAngle = 1 << 1,
  kFootprint = 1 << 2,
  kDefocus = 1 << 3,
  kRange = 1 << 4,
  kCameraHidden = 1 << 5,  // by the part
  kLaserHidden = 1 << 6,
  kCollision = 1 << 7,
  kTravel = 1 << 8,
  kTooDark = 1 << 9,
  kTooBright = 1 << 10,
};

struct Failures {
  uint32_t conditions = 0;
  // Bit i: obstacle i hides the place.
  uint64_t camera_obstacles = 0, laser_obstacles = 0;
  int touched_obstacle = -1;   // by camera or laser
  double exposure_time_s = 0;  // would show the line; with kTooDark and kTooBright

  int Conditions() const {
    return std::popcount(conditions) + std::popcount(camera_obstacles) +
           std::popcount(laser_obstacles);
  }
  int Count() const { return Conditions() + ((conditions & kRange) != 0 ? 1 : 0); }
};

// Counts, for each reason, the scans with the fewest failures that fail for this reason.
class Tally {
 public:
  int fewest() const { return fewest_; }
  // True if one of the best scans fails at one condition only.
  bool nearly_passed() const { return nearly_passed_; }

  // True if the scan is among the best so far.
  bool Add(const Failures& failures) {
    const int count = failures.Count();
    if (count > fewest_) return false;
    if (count < fewest_) {
      fewest_ = count;
      by_reason_.clear();
      nearly_passed_ = false;
    }
    nearly_passed_ = nearly_passed_ || failures.Conditions() == 1;
    const auto add = [this](UncoveredReason reason, int obstacle) -> Votes& {
      Votes& votes = by_reason_[{reason, obstacle}];
      ++votes.count;
      return votes;
    };
    const uint32_t c = failures.conditions;
    if (c & (kCameraAngle | kLaserAngle)) add(UncoveredReason::kAngle, -1);
    if (c & kFootprint) add(UncoveredReason::kFootprint, -1);
    if (c & kDefocus) add(UncoveredReason::kDefocus, -1);
    if (c & kRange) add(UncoveredReason::kRange, -1);
    if (c & (kCameraHidden | kLaserHidden)) add(UncoveredReason::kOwnOcclusion, -1);
    const uint64_t obstacles = failures.camera_obstacles | failures.laser_obstacles;
    for (uint64_t rest = obstacles; rest != 0; rest &= rest - 1) {
      add(UncoveredReason::kObstacle, std::countr_zero(rest));
    }
    if (c & kCollision) add(UncoveredReason::kCollision, failures.touched_obstacle);
    if (c & kTravel) add(UncoveredReason::kTravel, -1);
    if (c & kTooDark) {
      Votes& votes = add(UncoveredReason::kTooDark, -1);
      votes.exposure_time_s = votes.count == 1
                                  ? failures.exposure_time_s
                                  : std::min(votes.exposure_time_s, failures.exposure_time_s);
    }
    if (c & kTooBright) {
      Votes& votes = add(UncoveredReason::kTooBright, -1);
      votes.exposure_time_s = std::max(votes.exposure_time_s, failures.exposure_time_s);
    }
    return true;
  }

  // The best reason among the scans added; there is at least one, and none passed.
  TargetExplanation Reason() const {
    TargetExplanation best;
    for (const auto& [key, votes] : by_reason_) {
      // The map is in the order of UncoveredReason: ties go to the first.
      if (votes.count <= best.scans_with_reason) continue;
      best.reason = key.first;
      best.obstacle = key.second;
      best.scans_with_reason = votes.count;
      best.exposure_time_s = votes.exposure_time_s;
    }
    return best;
  }

 private:
  int fewest_ = 1 << 20;
  bool nearly_passed_ = false;
  struct Votes {
    int count = 0;
    double exposure_time_s = 0;  // least of too dark scans, greatest of too bright ones
  };
  std::map<std::pair<UncoveredReason, int>, Votes> by_reason_;
};

// True for parameters whose domain is a whole turn, so that steps wrap around.
std::array<bool, kAimDimensions> WholeTurns(const MeasurementDomain& domain) {
  std::array<bool, kAimDimensions> result{};
  for (int i = 0; i < 7; ++i) {
    const ParameterDomain& parameter = domain.parameters[i];
    const bool resting = !domain.resting_orientations.empty() && (i == 4 || i == 5);
    result[i] = !resting && parameter.periodic && parameter.ranges.size() == 1 &&
                parameter.ranges[0].max - parameter.ranges[0].min >= 2 * std::numbers::pi - 1e-9;
  }
  return result;
}

// One target.
class Explainer {
 public:
  Explainer(const ExplanationTask& task, const std::vector<AimedScan>& spread, uint32_t target)
      : task_(task),
        spread_(spread),
        target_(target),
        place_(task.targets->positions_m[target].cast<double>()),
        normal_(task.targets->normals[target].cast<double>()) {}

  TargetExplanation Explain(const std::atomic<bool>* cancelled) {
    for (int i = 0; i < kSpreadScans; ++i) {
      if (Try(spread_[i], [i] { return SpreadAim(i); })) return Found();
    }
    if (tally_.nearly_passed() && !Stops(cancelled) && TryNearBest(cancelled)) return Found();
    TargetExplanation explanation = tally_.Reason();
    explanation.tried_scans = tried_;
    return explanation;
  }

 private:
  static bool Stops(const std::atomic<bool>* cancelled) {
    return cancelled != nullptr && cancelled->load(std::memory_order_relaxed);
  }

  TargetExplanation Found() const {
    return {UncoveredReason::kNotChosen, -1, tried_, 0, 0, found_};
  }

  bool TryNearBest(const std::atomic<bool>* cancelled) {
    const std::array<bool, kAimDimensions> turns = WholeTurns(*task_.domain);
    for (size_t round = 0; round < kRoundRadius.size(); ++round) {
      const std::vector<Aim> centres = best_;
      for (size_t c = 0; c < centres.size(); ++c) {
        if (Stops(cancelled)) return false;
        CounterRandom random(target_, round, static_cast<uint32_t>(c));
        for (int i = 0; i < kScansAboutEach; ++i) {
          Aim aim = centres[c];
          for (int k = 0; k < kAimDimensions; ++k) {
            const double step = kRoundRadius[round] * (2 * random.Uniform() - 1);
            aim[k] = turns[k] ? aim[k] + kTurnStep * step : std::clamp(aim[k] + step, 0.0, 1.0);
            if (turns[k]) aim[k] -= std::floor(aim[k]);
          }
          if (i % 2 == 1) aim[kTriangulationDimension] = random.Uniform();
          if (Try(MakeAimedScan(*task_.rig, *task_.domain, aim), [&aim] { return aim; })) {
            return true;
          }
        }
      }
    }
    return false;
  }

  // True if the scan measures the target and can be carried out.
  template <typename AimOf>
  bool Try(const AimedScan& aimed, const AimOf& aim_of) {
    if (carried_out_ >= kMostCarriedOut) return false;
    ++tried_;
    const ScanOfPlace scan = AimAt(aimed, *task_.domain, task_.part_centre_m, place_);
    Failures failures = FailuresAtPlace(aimed, scan);
    if (failures.Count() == 0) {
      ++carried_out_;
      const CarriedOut result = task_.carry_out(scan.measurement, scan.stage_m);
      switch (result.feasibility) {
        case Feasibility::kFeasible:
          found_ = scan.measurement;
          return true;
        case Feasibility::kTravel:
          failures.conditions |= kTravel;
          break;
        default:
          failures.conditions |= kCollision;
          failures.touched_obstacle =
              TouchedObstacle(MakeScanGeometry(*task_.rig, scan.measurement), result.stage_start_m,
                              result.stage_end_m);
      }
    }
    const int before = tally_.fewest();
    if (!tally_.Add(failures)) return false;
    if (tally_.fewest() < before) best_.clear();
    if (best_.size() < kKeptAims) best_.push_back(aim_of());
    return false;
  }

  // The failed conditions; incomplete once they are more than those of the best scans.
  Failures FailuresAtPlace(const AimedScan& aimed, const ScanOfPlace& scan) const {
    Failures failures;
    const auto hopeless = [&] { return failures.Count() > tally_.fewest(); };
    // A laser sheet that contains the scan direction sweeps no volume.
    if (!std::isfinite(scan.stage_m)) {
      failures.conditions = kRange | kCameraHidden | kLaserHidden;
      return failures;
    }
    const Eigen::Vector3d normal = aimed.geometry.part_rotation * normal_;
    const bool faces_camera = normal.dot(scan.to_camera_m) > 0,
               faces_laser = normal.dot(scan.to_laser_m) > 0;
    if (!faces_camera) failures.conditions |= kCameraAngle | kCameraHidden;
    if (!faces_laser) failures.conditions |= kLaserAngle | kLaserHidden;
    if (const auto& steepest = task_.sampling->max_incidence_rad) {
      PointLimits incidence;
      incidence.min_cos_incidence = std::cos(*steepest);
      if (!WithinIncidence(incidence, normal, scan.to_camera_m)) {
        failures.conditions |= kCameraAngle;
      }
      if (!WithinIncidence(incidence, normal, scan.to_laser_m)) failures.conditions |= kLaserAngle;
    }
    if (hopeless()) return failures;

    const Measurement& m = scan.measurement;
    ScanGeometry geometry = aimed.geometry;
    geometry.part_offset_m = Eigen::Vector3d(0, m.offset_y_m, m.offset_z_m);
    const ScanInPart in_part = MakeScanInPart(*task_.rig, task_.part_centre_m, geometry, {});
    const Eigen::Vector3d moved = scan.stage_m * in_part.scan_direction;
    const Eigen::Vector3d camera_at = in_part.camera.origin_m - moved,
                          laser_at = in_part.laser.origin_m - moved;
    const Eigen::Vector3d from_camera = place_ - camera_at;
    const double depth_m = DepthOf(in_part, from_camera);
    const TargetSampling& limits = *task_.sampling;
    if (!WithinDepth(AdmissibleDepth(*task_.rig, m.camera_distance_m, limits.max_pixel_footprint_m,
                                     std::nullopt),
                     depth_m) ||
        (limits.max_depth_per_pixel_m &&
         depth_m * from_camera.norm() >
             MaxDepthTimesDistance(task_.rig->camera, m, *limits.max_depth_per_pixel_m))) {
      failures.conditions |= kFootprint;
    }
    if (!WithinDepth(AdmissibleDepth(*task_.rig, m.camera_distance_m, std::nullopt,
                                     limits.max_circle_of_confusion_px),
                     depth_m)) {
      failures.conditions |= kDefocus;
    }
    if (!in_part.sweeps || depth_m < kNearPlaneM || !InRows(in_part, from_camera, depth_m) ||
        !InColumns(in_part, from_camera, depth_m) || !InRange(in_part, from_camera) ||
        !InFan(in_part, place_ - laser_at)) {
      failures.conditions |= kRange;
    }
    if (task_.light != nullptr && faces_camera && faces_laser) {
      const int16_t entry = task_.light->EntryOf(task_.targets->triangles[target_]);
      const LightOfPlace light = task_.light->At(entry, normal, scan.to_camera_m, scan.to_laser_m);
      if (light.verdict == LightVerdict::kTooDark) failures.conditions |= kTooDark;
      if (light.verdict == LightVerdict::kTooBright) failures.conditions |= kTooBright;
      failures.exposure_time_s = light.exposure_time_s;
    }
    if (hopeless()) return failures;

    const Eigen::Vector3f place = place_.cast<float>();
    const std::vector<Occluder>& occluders = *task_.occluders;
    for (size_t i = 0; i < occluders.size() && !hopeless(); ++i) {
      const FrameChange change =
          FromPart(occluders[i].frame, geometry, task_.part_centre_m, scan.stage_m);
      const uint64_t bit = i == 0 ? 0 : uint64_t{1} << (i - 1);
      // For a surface that faces away, the part itself is the obstacle; no ray is needed.
      if ((i > 0 || faces_camera) && Hides(occluders[i], change, camera_at.cast<float>(), place)) {
        if (i == 0) failures.conditions |= kCameraHidden;
        failures.camera_obstacles |= bit;
      }
      if (hopeless()) return failures;
      if ((i > 0 || faces_laser) && Hides(occluders[i], change, laser_at.cast<float>(), place)) {
        if (i == 0) failures.conditions |= kLaserHidden;
        failures.laser_obstacles |= bit;
      }
    }
    if (hopeless()) return failures;
    if (Collides(*task_.rig, geometry, task_.part_centre_m, occluders, scan.stage_m,
                 scan.stage_m)) {
      failures.conditions |= kCollision;
      failures.touched_obstacle = TouchedObstacle(geometry, scan.stage_m, scan.stage_m);
    }
    return failures;
  }

  // The first obstacle that camera or laser touch while the stage moves; -1: none, or camera and
  // laser overlap, which no obstacle causes.
  int TouchedObstacle(const ScanGeometry& geometry, double start_m, double end_m) const {
    if (SensorBodiesCollide(*task_.rig, geometry)) return -1;
    for (size_t i = 0; i < task_.single_obstacles->size(); ++i) {
      if (Collides(*task_.rig, geometry, task_.part_centre_m, (*task_.single_obstacles)[i], start_m,
                   end_m)) {
        return static_cast<int>(i);
      }
    }
    return -1;
  }

  const ExplanationTask& task_;
  const std::vector<AimedScan>& spread_;
  const uint32_t target_;
  const Eigen::Vector3d place_, normal_;
  Tally tally_;
  std::vector<Aim> best_;
  int tried_ = 0;
  int carried_out_ = 0;
  Measurement found_;
};

}  // namespace

void ExplainTargets(const ExplanationTask& task, std::span<const uint32_t> targets,
                    std::span<TargetExplanation> results, const std::atomic<bool>* cancelled) {
  assert(targets.size() == results.size());
  assert(task.occluders->size() <= 65);
  std::vector<AimedScan> spread;
  spread.reserve(kSpreadScans);
  for (int i = 0; i < kSpreadScans; ++i) {
    spread.push_back(MakeAimedScan(*task.rig, *task.domain, SpreadAim(i)));
  }
  for (size_t i = 0; i < targets.size(); ++i) {
    if (cancelled != nullptr && cancelled->load(std::memory_order_relaxed)) return;
    results[i] = Explainer(task, spread, targets[i]).Explain(cancelled);
  }
}

}  // namespace sightline
