// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/speckle/speckle_decorrelation.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "render_worker/image_chain/form_image.h"

namespace sightline {

namespace {

// Random movements are averaged over this many realisations. Chosen: the result's error is a third.
constexpr int kMovementDraws = 8;
// Frequency at which the phase of a transfer function gives the shift [1/px]. Chosen: low enough
// that phases of some hundred pixels do not wrap.
constexpr double kTurnsPerPx = 1e-3;
// Least relative covariance of neighbouring pixels, which keeps the logarithm finite.
constexpr double kLeastCovariance = 1e-9;

// Position of the speckle at one of the equally weighted moments of an exposure [px].
struct SpecklePosition {
  double u_px = 0, v_px = 0;
};

// Positions by moving scatterers. They do not depend on the random seed.
std::vector<SpecklePosition> ScattererPositions(const FrameSetup& frame,
                                                std::span<const ActiveEffect> effects) {
  SpeckleModel speckle;
  for (const ActiveEffect& active : effects) {
    active.effect->OnSpeckle(speckle, frame, active.parameters);
  }
  std::vector<SpecklePosition> positions;
  for (const SpeckleModel::Shift& shift : speckle.shifts) {
    positions.push_back(
        {shift.u_m / frame.sensor.pixel_pitch_m, shift.v_m / frame.sensor.pixel_pitch_m});
  }
  return positions;
}

// Mean shift of the image across the line during the exposure [px], from the phase of the transfer
// functions at a low frequency. `draw` seeds the random movements of a recording.
double ImageShift(FrameSetup frame, std::span<const ActiveEffect> effects, uint64_t draw) {
  frame.seeds.noise += draw;
  const OpticsModel optics = MakeOpticsModel(frame, effects);
  double phase = 0;
  for (const TransferFunction& factor : optics.transfer) {
    phase += std::arg(std::complex<double>(factor(0, kTurnsPerPx / frame.sensor.pixel_pitch_m)));
  }
  return -phase / (2 * std::numbers::pi * kTurnsPerPx);
}

}  // namespace

double SpeckleDecorrelation(const ExpectedFrame& a, const ExpectedFrame& b,
                            std::span<const ActiveEffect> effects) {
  if (effects.empty() || a.speckle == nullptr) return 0;
  const SpecklePixelCovariance& speckle = a.speckle->At(a.speckle->places() / 2);
  // The correlation over a shift is a Gaussian through the neighbouring pixel, which is a parabola
  // at its maximum like the covariance.
  const double along = std::log(speckle.At(0, 0) / std::max(kLeastCovariance, speckle.At(0, 1)));
  const double across = std::log(speckle.At(0, 0) / std::max(kLeastCovariance, speckle.At(1, 0)));
  using Positions = std::vector<SpecklePosition>;
  const auto mean = [&](const Positions& p, const Positions& q, double shift) {
    double sum = 0;
    for (const SpecklePosition& s : p) {
      for (const SpecklePosition& t : q) {
        sum += std::exp(-along * std::pow(s.u_px - t.u_px, 2) -
                        across * std::pow(s.v_px - t.v_px + shift, 2));
      }
    }
    return sum / static_cast<double>(p.size() * q.size());
  };
  const Positions p = ScattererPositions(a.frame, effects);
  const Positions q = ScattererPositions(b.frame, effects);
  double common = 0;
  for (int draw = 0; draw < kMovementDraws; ++draw) {
    const double shift = ImageShift(a.frame, effects, draw) - ImageShift(b.frame, effects, draw);
    common += mean(p, q, shift) / kMovementDraws;
    if (draw == 0 && shift == 0) {
      common = mean(p, q, 0);
      break;
    }
  }
  return std::max(0.0, 0.5 * (mean(p, p, 0) + mean(q, q, 0)) - common);
}

}  // namespace sightline
