// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/random_effect/scatter_law.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <boost/math/special_functions/sinc.hpp>
#include <cmath>
#include <numbers>

#include "render_worker/diagnosis/expectation/texture_law.h"
#include "render_worker/diagnosis/random_effect/vibration_fit.h"

namespace sightline {

namespace {

using boost::math::sinc_pi;
using std::numbers::pi;

// Squared mean of a sinusoid of unit amplitude over an exposure, averaged over its phase.
double ShiftVariance(double frequency_hz, double exposure_s) {
  return 0.5 * std::pow(sinc_pi(pi * frequency_hz * exposure_s), 2);
}

// Mean square of the mean over an exposure of what wanders with unit variance.
double MeanSquareOfWandering(double correlation_time_s, double exposure_s) {
  const double x = exposure_s / correlation_time_s;
  return x < 1e-4 ? 1 - x / 3 : 2 * (x + std::expm1(-x)) / (x * x);
}

double BlockLength(const SetModel& model, const FrameSetup& frame) {
  return LengthOnPlate(frame, frame.roi.columns_px) / model.blocks_along_line();
}

const FrameSetup& FirstAt(const SetModel& model, int plate_position_id) {
  const std::vector<RecordedFrame>& frames = model.set().frames;
  return std::find_if(
             frames.begin(), frames.end(),
             [&](const RecordedFrame& f) { return f.plate_position_id == plate_position_id; })
      ->nominal;
}

// Of the covariance of the mean reflectance of blocks, and of what varies within them.
Eigen::MatrixXd TextureFactor(std::string_view id, const SetModel& model,
                              const std::vector<double>& parameters) {
  const int blocks = model.blocks_along_line();
  const std::vector<int>& ids = model.position_ids();
  const auto positions = static_cast<Eigen::Index>(ids.size());
  const Eigen::Index n = blocks * positions;
  Eigen::MatrixXd factor = Eigen::MatrixXd::Zero(n + positions, n + positions);
  for (size_t p = 0; p < ids.size(); ++p) {
    const FrameSetup& frame = FirstAt(model, ids[p]);
    const TextureLaw texture(id, frame, parameters);
    const double block_m = BlockLength(model, frame);
    Eigen::MatrixXd covariance(blocks, blocks);
    for (int a = 0; a < blocks; ++a) {
      for (int b = 0; b < blocks; ++b) {
        covariance(a, b) = texture.Covariance(block_m, (a - b) * block_m);
      }
      covariance(a, a) *= 1 + 1e-6;
    }
    const auto at = static_cast<Eigen::Index>(p) * blocks;
    factor.block(at, at, blocks, blocks) = covariance.llt().matrixL();
    const auto within = n + static_cast<Eigen::Index>(p);
    factor(within, within) = texture.DeviationOfVarianceAlong(block_m) / std::sqrt(blocks);
  }
  return factor;
}

// Factor of the correlation of what forgets where it was with time.
Eigen::MatrixXd Forgetting(const std::vector<double>& times_s, double correlation_time_s) {
  const auto n = static_cast<Eigen::Index>(times_s.size());
  Eigen::MatrixXd correlation(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      correlation(i, j) = std::exp(-std::abs(times_s[i] - times_s[j]) / correlation_time_s);
    }
    correlation(i, i) += 1e-9;  // recordings of one moment
  }
  return correlation.llt().matrixL();
}

}  // namespace

ScatterLaw ScatterLawOf(std::string_view id, const SetModel& model) {
  std::vector<double> lit_exposure_s, lit_time_s;
  for (const RecordedFrame& frame : model.set().frames) {
    if (frame.plate_position_id < 0) continue;
    lit_exposure_s.push_back(frame.nominal.exposure_time_s);
    lit_time_s.push_back(frame.nominal.timestamp_s);
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
  } else if (id == "unknown.power_scatter") {
    law.factor = [=](const std::vector<double>& p) -> Eigen::MatrixXd {
      return p[0] * Forgetting(lit_time_s, p[1]);
    };
  } else if (id == "unknown.exposure_scatter") {
    law.factor = [=](const std::vector<double>& p) {
      return diagonal(p[0] * (exposure_s.array() / 1e-3).pow(-p[1]).matrix());
    };
  } else if (id == "time.exposure_jitter") {
    law.factor = [=](const std::vector<double>& p) {
      return diagonal(p[0] * exposure_s.cwiseInverse());
    };
  } else if (IsTexture(id)) {
    law.amplitude = Amplitude::kReflectance;
    law.largest_shape = BlockLength(model, model.set().frames.front().nominal);
    law.factor = [&model, id](const std::vector<double>& p) { return TextureFactor(id, model, p); };
    law.within = [&model, id, n = exposure_s.size()](const std::vector<double>& p,
                                                     const Eigen::VectorXd&) {
      Eigen::VectorXd variance(n);
      Eigen::Index at = 0;
      for (const RecordedFrame& frame : model.set().frames) {
        if (frame.plate_position_id < 0) continue;
        variance[at++] =
            TextureLaw(id, frame.nominal, p).VarianceAlong(BlockLength(model, frame.nominal));
      }
      return variance;
    };
  } else if (id == "unknown.movement") {
    law.amplitude = Amplitude::kShift;
    const auto kept = [=](double correlation_time_s) -> Eigen::VectorXd {
      return exposure_s.unaryExpr(
          [=](double t) { return MeanSquareOfWandering(correlation_time_s, t); });
    };
    law.factor = [=](const std::vector<double>& p) -> Eigen::MatrixXd {
      return p[0] * kept(p[1]).cwiseSqrt().asDiagonal() * Forgetting(lit_time_s, p[1]);
    };
    law.within = [=](const std::vector<double>& p, const Eigen::VectorXd&) -> Eigen::VectorXd {
      return p[0] * p[0] * (1 - kept(p[1]).array()).matrix();
    };
  } else {
    law.amplitude = Amplitude::kShift;
    const auto variance = [=](double frequency_hz) -> Eigen::VectorXd {
      return exposure_s.unaryExpr([=](double t) { return ShiftVariance(frequency_hz, t); });
    };
    law.factor = [=](const std::vector<double>& p) {
      return diagonal(p[0] * variance(p[1]).cwiseSqrt());
    };
    law.within = [=](const std::vector<double>& p, const Eigen::VectorXd& shift_px) {
      Eigen::VectorXd of_movement(exposure_s.size());
      for (Eigen::Index i = 0; i < of_movement.size(); ++i) {
        of_movement[i] = BlurByVibration(p[0], p[1], exposure_s[i], shift_px[i]);
      }
      return of_movement;
    };
  }
  return law;
}

}  // namespace sightline
