// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optical_planning/optics_answer.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "core/field_limits/field_checks.h"

namespace sightline {
namespace {

void Set(const QualityEstimate::Interval& from, v1::OpticsInterval* to) {
  to->set_lower(from.lower);
  to->set_upper(from.upper);
}

// Least and largest value of a setting among neighbours of the best one that are as good, without a
// gap.
template <typename Value>
QualityEstimate::Interval AsGoodRange(const std::vector<const JudgedSetting*>& settings,
                                      size_t best, const JudgedSetting& reference,
                                      const Value& value) {
  QualityEstimate::Interval range{value(*settings[best]), value(*settings[best])};
  for (size_t i = best; i-- > 0 && AsGoodAs(*settings[i], reference);) {
    range.lower = value(*settings[i]);
  }
  for (size_t i = best + 1; i < settings.size() && AsGoodAs(*settings[i], reference); ++i) {
    range.upper = value(*settings[i]);
  }
  return range;
}

// Frames that show no line, and clipping beyond the limit; empty: neither.
std::string WhatIsLost(const JudgedSetting& best, double max_clipped_fraction) {
  std::string text;
  const auto dark = std::count_if(best.frames.begin(), best.frames.end(), [](const LineSums& sums) {
    return sums.crossings > 0 && sums.found == 0;
  });
  if (dark > 0) {
    absl::StrAppend(
        &text, absl::StrFormat(" No line is found in %d of %d frames.", dark, best.frames.size()));
  }
  const double clipped = best.quality.mean().clipped_fraction;
  if (clipped > max_clipped_fraction) {
    absl::StrAppend(
        &text, absl::StrFormat(" %.0f %% of its points are clipped, more than the permitted %.0f "
                               "%%: a shorter exposure, less power or a higher f-number is needed "
                               "than the ranges allow.",
                               100 * clipped, 100 * max_clipped_fraction));
  }
  return text;
}

std::string Statement(const SettingChoice& choice, double max_clipped_fraction) {
  std::vector<std::string> others;
  for (size_t n = 0; n < choice.curve.size(); ++n) {
    const FNumberChoice& here = choice.curve[n];
    if (n == choice.best || here.exposures.empty()) continue;
    if (AsGoodAs(here.exposures[here.best], choice.chosen())) {
      others.push_back(absl::StrFormat("f/%.3g", here.f_number));
    }
  }
  const JudgedSetting& best = choice.chosen();
  std::string text =
      absl::StrFormat("f/%.3g with %.4g ms has the least cost, %.3f px", best.setting.lens.f_number,
                      1e3 * best.setting.exposure_time_s, best.cost());
  if (best.setting.second_exposure_time_s > 0) {
    text = absl::StrFormat("f/%.3g with %.4g ms and %.4g ms has the least cost, %.3f px",
                           best.setting.lens.f_number, 1e3 * best.setting.exposure_time_s,
                           1e3 * best.setting.second_exposure_time_s, best.cost());
  }
  if (others.empty()) {
    absl::StrAppend(&text, "; no other f-number is as good.");
  } else {
    absl::StrAppend(&text, "; ", absl::StrJoin(others, ", "),
                    " are not significantly worse in the simulated images.");
  }
  return absl::StrCat(text, WhatIsLost(best, max_clipped_fraction));
}

}  // namespace

v1::OpticsPoint PointToProto(const JudgedSetting& judged, const JudgedSetting& best,
                             double height_per_px, double scan_time_s) {
  v1::OpticsPoint point;
  const LineQuality& quality = judged.quality.mean();
  const OpticalSetting& setting = judged.setting;
  point.set_f_number(setting.lens.f_number);
  point.set_exposure_time_s(setting.exposure_time_s);
  point.set_focus_distance_m(setting.lens.focus_distance_m);
  for (const auto& [value, interval] :
       {std::pair(point.f_number(), point.mutable_f_number_interval()),
        std::pair(point.exposure_time_s(), point.mutable_exposure_time_s_interval()),
        std::pair(point.focus_distance_m(), point.mutable_focus_distance_m_interval())}) {
    Set({value, value}, interval);
  }
  point.set_u_px(quality.u_px);
  Set(judged.quality.u_px(), point.mutable_u_px_interval());
  point.set_profile_coverage(quality.profile_coverage);
  Set(judged.quality.profile_coverage(), point.mutable_profile_coverage_interval());
  point.set_cost(judged.cost());
  QualityEstimate::Interval cost = judged.quality.cost();
  Set({cost.lower + judged.time_cost_px, cost.upper + judged.time_cost_px},
      point.mutable_cost_interval());
  point.set_bias_px(quality.bias_px);
  Set(judged.quality.bias_px(), point.mutable_bias_px_interval());
  point.set_rms_px(quality.rms_px);
  Set(judged.quality.rms_px(), point.mutable_rms_px_interval());
  point.set_false_lines_per_column(quality.false_lines_per_column);
  Set(judged.quality.false_lines_per_column(), point.mutable_false_lines_per_column_interval());
  v1::OpticalSetting* all = point.mutable_setting();
  all->set_f_number(setting.lens.f_number);
  all->set_exposure_time_s(setting.exposure_time_s);
  all->set_second_exposure_time_s(setting.second_exposure_time_s);
  all->set_focus_distance_m(setting.lens.focus_distance_m);
  all->set_laser_power_w(setting.laser_power_w);
  all->set_sensor_tilt_x_deg(Degrees(setting.lens.sensor_tilt_x_rad));
  all->set_sensor_tilt_y_deg(Degrees(setting.lens.sensor_tilt_y_rad));
  point.set_cost_standard_error(judged.quality.CostStandardError());
  point.set_clipped_fraction(quality.clipped_fraction);
  point.set_u_height_m(height_per_px * quality.u_px);
  point.set_as_good_as_best(AsGoodAs(judged, best));
  point.set_scan_time_s(scan_time_s);
  return point;
}

double HeightPerPixel(const FrameSetup& frame, double line_depth_m) {
  return frame.sensor.pixel_pitch_m * line_depth_m /
         (frame.ImageDistance() * std::sin(frame.plate.incidence_angle_rad));
}

v1::OpticsChoice ChoiceToProto(const SettingChoice& choice, const Inspection& inspection,
                               const SettingGroup& group, double height_per_px) {
  v1::OpticsChoice answer;
  const JudgedSetting& best = choice.chosen();
  const auto point = [&](const JudgedSetting& judged) {
    const double total_s = judged.setting.exposure_time_s + judged.setting.second_exposure_time_s;
    return PointToProto(
        judged, best, height_per_px,
        ScanTime(inspection.stated_costs, inspection.rig.scan_step_m, *inspection.optics,
                 group.image_speed_px_per_m, group.travel_m, total_s));
  };
  // Exposures of an f-number that are as good as its best; focus distances at the best f-number.
  const auto exposure_range = [](const FNumberChoice& here) {
    std::vector<const JudgedSetting*> settings;
    for (const JudgedSetting& judged : here.exposures) settings.push_back(&judged);
    return AsGoodRange(settings, here.best, here.exposures[here.best],
                       [](const JudgedSetting& j) { return j.setting.exposure_time_s; });
  };
  double first_exposure_s = 0, first_f_number = 0;
  std::vector<const JudgedSetting*> by_f_number;
  size_t best_of_them = 0;
  for (size_t n = 0; n < choice.curve.size(); ++n) {
    const FNumberChoice& here = choice.curve[n];
    if (here.exposures.empty()) continue;
    if (n == choice.best) best_of_them = by_f_number.size();
    const JudgedSetting& judged = here.exposures[here.best];
    by_f_number.push_back(&judged);
    v1::OpticsPoint* entry = answer.add_curve();
    *entry = point(judged);
    Set(exposure_range(here), entry->mutable_exposure_time_s_interval());
    if (first_f_number == 0) {
      first_f_number = here.f_number;
      first_exposure_s = judged.setting.exposure_time_s;
    }
    // Thesis eq. 6.6.
    entry->set_constant_exposure_time_s(first_exposure_s *
                                        std::pow(here.f_number / first_f_number, 2));
    for (const JudgedSetting& tried : here.exposures) {
      v1::OpticsPoint::ExposurePoint* exposure = entry->add_exposures();
      exposure->set_exposure_time_s(tried.setting.exposure_time_s);
      exposure->set_cost(tried.cost());
      exposure->set_u_px(tried.quality.mean().u_px);
      exposure->set_profile_coverage(tried.quality.mean().profile_coverage);
    }
  }
  v1::OpticsPoint* chosen = answer.mutable_best();
  *chosen = point(best);
  Set(AsGoodRange(by_f_number, best_of_them, choice.best_single(),
                  [](const JudgedSetting& j) { return j.setting.lens.f_number; }),
      chosen->mutable_f_number_interval());
  if (!choice.pair) {
    Set(exposure_range(choice.curve[choice.best]), chosen->mutable_exposure_time_s_interval());
  }
  if (!choice.focus.empty()) {
    std::vector<const JudgedSetting*> settings;
    for (const JudgedSetting& judged : choice.focus) settings.push_back(&judged);
    size_t nearest = 0;
    for (size_t i = 1; i < settings.size(); ++i) {
      if (settings[i]->cost() < settings[nearest]->cost()) nearest = i;
    }
    QualityEstimate::Interval range =
        AsGoodRange(settings, nearest, *settings[nearest],
                    [](const JudgedSetting& j) { return j.setting.lens.focus_distance_m; });
    range.lower = std::min(range.lower, chosen->focus_distance_m());
    range.upper = std::max(range.upper, chosen->focus_distance_m());
    Set(range, chosen->mutable_focus_distance_m_interval());
  }
  for (const SettingChoice::Alternative& alternative : choice.alternatives) {
    v1::OpticsChoice::Alternative* entry = answer.add_alternatives();
    entry->set_name(alternative.name);
    *entry->mutable_point() = point(alternative.judged);
  }
  answer.set_statement(Statement(choice, inspection.optics->max_clipped_fraction));
  answer.set_longest_exposure_time_s(choice.limit.longest_s.value_or(0));
  answer.set_longest_because(choice.limit.because);
  answer.set_scan_time_s(answer.best().scan_time_s());
  return answer;
}

v1::LearnedDetection DetectionToProto(const DetectionNoise& noise,
                                      std::span<const DetectedBlock> blocks, int frames) {
  v1::LearnedDetection message;
  v1::LineDetection::Table* table = message.mutable_table();
  for (const double distance : noise.distances_m) table->add_distances_m(distance);
  for (const double angle : noise.incidence_angles_rad) {
    table->add_incidence_angles_deg(angle / Radians(1));
  }
  for (const double u_px : noise.u_px) table->add_standard_deviations_px(u_px);
  for (const double error : noise.relative_standard_error) {
    message.add_relative_standard_errors(error);
  }
  message.set_frames(frames);
  for (const DetectedBlock& block : blocks) {
    message.set_line_points(message.line_points() + block.crossings);
    message.set_found_points(message.found_points() + block.found);
  }
  message.set_bias_px(noise.bias_px);
  message.set_deviation_dispersion(noise.deviation_dispersion);
  message.set_found_dispersion(noise.found_dispersion);
  return message;
}

}  // namespace sightline
