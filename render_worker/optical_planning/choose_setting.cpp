#include "render_worker/optical_planning/choose_setting.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "absl/strings/str_format.h"
#include "core/inspection/field_checks.h"
#include "core/rig/scheimpflug.h"
#include "proto/status/rpc_status.h"
#include "render_worker/render/part_view.h"
#include "render_worker/sensor/expose.h"

namespace sightline {
namespace {

constexpr double kNormal95 = 1.959963984540054;
// Of the exposures that are tried without being told: parts and multiples of what fills a pixel.
constexpr double kDarkest = 1.0 / 25, kBrightest = 4;
// Places so much darker than the median of the line are given up.
constexpr double kLargestContrast = 100;
constexpr double kLargestRatio = 1e5;
constexpr double kLargestTilt_rad = 30 * std::numbers::pi / 180;
constexpr int kFirstFocusDistances = 5, kFocusRounds = 2;
// Exposures at which a focus distance or a power is looked at before it is searched properly.
constexpr int kGlanceExposures = 5;
constexpr size_t kMostPairs = 60;

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

class Chooser {
 public:
  Chooser(SettingJudge& judge, const Inspection& inspection, const SettingGroup& group,
          const ExposureGrid& grid, const std::function<void(double)>& progress)
      : judge_(judge),
        inspection_(inspection),
        planning_(*inspection.optics),
        group_(group),
        grid_f_number_(inspection.optics->f_numbers[0]),
        grid_(grid),
        progress_(progress) {
    choice_.limit = LimitExposure(inspection.costs, inspection.rig.scan_step_m, planning_,
                                  group.image_speed_px_per_m);
  }

  absl::StatusOr<SettingChoice> Run() {
    const size_t count = group_.f_numbers.size();
    for (size_t n = 0; n < count; ++n) {
      if (absl::Status status = TryFNumber(group_.f_numbers[n]); !status.ok()) return status;
      if (progress_) progress_(static_cast<double>(n + 1) / static_cast<double>(count));
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
                               grid_.min_s, planning_.f_numbers[0],
                               choice_.limit.longest_s.value_or(0), choice_.limit.because)),
                           "EXPOSURE_TOO_LONG");
    }
    choice_.focus = focus_of_[choice_.best];
    if (best_without_tilt_ && best_with_tilt_) {
      choice_.alternatives.push_back({"sensor not tilted", *best_without_tilt_});
      choice_.alternatives.push_back({"sensor tilted to the laser sheet", *best_with_tilt_});
    }
    if (stated_focus_ && planning_.focus_distance_m) {
      choice_.alternatives.push_back({"focus as the inspection has it", *stated_focus_});
    }
    if (planning_.two_exposures) {
      if (absl::Status status = TryPairs(); !status.ok()) return status;
    }
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
    auto judged = judge_.Judge(times_s, power_w);
    if (!judged.ok()) return judged.status();
    for (JudgedSetting& setting : *judged) AddTimeCost(&setting);
    return judged;
  }

  void AddTimeCost(JudgedSetting* setting) const {
    if (!(planning_.cost_px_per_s > 0) || !(group_.travel_m > 0)) return;
    setting->time_cost_px =
        planning_.cost_px_per_s *
        ScanTime(inspection_.costs, inspection_.rig.scan_step_m, planning_,
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
                         auto judged = Judge(times, power_w);
                         if (!judged.ok()) return judged.status();
                         std::vector<double> costs;
                         for (JudgedSetting& setting : *judged) {
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
    std::vector<double> times;
    const double shortest = std::max(grid.min_s, grid.max_s / 100);
    for (int i = 0; i < kGlanceExposures; ++i) {
      times.push_back(shortest * std::pow(grid.max_s / shortest, (i + 0.5) / kGlanceExposures));
    }
    auto judged = Judge(times, power_w);
    if (!judged.ok()) return judged.status();
    return *std::min_element(judged->begin(), judged->end(), Better);
  }

  void Keep(const JudgedSetting& judged, std::optional<JudgedSetting>* best) const {
    if (!*best || Better(judged, **best)) *best = judged;
  }

  // The lens settings to try, and for a range of focus distances those beside the best.
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
      lenses.push_back({f_number, distance, inspection_.rig.lens->sensor_tilt_x_rad,
                        inspection_.rig.lens->sensor_tilt_y_rad});
    }
    const size_t untilted = lenses.size();
    if (planning_.sensor_tilt) {
      const auto tilted = FocusOnSheet(*judge_.frames()[0].light, inspection_, f_number);
      if (tilted) lenses.push_back(*tilted);
    }
    const std::vector<double> powers = Powers(planning_, inspection_.rig.laser.power_w);

    // One lens setting needs no glance.
    if (lenses.size() == 1) {
      if (absl::Status s = judge_.LookThrough(lenses[0]); !s.ok()) return s;
      return SearchPowers(*grid, lenses[0], powers);
    }
    std::vector<std::pair<LensSetting, JudgedSetting>> seen;
    const auto look = [&](const LensSetting& lens) -> absl::Status {
      if (absl::Status s = judge_.LookThrough(lens); !s.ok()) return s;
      auto judged = Glance(*grid, powers.back());
      if (!judged.ok()) return judged.status();
      seen.emplace_back(lens, *judged);
      return absl::OkStatus();
    };
    for (const LensSetting& lens : lenses) {
      if (absl::Status s = look(lens); !s.ok()) return s;
    }
    if (planning_.focus_distance_m && planning_.focus_distance_m->is_range()) {
      for (int round = 0; round < kFocusRounds; ++round) {
        // Untilted ones by distance; the gaps beside the best.
        std::vector<std::pair<double, double>> by_distance;
        for (size_t i = 0; i < seen.size(); ++i) {
          if (planning_.sensor_tilt && i == untilted && lenses.size() > untilted) continue;
          by_distance.emplace_back(seen[i].first.focus_distance_m, seen[i].second.cost());
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
          LensSetting lens = lenses[0];
          lens.focus_distance_m = distance;
          if (absl::Status s = look(lens); !s.ok()) return s;
        }
      }
    }
    size_t best = 0;
    for (size_t i = 0; i < seen.size(); ++i) {
      if (Better(seen[i].second, seen[best].second)) best = i;
      const bool tilted = planning_.sensor_tilt && lenses.size() > untilted && i == untilted;
      Keep(seen[i].second, tilted ? &best_with_tilt_ : &best_without_tilt_);
      if (!tilted) focus_of_.back().push_back(seen[i].second);
      if (seen[i].first.focus_distance_m == group_.stated_focus_m && !tilted) {
        Keep(seen[i].second, &stated_focus_);
      }
    }
    std::sort(focus_of_.back().begin(), focus_of_.back().end(), [](const auto& a, const auto& b) {
      return a.setting.lens.focus_distance_m < b.setting.lens.focus_distance_m;
    });
    if (absl::Status s = judge_.LookThrough(seen[best].first); !s.ok()) return s;
    return SearchPowers(*grid, seen[best].first, powers);
  }

  absl::Status SearchPowers(const ExposureGrid& grid, const LensSetting& lens,
                            const std::vector<double>& powers) {
    double best_power = powers[0];
    if (powers.size() > 1) {
      std::optional<JudgedSetting> best;
      for (const double power : powers) {
        auto judged = Glance(grid, power);
        if (!judged.ok()) return judged.status();
        if (!best || Better(*judged, *best)) {
          best = *judged;
          best_power = power;
        }
      }
    }
    auto here = Search(grid, lens.f_number, best_power);
    if (!here.ok()) return here.status();
    const JudgedSetting& judged = here->exposures[here->best];
    const bool tilted = lens.sensor_tilt_x_rad != inspection_.rig.lens->sensor_tilt_x_rad ||
                        lens.sensor_tilt_y_rad != inspection_.rig.lens->sensor_tilt_y_rad;
    Keep(judged, tilted ? &best_with_tilt_ : &best_without_tilt_);
    choice_.curve.push_back(*std::move(here));
    return absl::OkStatus();
  }

  // Pairs of the exposures that were looked at with the best single one's lens.
  absl::Status TryPairs() {
    const FNumberChoice& here = choice_.curve[choice_.best];
    const JudgedSetting single = choice_.best_single();
    choice_.alternatives.push_back({"one exposure", single});
    std::vector<std::pair<double, double>> pairs;
    for (size_t l = 0; l < here.exposures.size(); ++l) {
      for (size_t s = 0; s < l; ++s) {
        const double long_s = here.exposures[l].setting.exposure_time_s;
        const double short_s = here.exposures[s].setting.exposure_time_s;
        // Nearly equal ones show the same.
        if (long_s < 1.5 * short_s) continue;
        if (choice_.limit.longest_s && long_s + short_s > *choice_.limit.longest_s) continue;
        pairs.emplace_back(long_s, short_s);
      }
    }
    if (pairs.empty()) return absl::OkStatus();
    // A part of them, evenly, if they are many.
    if (pairs.size() > kMostPairs) {
      std::vector<std::pair<double, double>> some;
      for (size_t i = 0; i < kMostPairs; ++i) some.push_back(pairs[i * pairs.size() / kMostPairs]);
      pairs = std::move(some);
    }
    if (absl::Status s = judge_.LookThrough(single.setting.lens); !s.ok()) return s;
    auto judged = judge_.JudgePairs(pairs, single.setting.laser_power_w);
    if (!judged.ok()) return judged.status();
    for (JudgedSetting& setting : *judged) AddTimeCost(&setting);
    const auto best = std::min_element(judged->begin(), judged->end(), Better);
    choice_.alternatives.push_back({"two exposures", *best});
    if (Better(*best, single) && !AsGoodAs(single, *best)) choice_.pair = *best;
    return absl::OkStatus();
  }

  SettingJudge& judge_;
  const Inspection& inspection_;
  const OpticsPlanning& planning_;
  const SettingGroup& group_;
  const double grid_f_number_;  // the smallest of the inspection
  const ExposureGrid grid_;
  const std::function<void(double)>& progress_;
  SettingChoice choice_;
  std::vector<std::vector<JudgedSetting>> focus_of_;  // by f-number
  std::optional<JudgedSetting> best_without_tilt_, best_with_tilt_, stated_focus_;
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
