// SPDX-License-Identifier: Apache-2.0
#include "render_worker/image_chain/form_image.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "core/rig/scheimpflug.h"
#include "core/status/status_macros.h"
#include "render_worker/sensor/expose.h"

namespace sightline {
namespace {

// Curvature of the wavefront of the plate's nearest and farthest places within the region, the
// larger in magnitude.
double LargestPlateCurvature(const PlateScene& scene, const FrameSetup& frame,
                             const OpticsModel& optics) {
  constexpr int kPlaces = 9;  // plates bend slowly
  const double distance = frame.plate.camera_distance_m;
  const double b = optics.image_distance_m;
  const double p = frame.sensor.pixel_pitch_m;
  double largest = 0;
  for (int i = 0; i < kPlaces; ++i) {
    for (int j = 0; j < kPlaces; ++j) {
      const double u = (frame.roi.column_px + frame.roi.columns_px * j / (kPlaces - 1.0)) * p;
      const double v = (frame.roi.row_px + frame.roi.rows_px * i / (kPlaces - 1.0)) * p;
      const double height = scene.height_m ? scene.height_m(u * distance / b, v * distance / b) : 0;
      largest = std::max(largest, std::abs(optics.curvature(distance - height, u, v)));
    }
  }
  return largest;
}

// Distance of the region's farthest pixel from the principal point.
double FieldRadius(const RegionOfInterest& roi, double pixel_pitch_m) {
  const int u = std::max(std::abs(roi.column_px), std::abs(roi.column_px + roi.columns_px));
  const int v = std::max(std::abs(roi.row_px), std::abs(roi.row_px + roi.rows_px));
  return std::hypot(u, v) * pixel_pitch_m;
}

// Outermost place of the pupil over the region, as it sets the band of the field.
double LargestPupilRadius(const OpticsModel& optics, const FrameSetup& frame) {
  double largest = optics.pupil(0, 0).OuterRadius();
  if (!optics.field_dependent) return largest;
  const double p = frame.sensor.pixel_pitch_m;
  for (const int i : {0, frame.roi.rows_px}) {
    for (const int j : {0, frame.roi.columns_px}) {
      const Pupil pupil = optics.pupil((frame.roi.column_px + j) * p, (frame.roi.row_px + i) * p);
      largest = std::max(largest, pupil.OuterRadius());
    }
  }
  return largest;
}

IdealImage NoLight(const FrameSetup& frame) {
  IdealImage image;
  image.grid = {frame.roi, 2, 0, frame.sensor.pixel_pitch_m};
  image.constant_depth_m = frame.plate.camera_distance_m;
  return image;
}

}  // namespace

FrameSetup ApplyFrameEffects(FrameSetup frame, std::span<const ActiveEffect> effects) {
  for (const ActiveEffect& active : effects) active.effect->OnFrame(frame, active.parameters);
  return frame;
}

OpticsModel MakeOpticsModel(const FrameSetup& frame, std::span<const ActiveEffect> effects) {
  OpticsModel optics;
  const double focal_length = frame.lens.focal_length_m;
  const double image_distance = frame.ImageDistance();
  Pupil pupil = MakePupil(frame.lens);
  optics.reference_pupil_radius_m = pupil.radius_m;
  optics.pupil = [pupil = std::move(pupil)](double, double) { return pupil; };
  optics.curvature = [focal_length, image_distance](double depth_m, double, double) {
    return DefocusCurvature(focal_length, depth_m, image_distance);
  };
  const SensorPlane sensor{image_distance, std::tan(frame.lens.sensor_tilt_y_rad),
                           std::tan(frame.lens.sensor_tilt_x_rad)};
  if (sensor.slope_u != 0 || sensor.slope_v != 0) {
    optics.curvature_varies = true;
    optics.curvature = [=](double depth_m, double u_m, double v_m) {
      return DefocusCurvature(focal_length, depth_m, 1 / SensorVergence(sensor, u_m, v_m));
    };
  }
  optics.image_distance_m = image_distance;
  optics.wavelength_m = frame.laser.wavelength_m;
  for (const ActiveEffect& active : effects) {
    active.effect->OnOptics(optics, frame, active.parameters);
  }
  return optics;
}

SubPixelGrid MakeSubPixelGrid(const FrameSetup& frame, const OpticsModel& optics,
                              double largest_curvature_per_m, double lost_energy) {
  const double p = frame.sensor.pixel_pitch_m;
  const int needed = RequiredSubPixels(2 * LargestPupilRadius(optics, frame), optics.wavelength_m,
                                       optics.image_distance_m, p);
  const int margin =
      RequiredMargin(optics, largest_curvature_per_m, p, FieldRadius(frame.roi, p), lost_energy);
  return {frame.roi, std::max(needed, frame.sub_pixels), margin, p};
}

absl::StatusOr<PixelIrradiance> FormLight(const IdealImage& image, const FrameSetup& frame,
                                          std::span<const ActiveEffect> effects,
                                          const SpeckleModel& speckle, int threads) {
  const OpticsModel optics = MakeOpticsModel(frame, effects);
  SpeckleModel pattern = speckle;
  for (const ActiveEffect& active : effects) {
    active.effect->OnSpeckle(pattern, frame, active.parameters);
  }
  if (!image.laser_irradiance_w_m2.empty()) {
    const int needed = RequiredSubPixels(2 * LargestPupilRadius(optics, frame), optics.wavelength_m,
                                         optics.image_distance_m, image.grid.pixel_pitch_m);
    if (image.grid.sub_pixels < needed) {
      return absl::InvalidArgumentError(absl::StrCat(
          "sub_pixels: ", image.grid.sub_pixels, " per pixel are too few for the pupil of ",
          2e3 * LargestPupilRadius(optics, frame), " mm; at least ", needed, " are needed"));
    }
  }
  PixelIrradiance light = ApplyOptics(image, optics, pattern, threads);
  for (const ActiveEffect& active : effects) {
    active.effect->OnPixelIrradiance(light, frame, active.parameters);
  }
  return light;
}

ReadOutImage ReadOut(const PixelIrradiance& light, const FrameSetup& frame,
                     std::span<const ActiveEffect> effects,
                     const Image<double>* previous_mean_electrons) {
  ReadOutImage image;
  image.mean_photo_electrons = MeanPhotoElectrons(light, frame);
  for (const ActiveEffect& active : effects) {
    active.effect->OnMeanElectrons(image.mean_photo_electrons, previous_mean_electrons, frame,
                                   active.parameters);
  }
  Image<double> electrons = CollectElectrons(image.mean_photo_electrons, frame);
  for (const ActiveEffect& active : effects) {
    active.effect->OnElectrons(electrons, frame, active.parameters);
  }
  image.raw_dn = Digitise(electrons, frame.sensor);
  for (const ActiveEffect& active : effects) {
    active.effect->OnRaw(image.raw_dn, frame, active.parameters);
  }
  return image;
}

absl::StatusOr<FormedImage> FormImage(IdealImage image, const FrameSetup& frame,
                                      std::span<const ActiveEffect> effects,
                                      const SpeckleModel& speckle,
                                      const Image<double>* previous_mean_electrons, int threads) {
  for (const ActiveEffect& active : effects) {
    active.effect->OnIdealImage(image, frame, active.parameters);
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto light, FormLight(image, frame, effects, speckle, threads));
  image = {};
  ReadOutImage read_out = ReadOut(light, frame, effects, previous_mean_electrons);
  return FormedImage{std::move(read_out.raw_dn), std::move(light),
                     std::move(read_out.mean_photo_electrons)};
}

absl::StatusOr<FormedImage> RenderPlateFrame(
    const FrameSetup& nominal, std::span<const ActiveEffect> effects,
    const Image<double>* previous_mean_electrons, int threads,
    const std::function<PlateScene(const FrameSetup&)>& make_scene) {
  const FrameSetup frame = ApplyFrameEffects(nominal, effects);
  SpeckleModel speckle;
  speckle.seed = frame.seeds.speckle;
  speckle.pattern_weights = frame.speckle_pattern_weights;
  speckle.on = frame.speckle;
  IdealImage image = NoLight(frame);
  if (frame.shutter_open) {
    PlateScene scene = make_scene(frame);
    for (const ActiveEffect& active : effects) {
      active.effect->OnPlate(scene, frame, active.parameters);
    }
    if (!frame.laser_on) scene.laser_irradiance_w_m2 = [](double, double) { return 0.0; };
    const OpticsModel optics = MakeOpticsModel(frame, effects);
    image = RenderPlate(
        scene, frame, MakeSubPixelGrid(frame, optics, LargestPlateCurvature(scene, frame, optics)),
        threads);
  }
  return FormImage(std::move(image), frame, effects, speckle, previous_mean_electrons, threads);
}

}  // namespace sightline
