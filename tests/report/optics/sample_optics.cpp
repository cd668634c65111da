// SPDX-License-Identifier: Apache-2.0
#include "tests/report/optics/sample_optics.h"

#include <cmath>

namespace sightline {
namespace {

void SetInterval(v1::OpticsInterval* interval, double lower, double upper) {
  interval->set_lower(lower);
  interval->set_upper(upper);
}

double Coverage(double exposure, double f_number) {
  return 0.98 / (1 + 0.05 / exposure + std::pow(f_number / 40, 2));
}

// `exposure`: 1 where the line is exposed just right.
double UPx(double exposure, double f_number) {
  return 0.12 + 0.015 * f_number + 0.6 * std::pow(f_number, -3) +
         2.5 * (1 - std::exp(-0.2 * std::pow(std::log(exposure), 2)));
}

double Cost(double exposure, double f_number) {
  const double a = Coverage(exposure, f_number);
  return a * UPx(exposure, f_number) + (1 - a) * 3;
}

v1::OpticsPoint SamplePoint(double f_number) {
  const double right_s = 0.0012 * f_number * f_number;
  v1::OpticsPoint point;
  point.set_f_number(f_number);
  SetInterval(point.mutable_f_number_interval(), f_number, f_number);
  point.set_exposure_time_s(std::round(1e6 * right_s) / 1e6);
  SetInterval(point.mutable_exposure_time_s_interval(), 0.8 * right_s, 1.3 * right_s);
  point.set_focus_distance_m(0.6);
  SetInterval(point.mutable_focus_distance_m_interval(), 0.59, 0.62);
  const double u_px = UPx(1, f_number), a = Coverage(1, f_number), cost = Cost(1, f_number);
  point.set_u_px(u_px);
  SetInterval(point.mutable_u_px_interval(), 0.9 * u_px, 1.2 * u_px);
  point.set_profile_coverage(a);
  SetInterval(point.mutable_profile_coverage_interval(), a - 0.03, a + 0.01);
  point.set_cost(cost);
  SetInterval(point.mutable_cost_interval(), 0.9 * cost, 1.2 * cost);
  point.set_bias_px(-0.021);
  SetInterval(point.mutable_bias_px_interval(), -0.03, -0.01);
  point.set_rms_px(1.01 * u_px);
  SetInterval(point.mutable_rms_px_interval(), 0.9 * u_px, 1.2 * u_px);
  point.set_false_lines_per_column(0.0034);
  SetInterval(point.mutable_false_lines_per_column_interval(), 0.002, 0.005);
  v1::OpticalSetting* setting = point.mutable_setting();
  setting->set_f_number(f_number);
  setting->set_exposure_time_s(point.exposure_time_s());
  setting->set_focus_distance_m(0.6);
  setting->set_laser_power_w(0.005);
  point.set_cost_standard_error(0.004);
  point.set_clipped_fraction(0.048);
  point.set_u_height_m(1e-4 * u_px);
  point.set_expected_real_u_px(u_px / (1 - 0.15));
  SetInterval(point.mutable_expected_real_u_px_interval(), u_px, 1.5 * u_px);
  point.set_constant_exposure_time_s(0.0009 * f_number * f_number);
  point.set_scan_time_s(41.5);
  return point;
}

v1::OpticsPoint SampleCurvePoint(double f_number) {
  v1::OpticsPoint point = SamplePoint(f_number);
  // A search does not ask in order: every seventh of 24.
  for (int i = 0; i < 24; ++i) {
    const double exposure = std::pow(10, -1.2 + 2.4 * (7 * i % 24) / 23.0);
    v1::OpticsPoint::ExposurePoint* entry = point.add_exposures();
    entry->set_exposure_time_s(exposure * point.exposure_time_s());
    entry->set_cost(Cost(exposure, f_number));
    entry->set_u_px(UPx(exposure, f_number));
    entry->set_profile_coverage(Coverage(exposure, f_number));
  }
  return point;
}

void AddAlternative(v1::OpticsChoice* choice, const char* name, double f_number, double cost) {
  v1::OpticsChoice::Alternative* alternative = choice->add_alternatives();
  alternative->set_name(name);
  *alternative->mutable_point() = SamplePoint(f_number);
  alternative->mutable_point()->set_cost(cost);
  SetInterval(alternative->mutable_point()->mutable_cost_interval(), 0.95 * cost, 1.05 * cost);
}

void AddFrame(v1::OpticsChoice* choice, int scan, int number, double weight) {
  v1::RepresentativeFrame* frame = choice->add_frames();
  frame->set_scan(scan);
  frame->set_frame(number);
  frame->set_stage_position_m(0.0025 * number);
  frame->set_weight(weight);
  frame->set_line_points(1234);
  frame->set_u_px(0.187);
  frame->set_profile_coverage(0.953);
  frame->set_picture_png("picture bytes");
}

void SetScan(v1::OpticsChoice* choice, int scan, double f_number, double longest_s) {
  choice->set_scan(scan);
  *choice->mutable_best() = SamplePoint(f_number);
  choice->mutable_best()->set_scan_time_s(0);
  choice->set_statement("f/4 cannot be told apart from it.");
  choice->set_represented_fraction(0.883);
  choice->set_longest_exposure_time_s(longest_s);
  choice->set_longest_because(longest_s == 0 ? "" : "half a pixel of motion blur");
  choice->set_scan_time_s(38.25 + scan);
}

}  // namespace

v1::OpticsPlan SampleOptics() {
  v1::OpticsPlan optics;
  optics.set_inspection_name("Cylinder head");
  optics.set_sightline_version("0.1.0");
  optics.set_seed(7);
  optics.set_evaluated_images(23456);
  optics.add_warnings("The lens has no catalogued transmission; 0.9 is assumed.");
  for (const double f_number : {1.4, 2.0, 2.8, 4.0, 5.6, 8.0, 11.0, 16.0, 22.0}) {
    *optics.add_curve() = SampleCurvePoint(f_number);
  }
  optics.mutable_curve(2)->set_as_good_as_best(true);
  optics.mutable_curve(3)->set_as_good_as_best(true);
  *optics.mutable_best() = optics.curve(2);
  optics.mutable_best()->clear_exposures();

  v1::OpticsChoice* common = optics.mutable_common();
  common->set_statement(
      "f/2.8 and f/4 cannot be told apart; f/2.8 needs half the exposure time of f/4.");
  common->set_represented_fraction(0.914);
  common->set_longest_exposure_time_s(0.05);
  common->set_longest_because("half a pixel of motion blur at the stage's speed");
  common->set_scan_time_s(41.5);
  AddAlternative(common, "without a tilted sensor", 5.6, 0.502);
  AddAlternative(common, "with one exposure", 4, 0.412);
  common->mutable_alternatives(1)->mutable_point()->set_as_good_as_best(true);
  AddFrame(common, 1, 12, 0.45);
  AddFrame(common, 1, 80, 0.25);
  AddFrame(common, 2, 33, 0.3);
  for (const int scan : {1, 2}) {
    v1::OpticsChoice* choice = optics.add_scans();
    SetScan(choice, scan, scan == 1 ? 2.8 : 4, scan == 1 ? 0 : 0.02);
    AddFrame(choice, scan, 10 * scan, 0.6);
    AddFrame(choice, scan, 50, 0.4);
  }
  v1::UncertaintyCorrection* correction = optics.mutable_correction();
  correction->set_source("plate/verification.json");
  for (const double f_number : {2.8, 5.6}) {
    v1::UncertaintyCorrection::FNumberError* error = correction->add_by_f_number();
    error->set_f_number(f_number);
    error->set_mean_e_u(0.154);
    error->set_standard_deviation(0.062);
    error->set_recordings(16);
  }
  return optics;
}

v1::DeviceChoice SampleDevices() {
  v1::DeviceChoice devices;
  const auto add = [&](const char* camera, const char* lens, double width_m,
                       const char* lost_because) {
    v1::DeviceCombination* combination = devices.add_combinations();
    combination->set_camera(camera);
    combination->set_lens(lens);
    combination->set_laser("Line projector 660 nm");
    combination->set_chosen(*lost_because == '\0');
    combination->set_lost_because(lost_because);
    combination->set_field_of_view_width_m(width_m);
    combination->set_field_of_view_height_m(0.75 * width_m);
    combination->set_pixel_footprint_m(width_m / 2048);
    combination->set_depth_of_field_m(0.0123);
    combination->set_price_eur(1845);
    return combination;
  };
  add("Camera A", "16 mm", 0.25, "its pixels are too coarse for the finest tolerance");
  v1::DeviceCombination* rendered[] = {add("Camera A", "25 mm", 0.16, ""),
                                       add("Camera B", "25 mm", 0.14, "it costs 0.080 px more")};
  for (v1::DeviceCombination* combination : rendered) {
    combination->set_f_number(2.8);
    combination->set_exposure_time_s(0.0094);
    combination->set_u_height_m(1.77e-5);
    combination->set_profile_coverage(0.931);
    combination->set_scan_time_s(41.5);
    combination->set_cost(0.373);
  }
  return devices;
}

}  // namespace sightline
