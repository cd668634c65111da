// SPDX-License-Identifier: Apache-2.0
#include "core/catalogue/combination.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

// Image circle and sensor format as data sheets round them.
constexpr double kImageCircleTolerance = 0.01;

double ImageDistance(const Lens& lens, double z_m) {
  assert(z_m > lens.focal_length_m);
  return lens.focal_length_m * z_m / (z_m - lens.focal_length_m);
}

// Four digits distinguish two devices; data sheets are not more precise.
std::string Millimetres(double metres) {
  const double mm = 1e3 * metres;
  if (!std::isfinite(mm) || mm == 0) return absl::StrCat(mm, " mm");
  const double step = std::pow(10.0, std::floor(std::log10(std::abs(mm))) - 3);
  return absl::StrCat(std::round(mm / step) * step, " mm");
}

std::string MountReason(const DeviceCamera& camera, const DeviceLens& lens) {
  return absl::StrCat("a lens with ", lens.mount, " mount does not fit a camera with ",
                      camera.mount, " mount");
}

// Reasons that need the image: the lens focuses at z.
void AddUnmetRequirements(const DeviceCamera& camera, const DeviceLens& lens,
                          const DeviceLaser& laser, double z_m, const FitRequirements& required,
                          std::vector<std::string>* reasons) {
  const Sensor& sensor = camera.sensor;
  const std::string at = absl::StrCat(" at ", Millimetres(z_m));
  if (required.max_pixel_footprint_m) {
    const double footprint_m = PixelFootprint(sensor, lens.lens, z_m);
    if (footprint_m > *required.max_pixel_footprint_m) {
      reasons->push_back(absl::StrCat("a pixel sees ", Millimetres(footprint_m), at, ", at most ",
                                      Millimetres(*required.max_pixel_footprint_m), " is asked"));
    }
  }
  if (required.min_field_of_view_m) {
    const double width_m = FieldOfViewAt(sensor, lens.lens, z_m).width_m;
    if (width_m < *required.min_field_of_view_m) {
      reasons->push_back(absl::StrCat("the camera sees ", Millimetres(width_m),
                                      " along the laser line", at, ", at least ",
                                      Millimetres(*required.min_field_of_view_m), " is asked"));
    }
    const double length_m = LineLength(laser.laser, z_m);
    if (length_m < *required.min_field_of_view_m) {
      reasons->push_back(absl::StrCat("the laser line is ", Millimetres(length_m), " long", at,
                                      ", at least ", Millimetres(*required.min_field_of_view_m),
                                      " is asked"));
    }
  }
  if (required.min_depth_of_field_m) {
    const double depth_m =
        DepthOfFieldAt(lens.lens, z_m, lens.max_f_number, sensor.pixel_pitch_m).depth_m();
    if (depth_m < *required.min_depth_of_field_m) {
      reasons->push_back(absl::StrCat("depth of field is ", Millimetres(depth_m), at,
                                      " even at its smallest aperture, f/", lens.max_f_number,
                                      ", at least ", Millimetres(*required.min_depth_of_field_m),
                                      " is asked"));
    }
  }
}

}  // namespace

double PixelFootprint(const Sensor& sensor, const Lens& lens, double z_m) {
  return sensor.pixel_pitch_m * z_m / ImageDistance(lens, z_m);
}

FieldOfView FieldOfViewAt(const Sensor& sensor, const Lens& lens, double z_m) {
  const double footprint_m = PixelFootprint(sensor, lens, z_m);
  return {footprint_m * sensor.columns_px, footprint_m * sensor.rows_px};
}

DepthOfField DepthOfFieldAt(const Lens& lens, double z_m, double f_number, double circle_m) {
  assert(f_number > 0 && circle_m > 0);
  const double pupil_m = lens.focal_length_m / f_number;
  const double shift_per_m = circle_m / (pupil_m * ImageDistance(lens, z_m));
  const double far_per_m = 1 / z_m - shift_per_m;
  return {1 / (1 / z_m + shift_per_m),
          far_per_m > 0 ? 1 / far_per_m : std::numeric_limits<double>::infinity()};
}

double SensorDiagonal(const Sensor& sensor) {
  return sensor.pixel_pitch_m *
         std::hypot(static_cast<double>(sensor.columns_px), static_cast<double>(sensor.rows_px));
}

bool ImageCircleHolds(const DeviceLens& lens, const Sensor& sensor) {
  return !lens.image_circle_m ||
         SensorDiagonal(sensor) <= (1 + kImageCircleTolerance) * *lens.image_circle_m;
}

MountFit FitOfMounts(const std::string& lens_mount, const std::string& camera_mount) {
  if (lens_mount == camera_mount) return MountFit::kFits;
  return lens_mount == "C" && camera_mount == "CS" ? MountFit::kFitsWithRing
                                                   : MountFit::kDoesNotFit;
}

bool FocusesAt(const DeviceLens& lens, double z_m) {
  return z_m > lens.lens.focal_length_m && z_m >= lens.min_focus_distance_m.value_or(0);
}

double LineLength(const Laser& laser, double z_m) {
  return 2 * z_m * std::tan(0.5 * laser.fan_angle_rad);
}

std::vector<std::string> WhyUnfit(const DeviceCamera& camera, const DeviceLens& lens,
                                  const DeviceLaser& laser, double z_m,
                                  const FitRequirements& required) {
  assert(z_m > 0);
  const Sensor& sensor = camera.sensor;
  std::vector<std::string> reasons;
  if (FitOfMounts(lens.mount, camera.mount) == MountFit::kDoesNotFit) {
    reasons.push_back(MountReason(camera, lens));
  }
  if (!ImageCircleHolds(lens, sensor)) {
    reasons.push_back(absl::StrCat("the image circle of the lens is ",
                                   Millimetres(*lens.image_circle_m), ", the sensor's diagonal ",
                                   Millimetres(SensorDiagonal(sensor))));
  }
  // The best of the channels: a Bayer sensor detects the line in one of them.
  double efficiency = 0;
  for (int channel = 0; channel < sensor.channels(); ++channel) {
    efficiency =
        std::max(efficiency, sensor.quantum_efficiency[channel].At(laser.laser.wavelength_m));
  }
  if (!(efficiency > 0)) {
    reasons.push_back(absl::StrCat("the camera does not see the laser's ",
                                   1e9 * laser.laser.wavelength_m, " nm"));
  }
  if (FocusesAt(lens, z_m)) {
    AddUnmetRequirements(camera, lens, laser, z_m, required, &reasons);
  } else {
    const double nearest_m =
        std::max(lens.min_focus_distance_m.value_or(0), lens.lens.focal_length_m);
    reasons.push_back(absl::StrCat("the lens focuses no nearer than ", Millimetres(nearest_m),
                                   ", the working distance is ", Millimetres(z_m)));
  }
  return reasons;
}

}  // namespace sightline
