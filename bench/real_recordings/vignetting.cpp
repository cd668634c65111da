// SPDX-License-Identifier: Apache-2.0
// Measured fall-off of the image towards the corners (scanner-sim), against cos^4, another exponent
// and a second rim:
//   bench_vignetting DATA_FOLDER OUT_FOLDER
#include <cmath>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>

#include "bench/real_recordings/curve_fit.h"
#include "render_worker/optics/pupil.h"

namespace sightline {
namespace {

constexpr double kPixel_m = 3.45e-6;
// Image distance of the stated focus, and the principal distance of the geometric calibration.
constexpr double kStated_m = 1 / (1 / 0.051 - 1 / 0.80);
constexpr double kCalibrated_m = 14876 * kPixel_m;
constexpr double kPupilRadius_m = 0.002;

int Run(const std::string& data, const std::string& out) {
  const std::string path =
      data + "/scanner_sim/data/calibrations/camera/vignetting/inverted_softbox_profile.json";
  std::ifstream file(path);
  if (!file) {
    std::printf("skipped: no %s\n", path.c_str());
    return 0;
  }
  const auto p = nlohmann::json::parse(file).at("p").get<std::vector<double>>();
  // The authors give a polynomial of the radius, not the points; its error is not stated. Half a
  // per cent is what their picture's grain and asymmetry leave at best.
  CurveData points;
  std::vector<double> radius_px;
  for (double r = 0; r <= 4040; r += 101) radius_px.push_back(r);
  const auto count = static_cast<Eigen::Index>(radius_px.size());
  points.observed.resize(count);
  points.standard_deviation = Eigen::VectorXd::Constant(count, 0.005);
  for (Eigen::Index i = 0; i < count; ++i) {
    const double r = radius_px[static_cast<size_t>(i)];
    points.observed[i] = p[0] + p[1] * r * r + p[2] * r * r * r + p[3] * r * r * r * r;
    points.held_out.push_back(i / 4 % 2 == 1);
  }
  const CurveParameter scale{"scale", 1, 0.02, 1e-4};
  const CurveParameter exponent{"extra_exponent", 0, 2, 1e-3};
  const CurveParameter rim{"rim_over_pupil", 1.1, 0.3, 1e-3, 1.0};
  const CurveParameter shift{"rim_shift_per_tangent_m", 0.003, 0.003, 1e-6, 0.0};
  struct Model {
    const char* name;
    double image_distance_m;
    bool cos4;
    std::vector<CurveParameter> parameters;
  };
  const std::vector<Model> models = {
      {"none", kStated_m, false, {scale}},
      {"cos^4 (stated f)", kStated_m, true, {scale}},
      {"cos^4 (calibrated f)", kCalibrated_m, true, {scale}},
      {"cos^(4+n) (stated f)", kStated_m, true, {scale, exponent}},
      {"cos^(4+n) (calibrated f)", kCalibrated_m, true, {scale, exponent}},
      {"cos^4 and second rim (calibrated f)", kCalibrated_m, true, {scale, rim, shift}}};
  std::ofstream csv(out + "/vignetting.csv");
  csv << "radius_px,held_out,observed";
  std::vector<Eigen::VectorXd> curves;
  for (const Model& model : models) {
    csv << "," << model.name;
    const Curve predict = [&](const Eigen::VectorXd& x) {
      double n = 0, over = 0, per_tangent_m = 0;
      for (size_t k = 0; k < model.parameters.size(); ++k) {
        const double value = x[static_cast<Eigen::Index>(k)];
        const std::string& name = model.parameters[k].name;
        if (name == exponent.name) n = value;
        if (name == rim.name) over = value;
        if (name == shift.name) per_tangent_m = value;
      }
      Eigen::VectorXd values(count);
      for (Eigen::Index i = 0; i < count; ++i) {
        const double tangent =
            radius_px[static_cast<size_t>(i)] * kPixel_m / model.image_distance_m;
        double clear = 1;
        if (over > 0) {
          Pupil pupil;
          pupil.radius_m = kPupilRadius_m;
          pupil.clips.push_back({per_tangent_m * tangent, 0, over * kPupilRadius_m});
          clear = ClearFraction(pupil);
        }
        const double power = model.cos4 ? 4 + n : 0;
        values[i] = x[0] * clear * std::pow(1 + tangent * tangent, -0.5 * power);
      }
      return values;
    };
    const CurveFit fit = FitCurve(predict, model.parameters, points);
    PrintFit(model.name, fit, model.parameters);
    curves.push_back(fit.curve);
  }
  csv << "\n";
  for (Eigen::Index i = 0; i < count; ++i) {
    csv << radius_px[static_cast<size_t>(i)] << "," << points.held_out[static_cast<size_t>(i)]
        << "," << points.observed[i];
    for (const Eigen::VectorXd& curve : curves) csv << "," << curve[i];
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
