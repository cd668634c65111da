// SPDX-License-Identifier: Apache-2.0
// Measured blur of an edge against distance (scanner-sim), explained by the product's optics:
//   bench_focus_curve DATA_FOLDER OUT_FOLDER
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>

#include "bench/real_recordings/curve_fit.h"
#include "render_worker/diagnosis/expectation/line_spread.h"
#include "render_worker/optics/pupil.h"

namespace sightline {
namespace {

constexpr double kPixel_m = 3.45e-6, kWavelength_m = 550e-9;
constexpr double kFocalLength_m = 0.051, kFNumber = 12.75, kFocusDistance_m = 0.80;
// The edge as one half of a square wave of this period; its blur is less than a tenth of it.
constexpr int kPeriod_px = 400;

struct State {
  double focus_relative = 0;
  double f_number_factor = 1;
  double spherical_waves = 0;  // W040 at the rim
  double focal_length_m = kFocalLength_m;
  double blur_px = 0;  // Gaussian, of all distances: printed edge, averaging over rows
};

// Twice the width a of the logistic function 1/(1 + exp(-x/a)) that is nearest to the edge's
// profile within 100 px, which is what the data's authors report.
double LogisticWidth(const std::vector<double>& edge) {
  double a = 1;
  for (int iteration = 0; iteration < 30; ++iteration) {
    double gradient = 0, curvature = 0;
    for (size_t i = 0; i < edge.size(); ++i) {
      const double x = static_cast<double>(i) - 100;
      const double value = 1 / (1 + std::exp(-x / a));
      const double slope = -x / (a * a) * value * (1 - value);
      gradient += slope * (edge[i] - value);
      curvature += slope * slope;
    }
    const double step = gradient / curvature;
    a = std::max(0.1, a + std::max(-0.5 * a, std::min(0.5 * a, step)));
    if (std::abs(step) < 1e-7) break;
  }
  return 2 * a;
}

double EdgeWidth(double distance_m, const State& state) {
  const double focus_m = kFocusDistance_m * (1 + state.focus_relative);
  const double image_m = 1 / (1 / state.focal_length_m - 1 / focus_m);
  Lens lens;
  lens.focal_length_m = state.focal_length_m;
  lens.f_number = kFNumber * state.f_number_factor;
  Pupil pupil = MakePupil(lens);
  if (state.spherical_waves != 0) {
    pupil.seidel.push_back({state.spherical_waves * kWavelength_m, pupil.radius_m, 4, 0, 0});
  }
  const double step_per_m = 1 / (kPeriod_px * kPixel_m);
  const auto transfer = LineTransfer(pupil, kWavelength_m, image_m,
                                     DefocusCurvature(state.focal_length_m, distance_m, image_m),
                                     step_per_m, kPeriod_px / 2);
  std::vector<double> edge(201, 0.5);
  for (int k = 1; k < kPeriod_px / 2; k += 2) {
    const double q_px = static_cast<double>(k) / kPeriod_px;
    const double pixel = std::sin(std::numbers::pi * q_px) / (std::numbers::pi * q_px);
    const double blur = std::exp(-2 * std::pow(std::numbers::pi * q_px * state.blur_px, 2));
    const double amplitude =
        transfer[static_cast<size_t>(k)].real() * pixel * blur * 2 / (std::numbers::pi * k);
    for (size_t i = 0; i < edge.size(); ++i) {
      edge[i] += amplitude * std::sin(2 * std::numbers::pi * q_px * (static_cast<double>(i) - 100));
    }
  }
  return LogisticWidth(edge);
}

int Run(const std::string& data, const std::string& out) {
  const std::string path = data + "/scanner_sim/data/calibrations/camera/camera_focus.json";
  std::ifstream file(path);
  if (!file) {
    std::printf("skipped: no %s\n", path.c_str());
    return 0;
  }
  const auto json = nlohmann::json::parse(file);
  const auto curve = json.at("dof (dist, res), pixels").get<std::vector<std::vector<double>>>();
  const auto count = static_cast<Eigen::Index>(curve[0].size());
  std::vector<double> distance_m;
  CurveData points;
  points.observed.resize(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    distance_m.push_back(1e-3 * curve[0][static_cast<size_t>(i)]);
    points.observed[i] = curve[1][static_cast<size_t>(i)];
    // Runs of five points in turn, so that a held-out point is not a neighbour's interpolation.
    points.held_out.push_back(i / 5 % 2 == 1);
  }
  // Scatter from second differences, 6 sigma^2 for independent errors; no error is stated.
  double squares = 0;
  for (Eigen::Index i = 1; i + 1 < count; ++i) {
    squares +=
        std::pow(points.observed[i + 1] - 2 * points.observed[i] + points.observed[i - 1], 2);
  }
  const double sigma = std::sqrt(squares / (6.0 * static_cast<double>(count - 2)));
  points.standard_deviation = Eigen::VectorXd::Constant(count, sigma);
  std::printf("%d points, scatter from second differences %.4f px\n", static_cast<int>(count),
              sigma);

  const CurveParameter focus{"focus_distance_relative", 0, 0.03, 1e-3};
  const CurveParameter f_number{"f_number_factor", 1, 0.1, 5e-3, 0.3};
  const CurveParameter spherical{"spherical_waves", 0, 0.5, 0.02};
  const CurveParameter blur{"edge_blur_px", 0.5, 0.7, 0.02, 0.0};
  // Principal distance of the camera's geometric calibration, 14 876 px (mean of its two), and the
  // focal length that has it at the stated focus.
  constexpr double kCalibrated_m = 14876 * kPixel_m;
  constexpr double kCalibratedFocal_m = 1 / (1 / kCalibrated_m + 1 / kFocusDistance_m);
  struct Model {
    std::string name;
    std::vector<CurveParameter> parameters;
    double focal_length_m = kFocalLength_m;
  };
  const std::vector<Model> models = {
      {"nominal", {}},
      {"f-number", {f_number}},
      {"focus", {focus}},
      {"focus + f-number", {focus, f_number}},
      {"focus + blur", {focus, blur}},
      {"focus + spherical", {focus, spherical}},
      {"focus + f-number + blur", {focus, f_number, blur}},
      {"focus + f-number + spherical", {focus, f_number, spherical}},
      {"focus + blur + spherical", {focus, blur, spherical}},
      {"focus + f-number + blur + spherical", {focus, f_number, blur, spherical}},
      {"calibrated f: focus + blur", {focus, blur}, kCalibratedFocal_m},
      {"calibrated f: focus + f-number + blur", {focus, f_number, blur}, kCalibratedFocal_m}};
  std::ofstream csv(out + "/focus_curve.csv");
  csv << "distance_m,held_out,observed_px";
  for (const Model& model : models) csv << "," << model.name;
  csv << "\n";
  std::vector<Eigen::VectorXd> curves;
  for (const Model& model : models) {
    const Curve predict = [&](const Eigen::VectorXd& x) {
      State state;
      state.focal_length_m = model.focal_length_m;
      for (size_t k = 0; k < model.parameters.size(); ++k) {
        const double value = x[static_cast<Eigen::Index>(k)];
        const std::string& name = model.parameters[k].name;
        if (name == focus.name) state.focus_relative = value;
        if (name == f_number.name) state.f_number_factor = value;
        if (name == spherical.name) state.spherical_waves = value;
        if (name == blur.name) state.blur_px = value;
      }
      Eigen::VectorXd widths(count);
      for (Eigen::Index i = 0; i < count; ++i) {
        widths[i] = EdgeWidth(distance_m[static_cast<size_t>(i)], state);
      }
      return widths;
    };
    const CurveFit fit = FitCurve(predict, model.parameters, points);
    PrintFit(model.name, fit, model.parameters);
    curves.push_back(fit.curve);
  }
  for (Eigen::Index i = 0; i < count; ++i) {
    csv << distance_m[static_cast<size_t>(i)] << "," << points.held_out[static_cast<size_t>(i)]
        << "," << points.observed[i];
    for (const Eigen::VectorXd& values : curves) csv << "," << values[i];
    csv << "\n";
  }
  return 0;
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: %s DATA_FOLDER OUT_FOLDER\n", argv[0]);
    return 2;
  }
  return sightline::Run(argv[1], argv[2]);
}
