#include "render_worker/diagnosis/texture_law.h"

#include <cmath>
#include <numbers>

#include "render_worker/plate/plate_scene.h"

namespace sightline {

namespace {

// Variance averaged over the width of the line.
double VarianceOfPoint(const FrameSetup& frame, const std::vector<double>& parameters) {
  const double rms = parameters[0], correlation_m = parameters[1];
  const double deviation_m = BeamRadius(frame.laser, frame.plate.laser_distance_m) /
                             (2 * std::cos(frame.plate.incidence_angle_rad));
  return rms * rms / std::sqrt(1 + 4 * std::pow(deviation_m / correlation_m, 2));
}

}  // namespace

double LengthOnPlate(const FrameSetup& frame, int columns_px) {
  const double magnification = frame.ImageDistance() / frame.plate.camera_distance_m;
  return columns_px * frame.sensor.pixel_pitch_m / magnification;
}

double TextureCovariance(const FrameSetup& frame, const std::vector<double>& parameters,
                         double length_m, double distance_m) {
  const double correlation_m = parameters[1];
  // The correlation, integrated twice.
  const auto twice = [&](double x) {
    const double t = x / correlation_m;
    return 0.5 * correlation_m * correlation_m *
           (std::sqrt(std::numbers::pi) * t * std::erf(t) + std::exp(-t * t));
  };
  return VarianceOfPoint(frame, parameters) *
         (twice(distance_m + length_m) - 2 * twice(distance_m) + twice(distance_m - length_m)) /
         (length_m * length_m);
}

double TextureVarianceAlong(const FrameSetup& frame, const std::vector<double>& parameters,
                            double length_m) {
  return VarianceOfPoint(frame, parameters) - TextureCovariance(frame, parameters, length_m, 0);
}

}  // namespace sightline
