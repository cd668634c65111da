#include "render_worker/diagnosis/scatter_law.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "render_worker/plate/plate_scene.h"

namespace sightline {

namespace {

constexpr double kPi = std::numbers::pi;

double Sinc(double x) { return std::abs(x) < 1e-9 ? 1 : std::sin(x) / x; }

// Squared mean of a sinusoid of unit amplitude over an exposure, averaged over its phase.
double ShiftVariance(double frequency_hz, double exposure_s) {
  return 0.5 * std::pow(Sinc(kPi * frequency_hz * exposure_s), 2);
}

// Length of a block on the plate.
double BlockLength(const SetModel& model, const FrameSetup& frame) {
  const double magnification = frame.ImageDistance() / frame.plate.camera_distance_m;
  return frame.roi.columns_px * frame.sensor.pixel_pitch_m /
         (model.blocks_along_line() * magnification);
}

// Covariance of the mean reflectance of blocks, exp(-r^2/l^2) averaged along the blocks and over
// the width of the line.
Eigen::MatrixXd TextureFactor(const SetModel& model, const std::vector<double>& parameters) {
  const double rms = parameters[0], length_m = parameters[1];
  const int blocks = model.blocks_along_line();
  const RecordedSet& set = model.set();
  const std::vector<int>& ids = model.position_ids();
  const Eigen::Index n = blocks * static_cast<Eigen::Index>(ids.size());
  Eigen::MatrixXd factor = Eigen::MatrixXd::Zero(n, n);
  // Integral of erf, for the mean over two intervals.
  const auto twice = [&](double x) {
    const double t = x / length_m;
    return 0.5 * length_m * length_m * (std::sqrt(kPi) * t * std::erf(t) + std::exp(-t * t));
  };
  for (size_t p = 0; p < ids.size(); ++p) {
    const auto of_position = [&](const RecordedFrame& f) { return f.plate_position_id == ids[p]; };
    const FrameSetup& frame =
        std::find_if(set.frames.begin(), set.frames.end(), of_position)->nominal;
    const double block_m = BlockLength(model, frame);
    const double deviation_m = BeamRadius(frame.laser, frame.plate.laser_distance_m) /
                               (2 * std::cos(frame.plate.incidence_angle_rad));
    const double across = 1 / std::sqrt(1 + 4 * std::pow(deviation_m / length_m, 2));
    Eigen::MatrixXd covariance(blocks, blocks);
    for (int a = 0; a < blocks; ++a) {
      for (int b = 0; b < blocks; ++b) {
        const double d = (a - b) * block_m;
        covariance(a, b) = rms * rms * across *
                           (twice(d + block_m) - 2 * twice(d) + twice(d - block_m)) /
                           (block_m * block_m);
      }
      covariance(a, a) *= 1 + 1e-6;
    }
    const auto at = static_cast<Eigen::Index>(p) * blocks;
    factor.block(at, at, blocks, blocks) = covariance.llt().matrixL();
  }
  return factor;
}

}  // namespace

ScatterLaw ScatterLawOf(std::string_view id, const SetModel& model) {
  std::vector<double> lit_exposure_s;
  for (const RecordedFrame& frame : model.set().frames) {
    if (frame.plate_position_id >= 0) lit_exposure_s.push_back(frame.nominal.exposure_time_s);
  }
  const Eigen::VectorXd exposure_s = Eigen::Map<const Eigen::VectorXd>(
      lit_exposure_s.data(), static_cast<Eigen::Index>(lit_exposure_s.size()));
  const auto diagonal = [](const Eigen::VectorXd& deviation) -> Eigen::MatrixXd {
    return deviation.asDiagonal();
  };
  ScatterLaw law;
  if (id == "illumination.power_noise") {
    law.factor = [=, n = exposure_s.size()](const std::vector<double>& p) {
      return diagonal(Eigen::VectorXd::Constant(n, p[0]));
    };
  } else if (id == "time.exposure_jitter") {
    law.factor = [=](const std::vector<double>& p) {
      return diagonal(p[0] * exposure_s.cwiseInverse());
    };
  } else if (id == "surface.albedo_texture") {
    law.amplitude = Amplitude::kReflectance;
    law.largest_shape = BlockLength(model, model.set().frames.front().nominal);
    law.factor = [&model](const std::vector<double>& p) { return TextureFactor(model, p); };
  } else {
    law.amplitude = Amplitude::kShift;
    const auto variance = [=](double frequency_hz) -> Eigen::VectorXd {
      return exposure_s.unaryExpr([=](double t) { return ShiftVariance(frequency_hz, t); });
    };
    law.factor = [=](const std::vector<double>& p) {
      return diagonal(p[0] * variance(p[1]).cwiseSqrt());
    };
    law.mean_blur = [=](const std::vector<double>& p) -> Eigen::VectorXd {
      return p[0] * p[0] * (0.5 - variance(p[1]).array());
    };
  }
  return law;
}

}  // namespace sightline
