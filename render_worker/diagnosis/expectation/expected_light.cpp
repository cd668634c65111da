// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/expectation/expected_light.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

#include "render_worker/diagnosis/expectation/blurred_speckle.h"
#include "render_worker/diagnosis/expectation/line_spread.h"
#include "render_worker/image_chain/form_image.h"
#include "render_worker/plate/plate_scene.h"
#include "render_worker/sensor/expose.h"

namespace sightline {

namespace {

constexpr int kSamplesPerPx = 4;
constexpr int kPlacesAlongBlock = 16;
constexpr double kLitAlongLine = 1e-3;  // of the brightest, across the line
constexpr double kNoLight = 1e-9;       // of the brightest place's: all such places count as dark

// Point on the plate that a sensor position sees, and its distance from the lens.
struct PlatePoint {
  double x_m = 0, s_m = 0, distance_m = 0;
};

PlatePoint SeenAt(const PlateScene& scene, const FrameSetup& frame, double u_m, double v_m) {
  const double b = frame.ImageDistance();
  SensorPoint seen{u_m, v_m};
  if (scene.image_mapping) seen = scene.image_mapping(seen);
  double distance_m = frame.plate.camera_distance_m;
  double x = seen.u_m * distance_m / b, s = seen.v_m * distance_m / b;
  if (scene.height_m) {
    // One step suffices: heights are small against the distance.
    distance_m = frame.plate.camera_distance_m - scene.height_m(x, s);
    x = seen.u_m * distance_m / b;
    s = seen.v_m * distance_m / b;
  }
  return {x, s, distance_m};
}

// Irradiance of the sensor by a perfect lens at (u, v) over that of the plate by the laser
// (recordings format, section 3).
double Throughput(const PlateScene& scene, const FrameSetup& frame, const PlatePoint& point,
                  double u_m, double v_m) {
  const double b = frame.ImageDistance();
  const double cos2 = b * b / (b * b + u_m * u_m + v_m * v_m);
  const double aperture = frame.PupilDiameter() / b;
  return std::numbers::pi / 4 * frame.lens.transmission * aperture * aperture * cos2 * cos2 *
         scene.brdf_per_sr(point.x_m, point.s_m);
}

// Laser light on the plate summed across the line, in the column at u.
double LightAcrossLine(const PlateScene& scene, const FrameSetup& frame, double u_m,
                       double first_v_m, double last_v_m) {
  double light = 0;
  for (double v_m = first_v_m; v_m <= last_v_m; v_m += frame.sensor.pixel_pitch_m / kSamplesPerPx) {
    const PlatePoint point = SeenAt(scene, frame, u_m, v_m);
    light += scene.laser_irradiance_w_m2(point.x_m, point.s_m);
  }
  return light;
}

// Samples across the line in the middle column of the region, with room for the blur on both sides.
struct LineGrid {
  explicit LineGrid(const FrameSetup& frame)
      : first_row_px(frame.roi.row_px),
        length(static_cast<int>(
            std::bit_ceil(static_cast<unsigned>((frame.roi.rows_px + 256) * kSamplesPerPx)))),
        margin_px((length / kSamplesPerPx - frame.roi.rows_px) / 2),
        pitch_m(frame.sensor.pixel_pitch_m),
        u_m((frame.roi.column_px + 0.5 * (frame.roi.columns_px - 1)) * pitch_m) {}

  double VOf(int i) const {
    return (first_row_px - margin_px + (i + 0.5) / kSamplesPerPx - 0.5) * pitch_m;
  }
  double StepPerM() const { return kSamplesPerPx / (length * pitch_m); }  // of spatial frequency

  int first_row_px;
  int length, margin_px;
  double pitch_m, u_m;
};

// Laser light at the samples: on the plate first, then that of a perfect lens on the sensor.
struct LineLight {
  std::vector<PlatePoint> points;
  std::vector<double> irradiance_w_m2;
  double brightest_w_m2 = 0;  // on the plate
};

// `known_w_m2`: irradiance of the plate at the samples if it was computed before, or empty.
LineLight SampleLine(const PlateScene& scene, const FrameSetup& frame, const LineGrid& grid,
                     const std::vector<double>& known_w_m2) {
  LineLight light;
  light.points.resize(grid.length);
  light.irradiance_w_m2.resize(grid.length);
  for (int i = 0; i < grid.length; ++i) {
    light.points[i] = SeenAt(scene, frame, grid.u_m, grid.VOf(i));
    light.irradiance_w_m2[i] =
        known_w_m2.empty() ? scene.laser_irradiance_w_m2(light.points[i].x_m, light.points[i].s_m)
                           : known_w_m2[i];
    light.brightest_w_m2 = std::max(light.brightest_w_m2, light.irradiance_w_m2[i]);
  }
  return light;
}

// Scales the light of the middle column to the mean of its block. Returns the light of evenly
// spaced columns of the block over that mean; empty, and nothing is scaled, without light.
std::vector<double> ScaleToBlockMean(const PlateScene& scene, const FrameSetup& frame,
                                     const LineGrid& grid, int block_columns_px, LineLight& light) {
  std::vector<double>& ideal = light.irradiance_w_m2;
  const auto lit = [&](double value) { return value > kLitAlongLine * light.brightest_w_m2; };
  const auto first = std::find_if(ideal.begin(), ideal.end(), lit) - ideal.begin();
  const auto last = std::find_if(ideal.rbegin(), ideal.rend(), lit).base() - ideal.begin() - 1;
  // Room for a line that is not straight along the rows: up to 11 degrees.
  const double room_m = 0.1 * block_columns_px * grid.pitch_m;
  const double first_v_m = grid.VOf(static_cast<int>(first)) - room_m;
  const double last_v_m = grid.VOf(static_cast<int>(last)) + room_m;
  std::vector<double> level_along_line;
  double mean = 0;
  for (int i = 0; i < kPlacesAlongBlock; ++i) {
    const double place = (i + 0.5) / kPlacesAlongBlock - 0.5;
    level_along_line.push_back(LightAcrossLine(
        scene, frame, grid.u_m + place * block_columns_px * grid.pitch_m, first_v_m, last_v_m));
    mean += level_along_line.back() / kPlacesAlongBlock;
  }
  const double middle = LightAcrossLine(scene, frame, grid.u_m, first_v_m, last_v_m);
  if (!(mean > 0 && middle > 0)) return {};
  for (double& level : level_along_line) level /= mean;
  for (double& value : ideal) value *= mean / middle;
  return level_along_line;
}

// Mean distance and place of the laser light, weighted by its irradiance on the sensor.
struct LightCentre {
  double depth_m, v_m;
};

LightCentre TransferToSensor(const PlateScene& scene, const FrameSetup& frame, const LineGrid& grid,
                             LineLight& light) {
  double weighted_depth_m = 0, weighted_v_m = 0, sum = 0;
  for (int i = 0; i < grid.length; ++i) {
    double& value = light.irradiance_w_m2[i];
    if (value <= kNoLight * light.brightest_w_m2) {
      value = 0;
      continue;
    }
    const double v_m = grid.VOf(i);
    value *= Throughput(scene, frame, light.points[i], grid.u_m, v_m);
    weighted_depth_m += value * light.points[i].distance_m;
    weighted_v_m += value * v_m;
    sum += value;
  }
  if (!(sum > 0)) return {frame.plate.camera_distance_m, 0};
  return {weighted_depth_m / sum, weighted_v_m / sum};
}

// Transfer function and speckle at the centre of the light. `known`: of another column sample of
// the frame, whose speckle is taken over, or null. `ideal`: irradiance of the sensor by a perfect
// lens.
std::shared_ptr<LineImaging> MakeLineImaging(const FrameSetup& frame, const OpticsModel& optics,
                                             const LineGrid& grid, const std::vector<double>& ideal,
                                             double v_m, double curvature_per_m,
                                             const LineImaging* known) {
  auto line = std::make_shared<LineImaging>();
  line->curvature_per_m = curvature_per_m;
  line->length = grid.length;
  const Pupil pupil = optics.pupil(grid.u_m, v_m);
  line->transfer = LineTransfer(pupil, optics.wavelength_m, optics.image_distance_m,
                                curvature_per_m, grid.StepPerM(), grid.length / 2 + 1);
  const double clear = ClearFraction(pupil);
  const std::vector<std::complex<double>> pixel =
      PixelTransfer(kSamplesPerPx, grid.length, grid.pitch_m);
  for (size_t k = 0; k < line->transfer.size(); ++k) line->transfer[k] *= clear * pixel[k];
  const auto image = [&] {
    return BlurAcrossLine(ideal, kSamplesPerPx, grid.margin_px, frame.roi.rows_px, line->transfer);
  };
  std::vector<double> before;
  if (known == nullptr && !optics.transfer.empty()) before = image();
  for (size_t k = 0; k < line->transfer.size(); ++k) {
    for (const TransferFunction& factor : optics.transfer) {
      line->transfer[k] *= factor(0, static_cast<double>(k) * grid.StepPerM());
    }
  }
  if (known != nullptr) {
    line->speckle = known->speckle;
    return line;
  }
  LineSpeckle speckle(
      pupil, optics.wavelength_m, optics.image_distance_m,
      optics.image_distance_m * curvature_per_m, grid.pitch_m, ideal,
      (grid.first_row_px - grid.margin_px + 0.5 / kSamplesPerPx - 0.5) * grid.pitch_m,
      grid.pitch_m / kSamplesPerPx);
  if (!before.empty()) {
    speckle = BlurredSpeckle(speckle, optics.transfer, grid.pitch_m,
                             grid.first_row_px * grid.pitch_m, before, image());
  }
  line->speckle = std::make_shared<LineSpeckle>(std::move(speckle));
  return line;
}

// Mean irradiance of every pixel by the laser, the same in all columns. Replaces `imaging` unless
// it holds for this light; with `block_columns_px` the irradiance is the mean of the block, and
// `level_along_line` is filled in.
Image<float> ImageLine(const PlateScene& scene, const FrameSetup& frame, const OpticsModel& optics,
                       int block_columns_px, std::shared_ptr<const LineImaging>& imaging,
                       std::vector<double>& level_along_line) {
  const RegionOfInterest& roi = frame.roi;
  const LineGrid grid(frame);
  const bool alike = scene.constant_along_line && !scene.height_m && !scene.image_mapping;
  const bool known = alike && imaging != nullptr &&
                     imaging->irradiance_w_m2.size() == static_cast<size_t>(grid.length);
  LineLight light =
      SampleLine(scene, frame, grid, known ? imaging->irradiance_w_m2 : std::vector<double>());
  const std::vector<double> on_plate = alike ? light.irradiance_w_m2 : std::vector<double>();
  if (!scene.constant_along_line && block_columns_px > 0 && light.brightest_w_m2 > 0) {
    level_along_line = ScaleToBlockMean(scene, frame, grid, block_columns_px, light);
  }
  const LightCentre centre = TransferToSensor(scene, frame, grid, light);
  const double curvature = optics.curvature(centre.depth_m, grid.u_m, centre.v_m);
  const bool same = imaging != nullptr && !optics.field_dependent &&
                    imaging->length == grid.length &&
                    std::abs(imaging->curvature_per_m - curvature) <= 1e-9 * std::abs(curvature);
  if (!same) {
    const std::shared_ptr<LineImaging> line = MakeLineImaging(
        frame, optics, grid, light.irradiance_w_m2, centre.v_m, curvature, imaging.get());
    line->irradiance_w_m2 = on_plate;
    imaging = line;
  }
  const std::vector<double> profile = BlurAcrossLine(
      light.irradiance_w_m2, kSamplesPerPx, grid.margin_px, roi.rows_px, imaging->transfer);
  Image<float> image(roi.columns_px, roi.rows_px);
  for (int row = 0; row < roi.rows_px; ++row) {
    for (int column = 0; column < roi.columns_px; ++column) {
      image.At(row, column) = static_cast<float>(std::max(0.0, profile[row]));
    }
  }
  return image;
}

// Blurs light across the line by the lens in focus (defocus is in the light already). Light that is
// even within 1e-4, as that of lamps, stays as it is.
void BlurAcross(const OpticsModel& optics, const Pupil& pupil, double wavelength_m,
                double pixel_pitch_m, Image<float>& flux) {
  constexpr int kLeastMargin_px = 64;
  constexpr float kEven = 1e-4F;
  const auto [least, most] = std::minmax_element(flux.values.begin(), flux.values.end());
  if (*most - *least <= kEven * *most) return;
  const int length =
      static_cast<int>(std::bit_ceil(static_cast<unsigned>(flux.rows_px + 2 * kLeastMargin_px)));
  const int margin_px = (length - flux.rows_px) / 2;
  const double step_per_m = 1 / (length * pixel_pitch_m);
  std::vector<std::complex<double>> transfer =
      LineTransfer(pupil, wavelength_m, optics.image_distance_m, 0, step_per_m, length / 2 + 1);
  for (size_t k = 0; k < transfer.size(); ++k) {
    for (const TransferFunction& factor : optics.transfer) {
      transfer[k] *= factor(0, static_cast<double>(k) * step_per_m);
    }
  }
  std::vector<double> column(length);
  for (int c = 0; c < flux.columns_px; ++c) {
    for (int i = 0; i < length; ++i) {
      column[i] = flux.At(std::clamp(i - margin_px, 0, flux.rows_px - 1), c);
    }
    const std::vector<double> blurred =
        BlurAcrossLine(column, 1, margin_px, flux.rows_px, transfer);
    for (int row = 0; row < flux.rows_px; ++row) {
      flux.At(row, c) = static_cast<float>(std::max(0.0, blurred[row]));
    }
  }
}

// Adds the light of the plate that is not the laser's, which has no speckle.
void AddAmbient(const PlateScene& scene, const FrameSetup& frame, const OpticsModel& optics,
                PixelIrradiance& light) {
  PlateScene lamps = scene;
  lamps.laser_irradiance_w_m2 = [](double, double) { return 0.0; };
  const double pitch_m = frame.sensor.pixel_pitch_m;
  const IdealImage image = RenderPlate(lamps, frame, {frame.roi, 1, 0, pitch_m});
  const int margin = image.incoherent_grid.margin_px;
  const Pupil pupil =
      optics.pupil((frame.roi.column_px + 0.5 * (frame.roi.columns_px - 1)) * pitch_m,
                   (frame.roi.row_px + 0.5 * (frame.roi.rows_px - 1)) * pitch_m);
  for (int channel = 0; channel < frame.sensor.channels(); ++channel) {
    const Image<float>& wide = image.incoherent_electron_flux_m2_s[channel];
    Image<float>& flux = light.incoherent_electron_flux_m2_s[channel];
    flux = Image<float>(frame.roi.columns_px, frame.roi.rows_px);
    for (int row = 0; row < flux.rows_px; ++row) {
      for (int column = 0; column < flux.columns_px; ++column) {
        flux.At(row, column) = wide.At(row + margin, column + margin);
      }
    }
    BlurAcross(optics, pupil, image.incoherent_wavelength_m[channel], pitch_m, flux);
  }
}

// Multiplies the light of a column sample by the mean of a pattern over the segment that the sample
// represents. Rows without laser light stay unchanged.
void MultiplyByBlockMean(const ActiveEffect& pattern, const FrameSetup& frame, int block_columns_px,
                         Image<float>& light) {
  const auto lit = [](float value) { return value > 0; };
  const auto first = std::find_if(light.values.begin(), light.values.end(), lit);
  if (first == light.values.end()) return;
  const auto last = std::find_if(light.values.rbegin(), light.values.rend(), lit).base();
  const auto first_row = static_cast<int>((first - light.values.begin()) / light.columns_px);
  const auto rows =
      static_cast<int>((last - light.values.begin() - 1) / light.columns_px) + 1 - first_row;
  PixelIrradiance block;
  block.roi = {frame.roi.column_px + (frame.roi.columns_px - block_columns_px) / 2,
               frame.roi.row_px + first_row, block_columns_px, rows};
  block.laser_irradiance_w_m2 = Image<float>(block_columns_px, rows, 1.0F);
  pattern.effect->OnPixelIrradiance(block, frame, pattern.parameters);
  for (int row = 0; row < rows; ++row) {
    const float* factors = block.laser_irradiance_w_m2.Row(row);
    const float mean = std::accumulate(factors, factors + block_columns_px, 0.0F) /
                       static_cast<float>(block_columns_px);
    for (int column = 0; column < light.columns_px; ++column) {
      light.At(first_row + row, column) *= mean;
    }
  }
}

}  // namespace

ExpectedLight ExpectLight(const FrameSetup& frame, std::span<const ActiveEffect> effects,
                          std::shared_ptr<const LineImaging> imaging, int block_columns_px) {
  ExpectedLight expected;
  expected.imaging = std::move(imaging);
  const OpticsModel optics = MakeOpticsModel(frame, effects);
  PlateScene scene = MakePlateScene(frame);
  SpeckleModel speckle;
  speckle.pattern_weights = frame.speckle_pattern_weights;
  for (const ActiveEffect& active : effects) {
    active.effect->OnPlate(scene, frame, active.parameters);
    active.effect->OnSpeckle(speckle, frame, active.parameters);
  }
  for (double weight : speckle.pattern_weights) expected.pattern_share += weight * weight;

  PixelIrradiance light;
  light.roi = frame.roi;
  if (frame.shutter_open && scene.ambient_radiance_w_m2_sr) AddAmbient(scene, frame, optics, light);
  light.laser_irradiance_w_m2 = Image<float>(frame.roi.columns_px, frame.roi.rows_px, 0.0F);
  if (frame.laser_on && frame.shutter_open) {
    light.laser_irradiance_w_m2 = ImageLine(scene, frame, optics, block_columns_px,
                                            expected.imaging, expected.level_along_line);
  }
  for (const ActiveEffect& active : effects) {
    if (active.effect->description().finer_than_block && block_columns_px > 0) {
      MultiplyByBlockMean(active, frame, block_columns_px, light.laser_irradiance_w_m2);
    } else {
      active.effect->OnPixelIrradiance(light, frame, active.parameters);
    }
  }
  expected.total_electrons = MeanPhotoElectrons(light, frame);
  std::fill(light.laser_irradiance_w_m2.values.begin(), light.laser_irradiance_w_m2.values.end(),
            0.0F);
  expected.steady_electrons = MeanPhotoElectrons(light, frame);
  return expected;
}

}  // namespace sightline
