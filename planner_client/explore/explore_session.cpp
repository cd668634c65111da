// SPDX-License-Identifier: Apache-2.0
#include "planner_client/explore/explore_session.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"
#include "planning/optimise/maximise.h"
#include "planning/optimise/search_space.h"
#include "planning/strategy/top_points.h"
#include "report/plan/plan_scene.h"
#include "report/plan/surface/display_mesh.h"

namespace sightline {
namespace {

constexpr size_t kDisplayTriangles = 150'000;
constexpr size_t kRememberedScans = 32;
// A search should take seconds; fast estimates take some tens of microseconds each.
constexpr int64_t kLocalEvaluations = 3000;
constexpr int64_t kGlobalEvaluations = 9000;
constexpr uint64_t kSearchSeed = 1;
constexpr double kLocalStep = 0.05;  // of a parameter's whole range
// Estimates differ from exact counts, so a few of the best are evaluated exactly.
constexpr size_t kExactCandidates = 6;
constexpr double kCandidateSeparation = 0.02;

const char* FeasibilityWord(ScanFeasibility feasibility) {
  switch (feasibility) {
    case ScanFeasibility::kFeasible:
      return "feasible";
    case ScanFeasibility::kCollision:
      return "collision";
    case ScanFeasibility::kTravel:
      return "travel";
    case ScanFeasibility::kOutOfBounds:
      return "out_of_bounds";
    case ScanFeasibility::kUnreachable:
      return "unreachable";
  }
  return "";
}

std::string BitsText(const TargetBits& bits) { return absl::Base64Escape(bits.ToBytes()); }

std::string MakeScene(const ExploreTask& task) {
  ReportData data;
  data.mesh = *task.part;
  data.rig = task.inspection.rig;
  data.targets = task.targets;
  data.sampling = task.inspection.targets;
  data.measurable = task.gain_model->measurable();
  return ToJson(PlanScene(
      data, MakeDisplayMesh(*task.part, task.targets, data.sampling.spacing_m, kDisplayTriangles),
      {}));
}

v1::OpticalSetting DefaultSetting(const Inspection& inspection) {
  v1::OpticalSetting setting;
  if (!inspection.rig.lens) return setting;
  const Lens& lens = *inspection.rig.lens;
  setting.set_f_number(lens.f_number);
  setting.set_exposure_time_s(inspection.render.exposure_time_s);
  setting.set_focus_distance_m(lens.focus_distance_m.value_or(0.4));
  setting.set_laser_power_w(inspection.rig.laser.power_w);
  setting.set_sensor_tilt_x_deg(Degrees(lens.sensor_tilt_x_rad));
  setting.set_sensor_tilt_y_deg(Degrees(lens.sensor_tilt_y_rad));
  return setting;
}

// To 0.01 mm and 0.001 degrees, which people can set, where the domain allows it.
Measurement Rounded(const Measurement& measurement, const MeasurementDomain& domain) {
  auto values = ToArray(measurement);
  const auto& parameters = MeasurementParameters();
  for (int i = 0; i < kMeasurementParameters; ++i) {
    const double rounded = parameters[i].angle ? Radians(std::round(1e3 * Degrees(values[i])) / 1e3)
                                               : std::round(1e5 * values[i]) / 1e5;
    if (domain.parameters[i].Contains(rounded)) values[i] = rounded;
  }
  const Measurement result = FromArray(values);
  return domain.Contains(result) ? result : measurement;
}

// Usual values, as far as the domain allows them.
Measurement FirstPosition(const MeasurementDomain& domain) {
  Measurement usual;
  usual.camera_distance_m = 0.4;
  usual.triangulation_angle_rad = Radians(30);
  usual.camera_polar_rad = Radians(20);
  const SearchSpace space(domain);
  return Rounded(space.ToMeasurement(space.ToUnit(usual)), domain);
}

Json LimitsJson(const char* name, const char* label, const char* unit, double scale,
                const Limits& limits, double slider_min, double slider_max) {
  return {{"name", name},
          {"label", label},
          {"unit", unit},
          {"scale", scale},
          {"min", limits.min},
          {"max", limits.max},
          {"slider", {std::max(limits.min, slider_min), std::min(limits.max, slider_max)}}};
}

Json ParameterJson(int i, const MeasurementDomain& domain) {
  const ParameterDescription& parameter = MeasurementParameters()[i];
  const ParameterDomain& allowed = domain.parameters[i];
  const auto outside = [&](double value) { return parameter.angle ? Degrees(value) : value; };
  Json json = {{"name", parameter.name},
               {"label", parameter.label},
               {"unit", parameter.angle ? "°" : "mm"},
               {"scale", parameter.angle ? 1 : 1000},
               {"periodic", allowed.periodic},
               {"ranges", Json::array()},
               {"values", Json::array()}};
  for (const ParameterDomain::Range& range : allowed.ranges) {
    json["ranges"].push_back({outside(range.min), outside(range.max)});
  }
  for (const double value : allowed.values) json["values"].push_back(outside(value));
  return json;
}

}  // namespace

ExploreSession::ExploreSession(ExploreTask task)
    : task_(std::move(task)),
      scene_(MakeScene(task_)),
      default_setting_(DefaultSetting(task_.inspection)),
      scans_(task_.scans) {
  position_.measurement = FirstPosition(task_.inspection.domain);
  if (task_.inspection.rig.lens) {
    position_.setting = default_setting_;
    for (ExploredScan& scan : scans_) {
      if (!scan.setting) scan.setting = default_setting_;
    }
  }
  if (!scans_.empty()) position_ = {scans_.front().measurement, scans_.front().setting};
}

absl::StatusOr<std::unique_ptr<ExploreSession>> ExploreSession::Open(ExploreTask task) {
  if (static_cast<int>(task.scans.size()) > kMaxExploredScans) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the plan has ", task.scans.size(), " scans, must have at most ", kMaxExploredScans));
  }
  std::vector<Measurement> measurements;
  for (const ExploredScan& scan : task.scans) measurements.push_back(scan.measurement);
  if (!measurements.empty()) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto exact, task.gain_model->ExactCoverage(measurements));
    for (size_t i = 0; i < task.scans.size(); ++i) task.scans[i].exact = std::move(exact[i]);
  }
  return std::unique_ptr<ExploreSession>(new ExploreSession(std::move(task)));
}

absl::StatusOr<ScanCoverage> ExploreSession::Exact(const Measurement& measurement) {
  {
    const std::scoped_lock lock(exact_mutex_);
    for (const auto& [known, coverage] : exact_) {
      if (known == measurement) return coverage;
    }
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto exact,
                             task_.gain_model->ExactCoverage(std::span(&measurement, 1)));
  const std::scoped_lock lock(exact_mutex_);
  exact_.emplace_front(measurement, exact.front());
  if (exact_.size() > kRememberedScans) exact_.pop_back();
  return std::move(exact.front());
}

absl::StatusOr<std::optional<v1::OpticalSetting>> ExploreSession::SettingOf(
    const Json& request) const {
  const auto& lens = task_.inspection.rig.lens;
  if (!lens) return std::nullopt;
  v1::OpticalSetting base;
  {
    const std::scoped_lock lock(mutex_);
    base = position_.setting.value_or(default_setting_);
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto setting, ReadSetting(request, LimitsOfSetting(*lens), base));
  return setting;
}

TargetBits ExploreSession::PlanCoverage(std::optional<int64_t> without) const {
  TargetBits covered(task_.targets.size());
  for (size_t i = 0; i < scans_.size(); ++i) {
    if (without != static_cast<int64_t>(i)) covered |= scans_[i].exact.covered;
  }
  return covered;
}

std::vector<Measurement> ExploreSession::PlanScans(std::optional<int64_t> without) const {
  std::vector<Measurement> scans;
  for (size_t i = 0; i < scans_.size(); ++i) {
    if (without != static_cast<int64_t>(i)) scans.push_back(scans_[i].measurement);
  }
  return scans;
}

absl::StatusOr<std::vector<float>> ExploreSession::KnownShares(std::span<const Measurement> plan,
                                                               const TargetBits& covered) const {
  std::vector<float> known(task_.targets.size(), 0);
  if (task_.judge == nullptr) {
    for (size_t t = 0; t < known.size(); ++t) known[t] = covered.Test(t) ? 1.0f : 0.0f;
    return known;
  }
  if (plan.empty()) return known;
  SIGHTLINE_ASSIGN_OR_RETURN(auto scans, task_.judge->FastCoverage(plan));
  for (const ScanCoverage& scan : scans) {
    for (size_t i = 0; i < scan.shares.targets.size(); ++i) {
      known[scan.shares.targets[i]] += scan.shares.share[i];
    }
  }
  return known;
}

absl::StatusOr<PlanScore> ExploreSession::Score(const std::vector<Measurement>& plan) {
  {
    const std::scoped_lock lock(score_mutex_);
    for (const auto& [known, score] : scores_) {
      if (known == plan) return score;
    }
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto score, task_.judge->ScorePlan(plan, true));
  const std::scoped_lock lock(score_mutex_);
  scores_.emplace_front(plan, score);
  if (scores_.size() > kRememberedScans) scores_.pop_back();
  return score;
}

absl::StatusOr<Json> ExploreSession::Admissible(const Json& request) {
  RequestReader reader(request, "", {"measurement", "instead_of"});
  SIGHTLINE_ASSIGN_OR_RETURN(auto measurement, ReadMeasurement(request, task_.inspection.domain));
  if (task_.judge == nullptr) {
    return absl::FailedPreconditionError(
        "inspection.json: goal.admissible is missing: the goal is coverage");
  }
  std::vector<Measurement> scans;
  {
    const std::scoped_lock lock(mutex_);
    const auto instead_of =
        reader.OptionalInteger("instead_of", 0, static_cast<int64_t>(scans_.size()) - 1);
    SIGHTLINE_RETURN_IF_ERROR(reader.status());
    scans = PlanScans(instead_of);
  }
  const LatestOnly::Turn turn = judgements_.Take();
  const Json cancelled = {{"cancelled", true}};
  if (*turn.cancelled) return cancelled;
  const auto before = Score(scans);
  if (!before.ok()) return before.status();
  if (*turn.cancelled) return cancelled;
  auto with = before;
  SIGHTLINE_ASSIGN_OR_RETURN(auto exact, Exact(measurement));
  if (exact.feasibility == ScanFeasibility::kFeasible) {
    scans.push_back(measurement);
    with = Score(scans);
    if (!with.ok()) return with.status();
  }
  if (*turn.cancelled) return cancelled;
  return Json{{"judged", task_.judge->measurable().Count()},
              {"before", before->satisfied},
              {"with", with->satisfied}};
}

StageTravel ExploreSession::TravelOf(const Measurement& measurement,
                                     const ScanCoverage& coverage) const {
  const double step_m = task_.inspection.rig.scan_step_m;
  if (coverage.last_frame >= coverage.first_frame) {
    return {coverage.first_frame * step_m, coverage.last_frame * step_m};
  }
  return TravelThroughBox(task_.inspection.rig, task_.part->BoundingBox(), measurement);
}

std::string ExploreSession::Obstacle(const Measurement& measurement,
                                     ScanFeasibility feasibility) const {
  switch (feasibility) {
    case ScanFeasibility::kFeasible:
      return "";
    case ScanFeasibility::kCollision:
      return task_.inspection.obstacles.empty()
                 ? "collision: the body of camera or laser would touch the part on the way"
                 : "collision: the body of camera or laser would touch the part or an obstacle "
                   "on the way, or the part an obstacle that stands still";
    case ScanFeasibility::kTravel: {
      const StageTravel needed =
          TravelThroughBox(task_.inspection.rig, task_.part->BoundingBox(), measurement);
      return absl::StrFormat(
          "stage travel: this scan needs up to %.0f mm, rig.stage_travel_m allows %.0f mm",
          1e3 * needed.length_m(), 1e3 * task_.inspection.rig.stage_travel_m);
    }
    case ScanFeasibility::kOutOfBounds:
      return "a parameter is out of the bounds of the rig (docs/plan-a-part.md, measurement)";
    case ScanFeasibility::kUnreachable:
      return "the robot cannot make this scan (docs/robots.md)";
  }
  return "";
}

Json ExploreSession::Setup() const {
  const Inspection& inspection = task_.inspection;
  Json json = {{"name", inspection.name},
               {"part", inspection.part_file.substr(inspection.part_file.rfind('/') + 1)},
               {"targets", task_.targets.size()},
               {"measurable", task_.gain_model->measurable().Count()},
               {"goal", inspection.goal.coverage},
               {"for_uncertainty", inspection.goal.admissible.has_value()},
               {"scan_step_m", inspection.rig.scan_step_m},
               {"folder", task_.folder},
               {"pictures", task_.draw != nullptr},
               {"no_pictures", task_.no_pictures},
               // The evaluation's depth of field is that of the inspection's lens.
               {"blur_limited", inspection.targets.max_circle_of_confusion_px.value_or(0) > 0},
               {"parameters", Json::array()},
               {"resting_orientations", Json::array()},
               {"settings", Json::array()}};
  for (int i = 0; i < kMeasurementParameters; ++i) {
    json["parameters"].push_back(ParameterJson(i, inspection.domain));
  }
  for (const RestingOrientation& resting : inspection.domain.resting_orientations) {
    json["resting_orientations"].push_back(
        {Degrees(resting.part_alpha_rad), Degrees(resting.part_beta_rad)});
  }
  if (inspection.rig.lens) {
    const SettingLimits limits = LimitsOfSetting(*inspection.rig.lens);
    json["settings"] = {
        LimitsJson("f_number", "f-number", "", 1, limits.f_number, 1, 32),
        LimitsJson("exposure_time_s", "Exposure time", "ms", 1e3, limits.exposure_time_s, 1e-5,
                   0.1),
        LimitsJson("focus_distance_m", "Focus distance", "mm", 1e3, limits.focus_distance_m, 0.05,
                   2),
    };
  }
  return json;
}

Json ExploreSession::StateLocked() const {
  const int64_t measurable = task_.gain_model->measurable().Count();
  Json scans = Json::array();
  TargetBits covered(task_.targets.size());
  for (const ExploredScan& scan : scans_) {
    const int64_t fresh = scan.exact.covered.CountNotIn(covered);
    covered |= scan.exact.covered;
    scans.push_back({{"measurement", MeasurementJson(scan.measurement)},
                     {"setting", scan.setting ? SettingJson(*scan.setting) : Json()},
                     {"locked", scan.locked},
                     {"feasibility", FeasibilityWord(scan.exact.feasibility)},
                     {"obstacle", Obstacle(scan.measurement, scan.exact.feasibility)},
                     {"covered", scan.exact.covered.Count()},
                     {"new_targets", fresh},
                     {"cumulative", covered.Count()}});
  }
  return {{"revision", revision_},
          {"position",
           {{"measurement", MeasurementJson(position_.measurement)},
            {"setting", position_.setting ? SettingJson(*position_.setting) : Json()}}},
          {"scans", std::move(scans)},
          {"covered", covered.Count()},
          {"covered_bits", BitsText(covered)},
          {"coverage", static_cast<double>(covered.Count()) /
                           static_cast<double>(std::max<int64_t>(1, measurable))},
          {"unsaved", plan_revision_ != saved_revision_}};
}

Json ExploreSession::State() const {
  const std::scoped_lock lock(mutex_);
  return StateLocked();
}

bool ExploreSession::HasUnsaved() const {
  const std::scoped_lock lock(mutex_);
  return plan_revision_ != saved_revision_ && !scans_.empty();
}

std::vector<ExploredScan> ExploreSession::Scans() const {
  const std::scoped_lock lock(mutex_);
  return scans_;
}

Json ExploreSession::EvaluationJson(const Measurement& measurement, const ScanCoverage& coverage,
                                    bool exact, const TargetBits& plan) const {
  const auto measurable =
      static_cast<double>(std::max<int64_t>(1, task_.gain_model->measurable().Count()));
  const StageTravel travel = TravelOf(measurement, coverage);
  const int64_t fresh = coverage.covered.CountNotIn(plan);
  const int64_t before = plan.Count();
  Json json = {{"exact", exact},
               {"measurement", MeasurementJson(measurement)},
               {"feasibility", FeasibilityWord(coverage.feasibility)},
               {"obstacle", Obstacle(measurement, coverage.feasibility)},
               {"covered", coverage.covered.Count()},
               {"new_targets", fresh},
               {"gain", static_cast<double>(fresh) / measurable},
               {"plan_covered", before},
               {"coverage_before", static_cast<double>(before) / measurable},
               {"coverage_with", static_cast<double>(before + fresh) / measurable},
               {"covered_bits", BitsText(coverage.covered)},
               {"plan_bits", BitsText(plan)},
               {"view", ScanView(task_.inspection.rig, task_.part->BoundingBox().center(),
                                 measurement, travel)}};
  if (coverage.last_frame >= coverage.first_frame) {
    json["frames"] = coverage.last_frame - coverage.first_frame + 1;
    json["measurement_points"] = coverage.measurement_points;
  }
  return json;
}

absl::StatusOr<Json> ExploreSession::Evaluate(const Json& request) {
  RequestReader reader(request, "", {"measurement", "setting", "exact", "instead_of"});
  const bool exact = reader.Flag("exact");
  SIGHTLINE_ASSIGN_OR_RETURN(auto measurement, ReadMeasurement(request, task_.inspection.domain));
  SIGHTLINE_ASSIGN_OR_RETURN(auto setting, SettingOf(request));
  TargetBits plan;
  {
    const std::scoped_lock lock(mutex_);
    const auto instead_of =
        reader.OptionalInteger("instead_of", 0, static_cast<int64_t>(scans_.size()) - 1);
    SIGHTLINE_RETURN_IF_ERROR(reader.status());
    position_ = {measurement, setting};
    plan = PlanCoverage(instead_of);
  }
  if (exact) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto coverage, Exact(measurement));
    return EvaluationJson(measurement, coverage, true, plan);
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto fast, task_.gain_model->FastCoverage(std::span(&measurement, 1)));
  return EvaluationJson(measurement, fast.front(), false, plan);
}

absl::StatusOr<Json> ExploreSession::ChangePlan(const Json& request) {
  RequestReader reader(request, "",
                       {"revision", "action", "index", "to", "measurement", "setting"});
  const std::string action = reader.Word("action", {"add", "replace", "remove", "move", "load"});
  const int64_t revision = reader.Integer("revision", 0, INT64_MAX);
  SIGHTLINE_RETURN_IF_ERROR(reader.status());

  // Slow work is done before the lock is taken.
  ExploredScan scan;
  if (action == "add" || action == "replace") {
    SIGHTLINE_ASSIGN_OR_RETURN(auto measurement, ReadMeasurement(request, task_.inspection.domain));
    SIGHTLINE_ASSIGN_OR_RETURN(auto setting, SettingOf(request));
    SIGHTLINE_ASSIGN_OR_RETURN(auto exact, Exact(measurement));
    scan = {measurement, std::move(setting), false, std::move(exact)};
    if (scan.exact.feasibility != ScanFeasibility::kFeasible) {
      return WithErrorInfo(
          absl::FailedPreconditionError(absl::StrCat(
              "this scan cannot be made: ", Obstacle(measurement, scan.exact.feasibility))),
          "SCAN_INFEASIBLE");
    }
  }

  const std::scoped_lock lock(mutex_);
  if (revision != revision_) {
    return WithErrorInfo(absl::AbortedError("the plan was changed elsewhere, perhaps in another "
                                            "window; look at it again"),
                         "STATE_CHANGED");
  }
  const auto count = static_cast<int64_t>(scans_.size());
  int64_t index = 0, to = 0;
  if (action != "add") index = reader.Integer("index", 0, count - 1);
  if (action == "move") to = reader.Integer("to", 0, count - 1);
  SIGHTLINE_RETURN_IF_ERROR(reader.status());
  const auto at = scans_.begin() + index;
  if (action == "add") {
    if (count >= kMaxExploredScans) {
      return absl::FailedPreconditionError(
          absl::StrCat("the plan has ", count, " scans, as many as it may"));
    }
    scans_.push_back(std::move(scan));
  } else if (action == "replace") {
    scan.locked = at->locked;
    *at = std::move(scan);
  } else if (action == "remove") {
    scans_.erase(at);
  } else if (action == "move") {
    ExploredScan moved = std::move(*at);
    scans_.erase(at);
    scans_.insert(scans_.begin() + to, std::move(moved));
  } else {
    position_ = {at->measurement, at->setting};
  }
  ++revision_;
  if (action != "load") plan_revision_ = revision_;
  return StateLocked();
}

absl::StatusOr<Json> ExploreSession::Suggest(const Json& request) {
  RequestReader reader(request, "", {"from", "measurement", "instead_of"});
  const bool here = reader.Word("from", {"here", "anywhere"}) == "here";
  SIGHTLINE_RETURN_IF_ERROR(reader.status());
  const MeasurementDomain& domain = task_.inspection.domain;
  SIGHTLINE_ASSIGN_OR_RETURN(auto start, ReadMeasurement(request, domain));
  TargetBits plan;
  std::vector<Measurement> plan_scans;
  {
    const std::scoped_lock lock(mutex_);
    const auto instead_of =
        reader.OptionalInteger("instead_of", 0, static_cast<int64_t>(scans_.size()) - 1);
    SIGHTLINE_RETURN_IF_ERROR(reader.status());
    plan = PlanCoverage(instead_of);
    plan_scans = PlanScans(instead_of);
  }

  const LatestOnly::Turn turn = suggestions_.Take();
  const Json cancelled = {{"cancelled", true}};
  const SearchSpace space(domain);
  SIGHTLINE_ASSIGN_OR_RETURN(const auto known, KnownShares(plan_scans, plan));
  GainModel& guide = task_.judge != nullptr ? *task_.judge : *task_.gain_model;
  TopPoints top(kExactCandidates, kCandidateSeparation);
  const int64_t budget = kLocalEvaluations + (here ? 0 : kGlobalEvaluations);
  search_done_ = 0;
  search_best_ = 0;
  search_budget_ = budget;
  searching_ = true;
  const BatchObjective objective =
      [&](std::span<const std::vector<double>> points) -> absl::StatusOr<std::vector<double>> {
    if (*turn.cancelled) return absl::CancelledError("cancelled");
    std::vector<Measurement> measurements;
    for (const auto& x : points) measurements.push_back(space.ToMeasurement(x));
    SIGHTLINE_ASSIGN_OR_RETURN(auto gains, guide.Gains(measurements, known));
    std::vector<double> values;
    for (size_t i = 0; i < points.size(); ++i) {
      const bool feasible = gains[i].feasibility == ScanFeasibility::kFeasible;
      values.push_back(feasible ? gains[i].gain : -1);
      if (feasible) top.Add(space.Normalise(points[i]), values.back());
      search_best_ = std::max<int64_t>(search_best_, static_cast<int64_t>(values.back()));
    }
    search_done_ += static_cast<int64_t>(points.size());
    return values;
  };
  // Anywhere: by a swarm first, then near the best that it found.
  MaximiseOptions options;
  options.periodic = space.periodic();
  absl::StatusOr<Maximum> found = Maximum{space.ToUnit(start), 0};
  if (!here) {
    found = Maximise(Method::kParticleSwarm, space.dimension(), objective, kGlobalEvaluations,
                     kSearchSeed, options);
  }
  if (found.ok()) {
    options.start = {space.Normalise(found->x)};
    options.step = kLocalStep;
    found = Maximise(Method::kCmaEs, space.dimension(), objective, kLocalEvaluations, kSearchSeed,
                     options);
  }
  searching_ = false;
  if (*turn.cancelled) return cancelled;
  if (!found.ok()) return found.status();

  // The present position is a candidate, so that no suggestion from here is worse.
  std::vector<Measurement> candidates;
  if (here) candidates.push_back(start);
  for (const TopPoints::Entry& entry : top.entries()) {
    candidates.push_back(Rounded(space.ToMeasurement(entry.x), domain));
  }
  std::optional<size_t> best;
  int64_t best_gain = -1;
  std::vector<ScanCoverage> exact;
  for (size_t i = 0; i < candidates.size(); ++i) {
    if (*turn.cancelled) return cancelled;
    SIGHTLINE_ASSIGN_OR_RETURN(auto coverage, Exact(candidates[i]));
    exact.push_back(std::move(coverage));
    if (exact[i].feasibility != ScanFeasibility::kFeasible) continue;
    int64_t gain = exact[i].covered.CountNotIn(plan);
    if (task_.judge != nullptr) {
      std::vector<Measurement> scans = plan_scans;
      scans.push_back(candidates[i]);
      SIGHTLINE_ASSIGN_OR_RETURN(const auto score, Score(scans));
      gain = score.satisfied;
    }
    if (gain > best_gain) {
      best = i;
      best_gain = gain;
    }
  }
  if (!best) {
    return WithErrorInfo(
        absl::FailedPreconditionError(here ? "no scan near this one can be made; try \"anywhere\""
                                           : "no scan that can be made was found"),
        "NOTHING_FOUND");
  }
  if (*turn.cancelled) return cancelled;
  {
    const std::scoped_lock lock(mutex_);
    position_.measurement = candidates[*best];
  }
  Json json = EvaluationJson(candidates[*best], exact[*best], true, plan);
  json["evaluations"] = search_done_.load();
  return json;
}

Json ExploreSession::SuggestionProgress() const {
  return {{"running", searching_.load()},
          {"evaluations", search_done_.load()},
          {"budget", search_budget_.load()},
          {"best", search_best_.load()}};
}

absl::StatusOr<Json> ExploreSession::Picture(const Json& request) {
  if (!task_.draw) {
    return WithErrorInfo(absl::FailedPreconditionError(task_.no_pictures), "NO_PICTURES");
  }
  RequestReader reader(request, "", {"measurement", "setting", "frame"});
  SIGHTLINE_ASSIGN_OR_RETURN(auto measurement, ReadMeasurement(request, task_.inspection.domain));
  SIGHTLINE_ASSIGN_OR_RETURN(auto setting, SettingOf(request));
  SIGHTLINE_RETURN_IF_ERROR(reader.status());

  const LatestOnly::Turn turn = pictures_.Take();
  const Json cancelled = {{"cancelled", true}};
  if (*turn.cancelled) return cancelled;
  SIGHTLINE_ASSIGN_OR_RETURN(auto coverage, Exact(measurement));
  // An infeasible scan has a picture, too: of the frame in which the sheet meets the part.
  const double step_m = task_.inspection.rig.scan_step_m;
  const StageTravel travel = TravelOf(measurement, coverage);
  const auto first = static_cast<int64_t>(std::ceil(travel.start_m / step_m - 1e-6));
  const auto frames = std::clamp<int64_t>(
      static_cast<int64_t>(std::floor(travel.end_m / step_m + 1e-6)) - first + 1, 1, 10'000'000);
  const int64_t frame = reader.OptionalInteger("frame", 0, frames - 1).value_or(frames / 2);
  SIGHTLINE_RETURN_IF_ERROR(reader.status());

  v1::PartFrame message;
  *message.mutable_measurement() = MeasurementToProto(measurement);
  message.set_stage_position_m(static_cast<double>(first + frame) * step_m);
  message.set_scan(1);
  message.set_frame(static_cast<int32_t>(frame));
  if (setting) *message.mutable_setting() = *setting;
  auto picture = task_.draw(message, *turn.cancelled);
  if (*turn.cancelled) return cancelled;
  if (!picture.ok()) return picture.status();
  return Json{{"png", absl::Base64Escape(picture->png)},
              {"columns_px", picture->columns_px},
              {"rows_px", picture->rows_px},
              {"reduction", picture->reduction},
              {"clipped_fraction", picture->clipped_fraction},
              {"warnings", picture->warnings},
              {"frame", frame},
              {"frames", frames},
              {"stage_position_m", message.stage_position_m()}};
}

absl::StatusOr<Json> ExploreSession::Save(const Json& request) {
  RequestReader reader(request, "", {"overwrite"});
  const bool overwrite = reader.Flag("overwrite");
  SIGHTLINE_RETURN_IF_ERROR(reader.status());
  const std::scoped_lock saving(save_mutex_);
  std::vector<ExploredScan> scans;
  int64_t revision = 0;
  {
    const std::scoped_lock lock(mutex_);
    scans = scans_;
    revision = plan_revision_;
  }
  if (scans.empty()) {
    return WithErrorInfo(absl::FailedPreconditionError("the plan has no scans yet"), "PLAN_EMPTY");
  }
  if (!overwrite && task_.saved_before()) {
    return WithErrorInfo(
        absl::AlreadyExistsError(absl::StrCat("there is a plan already in ", task_.folder)),
        "PLAN_EXISTS");
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto saved, task_.save(scans));
  const std::scoped_lock lock(mutex_);
  saved_revision_ = revision;
  return Json{{"folder", task_.folder}, {"files", saved.files}, {"state", StateLocked()}};
}

void ExploreSession::Close() {
  suggestions_.Close();
  judgements_.Close();
  pictures_.Close();
}

}  // namespace sightline
