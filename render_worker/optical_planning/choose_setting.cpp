// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optical_planning/choose_setting.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <type_traits>
#include <utility>

#include "absl/strings/str_format.h"
#include "core/field_limits/field_checks.h"
#include "core/rig/scheimpflug.h"
#include "core/status/status_macros.h"
#include "proto/status/rpc_status.h"
#include "render_worker/render/part_view.h"
#include "render_worker/sensor/expose.h"

namespace sightline {
namespace {

// Range of the default exposures: parts and multiples of what fills a pixel.
constexpr double kDarkest = 1.0 / 25, kBrightest = 4;
// Points darker than the median of the line by more than this factor are ignored.
constexpr double kLargestContrast = 100;
constexpr double kLargestRatio = 1e5;
constexpr double kLargestTilt_rad = 30 * std::numbers::pi / 180;
constexpr int kFirstFocusDistances = 5, kFocusRounds = 2;
// Number of exposures for a coarse evaluation of a focus distance or power before the full search:
// at least this many; up to three times as many, no farther apart than this ratio.
constexpr int kGlanceExposures = 5;
constexpr double kGlanceRatio = 3;
// Exposures that pairs are made of.
constexpr int kPairedExposures = 12;
// Expected work, in evaluated exposures, for progress alone: forming the images of a lens setting,
// and a search.
constexpr double kWorkOfLens = 25;
constexpr int kExposuresOfSearch = 25;
// Laser sheets of frames that differ by less are the same [1, m].
constexpr double kSameSheet = 1e-6;

// Lens settings that may be tried at an f-number, in order.
std::vector<double> FirstFocusDistances(const OpticsPlanning& planning, double stated_m) {
  if (!planning.focus_distance_m) return {stated_m};
  if (!planning.focus_distance_m->is_range()) return planning.focus_distance_m->values;
  std::vector<double> distances;
  const double near = 1 / planning.focus_distance_m->min, far = 1 / planning.focus_distance_m->max;
  for (int i = 0; i < kFirstFocusDistances; ++i) {
    distances.push_back(
        1 / (far + (near - far) * (kFirstFocusDistances - 1 - i) / (kFirstFocusDistances - 1)));
  }
  return distances;
}

std::vector<double> Powers(const OpticsPlanning& planning, double stated_w) {
  if (!planning.laser_power_w) return {stated_w};
  if (!planning.laser_power_w->is_range()) return planning.laser_power_w->values;
  return {planning.laser_power_w->min,
          std::sqrt(planning.laser_power_w->min * planning.laser_power_w->max),
          planning.laser_power_w->max};
}

// Lens focused on, and sensor tilted to, the laser sheet; empty: out of reach.
std::optional<LensSetting> FocusOnSheet(const FrameLight& light, const Inspection& inspection,
                                        double f_number) {
  const double f = inspection.rig.lens->focal_length_m;
  const auto plane = ScheimpflugPlane(light.sheet_normal, light.sheet_offset_m, f);
  if (!plane) return std::nullopt;
  // As finely as anyone can set it.
  const auto settable = [](double tilt) { return Radians(std::round(1e3 * Degrees(tilt)) / 1e3); };
  LensSetting lens{f_number, RoundTo4Digits(1 / (1 / f - 1 / plane->image_distance_m)),
                   settable(std::atan(plane->slope_v)), settable(std::atan(plane->slope_u))};
  const bool nearer = inspection.rig.lens->min_focus_distance_m &&
                      lens.focus_distance_m < *inspection.rig.lens->min_focus_distance_m;
  if (nearer || !(lens.focus_distance_m > 1.01 * f) ||
      std::hypot(lens.sensor_tilt_x_rad, lens.sensor_tilt_y_rad) > kLargestTilt_rad) {
    return std::nullopt;
  }
  return lens;
}

bool Better(const JudgedSetting& a, const JudgedSetting& b) { return a.cost() < b.cost(); }

// Expected work of every step of a choice: of each f-number, then of the alternatives and of the
// pairs.
std::vector<double> ExpectedWork(const OpticsPlanning& planning, size_t f_number_count) {
  const double search = planning.every_exposure ? planning.exposures
                                                : std::min(planning.exposures, kExposuresOfSearch);
  const double glance = 2 * kGlanceExposures;
  const auto count = [](const auto& choices) {
    return choices && !choices->is_range() ? static_cast<double>(choices->values.size()) : 1.0;
  };
  const bool focus_range = planning.focus_distance_m && planning.focus_distance_m->is_range();
  const double lenses =
      (focus_range ? kFirstFocusDistances + 2 * kFocusRounds : count(planning.focus_distance_m)) +
      (planning.sensor_tilt ? 1 : 0);
  const bool power_range = planning.laser_power_w && planning.laser_power_w->is_range();
  const double powers = power_range ? 3 : count(planning.laser_power_w);
  const double of_f_number = (lenses > 1 ? lenses * (kWorkOfLens + glance) : 0) +
                             (powers > 1 ? powers * glance : 0) + kWorkOfLens + search;
  std::vector<double> works(f_number_count, of_f_number);
  works.push_back(((planning.sensor_tilt ? 1 : 0) + (planning.focus_distance_m ? 1 : 0)) *
                  (kWorkOfLens + search));
  works.push_back(
      planning.two_exposures ? kWorkOfLens + kPairedExposures * (kPairedExposures - 1) / 2.0 : 0);
  return works;
}

// The judge, with progress over steps whose work is known only roughly: a step that needs less than
// expected jumps to its end, one that needs more waits there.
class WatchedJudge {
 public:
  WatchedJudge(SettingJudge& judge, std::vector<double> expected_work,
               const std::function<void(double)>& report)
      : judge_(judge), expected_(std::move(expected_work)), report_(report) {
    if (report_) judge_.ReportTo([this](double fraction) { Report(fraction); });
  }
  ~WatchedJudge() { judge_.ReportTo({}); }
  WatchedJudge(const WatchedJudge&) = delete;
  WatchedJudge& operator=(const WatchedJudge&) = delete;

  absl::Status LookThrough(const LensSetting& lens) {
    return Watched(kWorkOfLens, [&] { return judge_.LookThrough(lens); });
  }
  absl::StatusOr<std::vector<JudgedSetting>> Judge(std::span<const double> exposure_times_s,
                                                   double laser_power_w) {
    return Watched(static_cast<double>(exposure_times_s.size()),
                   [&] { return judge_.Judge(exposure_times_s, laser_power_w); });
  }
  absl::StatusOr<std::vector<JudgedSetting>> JudgePairs(
      std::span<const std::pair<double, double>> long_and_short_s, double laser_power_w) {
    return Watched(static_cast<double>(long_and_short_s.size()),
                   [&] { return judge_.JudgePairs(long_and_short_s, laser_power_w); });
  }
  const std::vector<WeightedFrame>& frames() const { return judge_.frames(); }

  void EndStep() {
    ++step_;
    done_in_step_ = 0;
    if (report_) Report(0);
  }

 private:
  template <typename Call>
  std::invoke_result_t<Call> Watched(double work, const Call& call) {
    work_of_call_ = work;
    auto result = call();
    done_in_step_ += work;
    work_of_call_ = 0;
    return result;
  }

  // `fraction`: of the call that is being watched.
  void Report(double fraction) const {
    double done = 0, all = 0;
    for (size_t i = 0; i < expected_.size(); ++i) {
      all += expected_[i];
      if (i < step_) done += expected_[i];
      if (i == step_) done += std::min(expected_[i], done_in_step_ + fraction * work_of_call_);
    }
    report_(done / all);
  }

  SettingJudge& judge_;
  const std::vector<double> expected_;
  const std::function<void(double)>& report_;
  size_t step_ = 0;
  double done_in_step_ = 0, work_of_call_ = 0;
};

class Chooser {
 public:
  Chooser(SettingJudge& judge, const Inspection& inspection, const SettingGroup& group,
          const ExposureGrid& grid, const std::function<void(double)>& progress)
      : judge_(judge, ExpectedWork(*inspection.optics, group.f_numbers.size()), progress),
        inspection_(inspection),
        planning_(*inspection.optics),
        group_(group),
        grid_f_number_(inspection.optics->f_numbers[0]),
        grid_(grid) {
    choice_.limit = LimitExposure(inspection.stated_costs, inspection.rig.scan_step_m, planning_,
                                  group.image_speed_px_per_m);
  }

  absl::StatusOr<SettingChoice> Run() {
    for (const double f_number : group_.f_numbers) {
      SIGHTLINE_RETURN_IF_ERROR(TryFNumber(f_number));
      judge_.EndStep();
    }
    bool any = false;
    for (size_t n = 0; n < choice_.curve.size(); ++n) {
      const FNumberChoice& here = choice_.curve[n];
      if (here.exposures.empty()) continue;
      if (!any || Better(here.exposures[here.best], choice_.best_single())) choice_.best = n;
      any = true;
    }
    if (!any) {
      return WithErrorInfo(absl::FailedPreconditionError(absl::StrFormat(
                               "optics.exposure_time_s: the shortest, %.4g s at f/%.3g, is longer "
                               "than %.4g s, which "
                               "is all that %s allow",
                               grid_.min_s, grid_f_number_, choice_.limit.longest_s.value_or(0),
                               choice_.limit.because)),
                           "EXPOSURE_TOO_LONG");
    }
    choice_.focus = focus_of_[choice_.best];
    SIGHTLINE_RETURN_IF_ERROR(TryAlternatives());
    judge_.EndStep();
    if (planning_.two_exposures) {
      SIGHTLINE_RETURN_IF_ERROR(TryPairs());
    }
    judge_.EndStep();
    return std::move(choice_);
  }

 private:
  std::optional<ExposureGrid> GridAt(double f_number, std::string* refused) const {
    ExposureGrid grid = AtFNumber(grid_, grid_f_number_, f_number);
    if (!choice_.limit.longest_s) return grid;
    if (grid.min_s > *choice_.limit.longest_s) {
      *refused =
          absl::StrFormat("its shortest exposure time, %.4g s, is longer than %s allow, %.4g s",
                          grid.min_s, choice_.limit.because, *choice_.limit.longest_s);
      return std::nullopt;
    }
    grid.max_s = std::min(grid.max_s, *choice_.limit.longest_s);
    if (!(grid.max_s > grid.min_s)) grid.max_s = grid.min_s * (1 + 1e-9);
    return grid;
  }

  absl::StatusOr<std::vector<JudgedSetting>> Judge(const std::vector<double>& times_s,
                                                   double power_w) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto judged, judge_.Judge(times_s, power_w));
    for (JudgedSetting& setting : judged) AddTimeCost(&setting);
    return judged;
  }

  void AddTimeCost(JudgedSetting* setting) const {
    if (!(planning_.cost_px_per_s > 0) || !(group_.travel_m > 0)) return;
    setting->time_cost_px =
        planning_.cost_px_per_s *
        ScanTime(inspection_.stated_costs, inspection_.rig.scan_step_m, planning_,
                 group_.image_speed_px_per_m, group_.travel_m,
                 setting->setting.exposure_time_s + setting->setting.second_exposure_time_s);
  }

  // All exposures that the search asks for, through the lens that is looked through.
  absl::StatusOr<FNumberChoice> Search(const ExposureGrid& grid, double f_number, double power_w) {
    FNumberChoice here;
    here.f_number = f_number;
    const auto best =
        SearchExposure(grid, planning_.every_exposure,
                       [&](std::span<const int> indices) -> absl::StatusOr<std::vector<double>> {
                         std::vector<double> times;
                         for (const int index : indices) times.push_back(grid.At(index));
                         SIGHTLINE_ASSIGN_OR_RETURN(auto judged, Judge(times, power_w));
                         std::vector<double> costs;
                         for (JudgedSetting& setting : judged) {
                           costs.push_back(setting.cost());
                           here.exposures.push_back(std::move(setting));
                         }
                         return costs;
                       });
    if (!best.ok()) return best.status();
    std::sort(here.exposures.begin(), here.exposures.end(), [](const auto& a, const auto& b) {
      return a.setting.exposure_time_s < b.setting.exposure_time_s;
    });
    here.best =
        static_cast<size_t>(std::min_element(here.exposures.begin(), here.exposures.end(), Better) -
                            here.exposures.begin());
    return here;
  }

  // Least cost of a few exposures: to compare lens settings by.
  absl::StatusOr<JudgedSetting> Glance(const ExposureGrid& grid, double power_w) {
    // In equally spaced grids the shortest times are far apart by ratio anyway.
    const double shortest = std::max(grid.min_s, grid.equal_ratios ? 0 : grid.max_s / 100);
    const double ratio = grid.max_s / shortest;
    const int count =
        std::clamp(static_cast<int>(std::ceil(std::log(ratio) / std::log(kGlanceRatio))),
                   kGlanceExposures, 3 * kGlanceExposures);
    std::vector<double> times;
    for (int i = 0; i < count; ++i) times.push_back(shortest * std::pow(ratio, (i + 0.5) / count));
    SIGHTLINE_ASSIGN_OR_RETURN(auto judged, Judge(times, power_w));
    return *std::min_element(judged.begin(), judged.end(), Better);
  }

  bool Tilted(const LensSetting& lens) const {
    return lens.sensor_tilt_x_rad != inspection_.rig.lens->sensor_tilt_x_rad ||
           lens.sensor_tilt_y_rad != inspection_.rig.lens->sensor_tilt_y_rad;
  }

  // The sensor as the inspection has it.
  LensSetting Untilted(double f_number, double focus_distance_m) const {
    return {f_number, focus_distance_m, inspection_.rig.lens->sensor_tilt_x_rad,
            inspection_.rig.lens->sensor_tilt_y_rad};
  }

  // The tilt to the laser sheet, if all frames have the same one and it is in reach.
  std::optional<LensSetting> TiltedToSheet(double f_number) const {
    if (!planning_.sensor_tilt) return std::nullopt;
    const FrameLight& first = *judge_.frames()[0].light;
    for (const WeightedFrame& frame : judge_.frames()) {
      if ((frame.light->sheet_normal - first.sheet_normal).norm() > kSameSheet ||
          std::abs(frame.light->sheet_offset_m - first.sheet_offset_m) > kSameSheet) {
        return std::nullopt;
      }
    }
    return FocusOnSheet(first, inspection_, f_number);
  }

  // Tries the lens settings and, for a range of focus distances, those next to the best.
  absl::Status TryFNumber(double f_number) {
    std::string refused;
    const std::optional<ExposureGrid> grid = GridAt(f_number, &refused);
    focus_of_.emplace_back();
    if (!grid) {
      FNumberChoice here;
      here.f_number = f_number;
      here.refused = refused;
      choice_.curve.push_back(std::move(here));
      return absl::OkStatus();
    }
    std::vector<LensSetting> lenses;
    for (const double distance : FirstFocusDistances(planning_, group_.stated_focus_m)) {
      lenses.push_back(Untilted(f_number, distance));
    }
    if (const auto tilted = TiltedToSheet(f_number)) lenses.push_back(*tilted);
    const std::vector<double> powers = Powers(planning_, inspection_.rig.laser.power_w);

    // One lens setting needs no coarse evaluation.
    if (lenses.size() == 1) {
      SIGHTLINE_RETURN_IF_ERROR(judge_.LookThrough(lenses[0]));
      return SearchPowers(*grid, lenses[0], powers);
    }
    std::vector<std::pair<LensSetting, JudgedSetting>> seen;
    const auto look = [&](const LensSetting& lens) -> absl::Status {
      SIGHTLINE_RETURN_IF_ERROR(judge_.LookThrough(lens));
      SIGHTLINE_ASSIGN_OR_RETURN(auto judged, Glance(*grid, powers.back()));
      seen.emplace_back(lens, judged);
      return absl::OkStatus();
    };
    for (const LensSetting& lens : lenses) {
      SIGHTLINE_RETURN_IF_ERROR(look(lens));
    }
    if (planning_.focus_distance_m && planning_.focus_distance_m->is_range()) {
      for (int round = 0; round < kFocusRounds; ++round) {
        // Untilted settings by distance, then the gaps next to the best.
        std::vector<std::pair<double, double>> by_distance;
        for (const auto& [lens, judged] : seen) {
          if (!Tilted(lens)) by_distance.emplace_back(lens.focus_distance_m, judged.cost());
        }
        std::sort(by_distance.begin(), by_distance.end());
        const auto best =
            std::min_element(by_distance.begin(), by_distance.end(),
                             [](const auto& a, const auto& b) { return a.second < b.second; });
        std::vector<double> between;
        const auto middle = [](double a, double b) { return RoundTo4Digits(2 / (1 / a + 1 / b)); };
        if (best != by_distance.begin()) {
          between.push_back(middle(std::prev(best)->first, best->first));
        }
        if (std::next(best) != by_distance.end()) {
          between.push_back(middle(best->first, std::next(best)->first));
        }
        for (const double distance : between) {
          SIGHTLINE_RETURN_IF_ERROR(look(Untilted(f_number, distance)));
        }
      }
    }
    size_t best = 0;
    for (size_t i = 0; i < seen.size(); ++i) {
      if (Better(seen[i].second, seen[best].second)) best = i;
      if (!Tilted(seen[i].first)) focus_of_.back().push_back(seen[i].second);
    }
    std::sort(focus_of_.back().begin(), focus_of_.back().end(), [](const auto& a, const auto& b) {
      return a.setting.lens.focus_distance_m < b.setting.lens.focus_distance_m;
    });
    SIGHTLINE_RETURN_IF_ERROR(judge_.LookThrough(seen[best].first));
    return SearchPowers(*grid, seen[best].first, powers);
  }

  absl::Status SearchPowers(const ExposureGrid& grid, const LensSetting& lens,
                            const std::vector<double>& powers) {
    double best_power = powers[0];
    if (powers.size() > 1) {
      std::optional<JudgedSetting> best;
      for (const double power : powers) {
        SIGHTLINE_ASSIGN_OR_RETURN(auto judged, Glance(grid, power));
        if (!best || Better(judged, *best)) {
          best = judged;
          best_power = power;
        }
      }
    }
    SIGHTLINE_ASSIGN_OR_RETURN(auto here, Search(grid, lens.f_number, best_power));
    choice_.curve.push_back(std::move(here));
    return absl::OkStatus();
  }

  // Measures what each freedom of the lens is worth: the best f-number without each, its exposure
  // searched as well.
  absl::Status TryAlternatives() {
    const JudgedSetting best = choice_.best_single();
    const LensSetting& lens = best.setting.lens;
    const auto search = [&](const char* name, const LensSetting& other) -> absl::Status {
      std::string refused;
      const std::optional<ExposureGrid> grid = GridAt(other.f_number, &refused);
      SIGHTLINE_RETURN_IF_ERROR(judge_.LookThrough(other));
      SIGHTLINE_ASSIGN_OR_RETURN(auto here,
                                 Search(*grid, other.f_number, best.setting.laser_power_w));
      choice_.alternatives.push_back({name, here.exposures[here.best]});
      return absl::OkStatus();
    };
    constexpr char kTilted[] = "sensor tilted to the laser sheet", kFlat[] = "sensor not tilted";
    if (const auto tilted = TiltedToSheet(lens.f_number)) {
      choice_.alternatives.push_back({Tilted(lens) ? kTilted : kFlat, best});
      const std::vector<JudgedSetting>& flat = choice_.focus;
      const LensSetting other =
          Tilted(lens) ? std::min_element(flat.begin(), flat.end(), Better)->setting.lens : *tilted;
      SIGHTLINE_RETURN_IF_ERROR(search(Tilted(lens) ? kFlat : kTilted, other));
    }
    if (planning_.focus_distance_m && lens.focus_distance_m != group_.stated_focus_m) {
      return search("focus as the inspection has it",
                    Untilted(lens.f_number, group_.stated_focus_m));
    }
    return absl::OkStatus();
  }

  // Tries pairs of the exposures that were evaluated with the best single exposure's lens setting.
  absl::Status TryPairs() {
    const FNumberChoice& here = choice_.curve[choice_.best];
    const JudgedSetting single = choice_.best_single();
    choice_.alternatives.push_back({"one exposure", single});
    // A dozen of them, as evenly spaced in ratio as they come, the best one among them.
    const double ratio = std::max(1.3, std::pow(here.exposures.back().setting.exposure_time_s /
                                                    here.exposures.front().setting.exposure_time_s,
                                                1.0 / kPairedExposures));
    std::vector<double> times = {single.setting.exposure_time_s};
    for (const JudgedSetting& judged : here.exposures) {
      const double time_s = judged.setting.exposure_time_s;
      if (std::all_of(times.begin(), times.end(), [&](double other) {
            return std::max(other / time_s, time_s / other) >= ratio;
          })) {
        times.push_back(time_s);
      }
    }
    std::vector<std::pair<double, double>> pairs;
    for (const double long_s : times) {
      for (const double short_s : times) {
        if (long_s <= short_s) continue;
        if (choice_.limit.longest_s && long_s + short_s > *choice_.limit.longest_s) continue;
        pairs.emplace_back(long_s, short_s);
      }
    }
    if (pairs.empty()) return absl::OkStatus();
    SIGHTLINE_RETURN_IF_ERROR(judge_.LookThrough(single.setting.lens));
    SIGHTLINE_ASSIGN_OR_RETURN(auto judged, judge_.JudgePairs(pairs, single.setting.laser_power_w));
    for (JudgedSetting& setting : judged) AddTimeCost(&setting);
    const auto best = std::min_element(judged.begin(), judged.end(), Better);
    choice_.alternatives.push_back({"two exposures", *best});
    if (Better(*best, single) && !AsGoodAs(single, *best)) choice_.pair = *best;
    return absl::OkStatus();
  }

  WatchedJudge judge_;
  const Inspection& inspection_;
  const OpticsPlanning& planning_;
  const SettingGroup& group_;
  const double grid_f_number_;  // the smallest of the inspection
  const ExposureGrid grid_;
  SettingChoice choice_;
  std::vector<std::vector<JudgedSetting>> focus_of_;  // by f-number
};

}  // namespace

bool AsGoodAs(const JudgedSetting& judged, const JudgedSetting& best) {
  return judged.cost() - best.cost() <=
         kNormal95 * judged.quality.StandardErrorOfDifference(best.quality);
}

ExposureGrid MakeExposureGrid(const SettingJudge& judge, const Inspection& inspection,
                              const ExposureLimit& limit) {
  const OpticsPlanning& planning = *inspection.optics;
  ExposureGrid grid;
  grid.count = planning.exposures;
  if (planning.exposure_time_s) {
    grid.min_s = planning.exposure_time_s->min;
    grid.max_s = planning.exposure_time_s->max;
    return grid;
  }
  double shortest = 0, longest = 0;
  for (size_t f = 0; f < judge.frames().size(); ++f) {
    const FrameLight& light = *judge.frames()[f].light;
    OpticalSetting setting;
    setting.lens.f_number = planning.f_numbers[0];
    setting.lens.focus_distance_m = light.median_line_depth_m;
    setting.exposure_time_s = 1;
    setting.laser_power_w = inspection.rig.laser.power_w;
    FrameSetup frame = judge.Setup(f, setting, 0);
    // Electrons per second of a pixel of the line, by the sensor's own law.
    const DetectionPlan plan = PlanDetection(frame, planning.detector);
    const PixelPlane& plane = plan.planes[0];
    const Sensor& sensor = frame.sensor;
    const double full =
        std::min(sensor.saturation_capacity_electrons - sensor.dark_mean_electrons,
                 (sensor.largest_dn() - DarkMeanDn(sensor)) / sensor.gain_dn_per_electron);
    const auto fill_s = [&](double radiance_w_m2_sr) {
      PixelIrradiance pixel;
      pixel.roi = {frame.roi.column_px, frame.roi.row_px, 2, 2};
      pixel.laser_irradiance_w_m2 = Image<float>(2, 2);
      const double irradiance =
          radiance_w_m2_sr * IrradianceFactor(frame, light.chief_distance_m)(0, 0);
      for (float& value : pixel.laser_irradiance_w_m2.values) {
        value = static_cast<float>(irradiance);
      }
      const double rate = MeanPhotoElectrons(pixel, frame).At(plane.first_row, plane.first_column);
      return std::clamp(full / std::max(rate, 1e-9), 1e-7, 25.0);
    };
    const double dark_s = std::min(fill_s(light.dim_line_radiance_w_m2_sr),
                                   kLargestContrast * fill_s(light.median_line_radiance_w_m2_sr));
    const double bright_s = fill_s(light.bright_line_radiance_w_m2_sr);
    shortest = f == 0 ? kDarkest * bright_s : std::min(shortest, kDarkest * bright_s);
    longest = std::max(longest, kBrightest * dark_s);
  }
  if (limit.longest_s) {
    longest = std::min(longest, *limit.longest_s);
    shortest = std::min(shortest, longest / 10);
  }
  grid.min_s = std::max(shortest, longest / kLargestRatio);
  grid.max_s = longest;
  grid.equal_ratios = true;
  return grid;
}

absl::StatusOr<SettingChoice> ChooseSetting(SettingJudge& judge, const Inspection& inspection,
                                            const SettingGroup& group, const ExposureGrid& grid,
                                            const std::function<void(double)>& progress) {
  return Chooser(judge, inspection, group, grid, progress).Run();
}

}  // namespace sightline
