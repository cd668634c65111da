#include "render_worker/diagnosis/expected_frame.h"

#include <algorithm>
#include <array>
#include <bit>
#include <boost/math/special_functions/erf.hpp>
#include <cmath>
#include <numbers>
#include <numeric>
#include <optional>
#include <set>
#include <string_view>

#include "render_worker/diagnosis/blurred_speckle.h"
#include "render_worker/diagnosis/charge_spread.h"
#include "render_worker/diagnosis/integrated_speckle.h"
#include "render_worker/diagnosis/line_spread.h"
#include "render_worker/diagnosis/texture_law.h"
#include "render_worker/image_chain/form_image.h"
#include "render_worker/plate/plate_scene.h"
#include "render_worker/sensor/expose.h"

namespace sightline {

namespace {

constexpr int kSamplesPerPx = 4;
constexpr double kLeastContrast = 1e-6;  // squared
constexpr int kPlacesAlongBlock = 16;
constexpr double kLitAlongLine = 1e-3;  // of the brightest, across the line
constexpr double kNoLight = 1e-9;       // of the brightest place's: all such places count as dark
constexpr double kLinear = 0.03;        // of the noise: levels that differ by less do so linearly

// Standard normal distribution and density.
double Distribution(double x) { return 0.5 * std::erfc(-x / std::numbers::sqrt2); }
double Density(double x) { return std::exp(-0.5 * x * x) / std::sqrt(2 * std::numbers::pi); }

// Mean of min(max(X, 0), top) for X normal, whose variance grows by `gain` with its mean (shot
// noise), and its slope with the mean.
struct Clipped {
  double mean = 0, slope = 1;
};

Clipped MeanClipped(double mean, double deviation, double top, double gain) {
  const double low = -mean / deviation, high = (top - mean) / deviation;
  if (low < -6 && high > 6) return {mean, 1};
  if (high < -6) return {top, 0};
  if (low > 6) return {0, 0};
  const double growth = gain / (2 * deviation);  // of the deviation with the mean
  // Mostly one end is far away.
  if (high > 6) {
    const double above = Distribution(-low), density = Density(low);
    return {mean * above + deviation * density, above + growth * density};
  }
  if (low < -6) {
    const double below = Distribution(high), density = Density(high);
    return {mean * below - deviation * density + top * (1 - below), below - growth * density};
  }
  const double inside = Distribution(high) - Distribution(low);
  const double densities = Density(low) - Density(high);
  return {mean * inside + deviation * densities + top * (1 - Distribution(high)),
          inside + growth * densities};
}

// What the converter makes of every number; empty if it leaves all as they are.
std::vector<uint16_t> ConvertedNumbers(const FrameSetup& frame,
                                       std::span<const ActiveEffect> effects) {
  Image<uint16_t> ramp(static_cast<int>(frame.sensor.largest_dn()) + 1, 1);
  std::iota(ramp.values.begin(), ramp.values.end(), uint16_t{0});
  const std::vector<uint16_t> numbers = ramp.values;
  for (const ActiveEffect& active : effects) {
    active.effect->OnRaw(ramp, frame, active.parameters);
  }
  if (ramp.values == numbers) return {};
  return ramp.values;
}

// Mean change by `converted` of a normal number of this mean and deviation, rounded: at equally
// likely values of it.
float MeanConversion(const std::vector<uint16_t>& converted, float mean, float deviation) {
  constexpr int kValues = 64;
  static const std::array<float, kValues> normal = [] {
    std::array<float, kValues> quantiles;
    for (int i = 0; i < kValues; ++i) {
      quantiles[i] =
          static_cast<float>(-std::numbers::sqrt2 * boost::math::erfc_inv(2 * (i + 0.5) / kValues));
    }
    return quantiles;
  }();
  float sum = 0;
  for (const float z : normal) {
    const auto number = static_cast<int>(std::clamp<float>(
        mean + deviation * z + 0.5F, 0.0F, static_cast<float>(converted.size() - 1)));
    sum += static_cast<float>(converted[number]) - static_cast<float>(number);
  }
  return sum / kValues;
}

// Place on the plate that is seen at (u, v), and its distance.
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

// Mean irradiance of every pixel, alike in all columns; fills in what `imaging` has not. With
// `block_columns_px` that of the block in the mean, and `level_along_line`.
Image<float> ImageLine(const PlateScene& scene, const FrameSetup& frame, const OpticsModel& optics,
                       int block_columns_px, std::shared_ptr<const LineImaging>& imaging,
                       std::vector<double>& level_along_line) {
  const RegionOfInterest& roi = frame.roi;
  const double pitch_m = frame.sensor.pixel_pitch_m;
  const int length =
      static_cast<int>(std::bit_ceil(static_cast<unsigned>((roi.rows_px + 256) * kSamplesPerPx)));
  const int margin_px = (length / kSamplesPerPx - roi.rows_px) / 2;
  const double step_per_m = kSamplesPerPx / (length * pitch_m);
  const double u_m = (roi.column_px + 0.5 * (roi.columns_px - 1)) * pitch_m;
  const auto v_of = [&](int i) {
    return (roi.row_px - margin_px + (i + 0.5) / kSamplesPerPx - 0.5) * pitch_m;
  };
  std::vector<double> ideal(length);
  std::vector<PlatePoint> points(length);
  double brightest = 0;
  const bool alike = scene.constant_along_line && !scene.height_m && !scene.image_mapping;
  const bool known =
      alike && imaging != nullptr && imaging->irradiance_w_m2.size() == static_cast<size_t>(length);
  for (int i = 0; i < length; ++i) {
    points[i] = SeenAt(scene, frame, u_m, v_of(i));
    ideal[i] = known ? imaging->irradiance_w_m2[i]
                     : scene.laser_irradiance_w_m2(points[i].x_m, points[i].s_m);
    brightest = std::max(brightest, ideal[i]);
  }
  const std::vector<double> irradiance = alike ? ideal : std::vector<double>();
  if (!scene.constant_along_line && block_columns_px > 0 && brightest > 0) {
    const auto lit = [&](double value) { return value > kLitAlongLine * brightest; };
    const auto first = std::find_if(ideal.begin(), ideal.end(), lit) - ideal.begin();
    const auto last = std::find_if(ideal.rbegin(), ideal.rend(), lit).base() - ideal.begin() - 1;
    // Room for a line that is not straight along the rows: up to 11 degrees.
    const double room_m = 0.1 * block_columns_px * pitch_m;
    const double first_v_m = v_of(static_cast<int>(first)) - room_m;
    const double last_v_m = v_of(static_cast<int>(last)) + room_m;
    double mean = 0;
    for (int i = 0; i < kPlacesAlongBlock; ++i) {
      const double place = (i + 0.5) / kPlacesAlongBlock - 0.5;
      level_along_line.push_back(LightAcrossLine(
          scene, frame, u_m + place * block_columns_px * pitch_m, first_v_m, last_v_m));
      mean += level_along_line.back() / kPlacesAlongBlock;
    }
    const double middle = LightAcrossLine(scene, frame, u_m, first_v_m, last_v_m);
    if (mean > 0 && middle > 0) {
      for (double& light : level_along_line) light /= mean;
      for (double& value : ideal) value *= mean / middle;
    } else {
      level_along_line.clear();
    }
  }
  double weighted_depth_m = 0, weighted_v_m = 0, sum = 0;
  for (int i = 0; i < length; ++i) {
    if (ideal[i] <= kNoLight * brightest) {
      ideal[i] = 0;
      continue;
    }
    const double v_m = v_of(i);
    ideal[i] *= Throughput(scene, frame, points[i], u_m, v_m);
    weighted_depth_m += ideal[i] * points[i].distance_m;
    weighted_v_m += ideal[i] * v_m;
    sum += ideal[i];
  }
  const double depth_m = sum > 0 ? weighted_depth_m / sum : frame.plate.camera_distance_m;
  const double v_m = sum > 0 ? weighted_v_m / sum : 0;
  const double curvature = optics.curvature(depth_m, u_m, v_m);
  const bool same = imaging != nullptr && !optics.field_dependent && imaging->length == length &&
                    std::abs(imaging->curvature_per_m - curvature) <= 1e-9 * std::abs(curvature);
  if (!same) {
    auto line = std::make_shared<LineImaging>();
    line->irradiance_w_m2 = irradiance;
    line->curvature_per_m = curvature;
    line->length = length;
    const Pupil pupil = optics.pupil(u_m, v_m);
    line->transfer = LineTransfer(pupil, optics.wavelength_m, optics.image_distance_m, curvature,
                                  step_per_m, length / 2 + 1);
    const double clear = ClearFraction(pupil);
    const std::vector<std::complex<double>> pixel = PixelTransfer(kSamplesPerPx, length, pitch_m);
    for (size_t k = 0; k < line->transfer.size(); ++k) line->transfer[k] *= clear * pixel[k];
    const auto image = [&] {
      return BlurAcrossLine(ideal, kSamplesPerPx, margin_px, roi.rows_px, line->transfer);
    };
    const bool new_speckle = imaging == nullptr;
    std::vector<double> before;
    if (new_speckle && !optics.transfer.empty()) before = image();
    for (size_t k = 0; k < line->transfer.size(); ++k) {
      for (const TransferFunction& factor : optics.transfer) {
        line->transfer[k] *= factor(0, static_cast<double>(k) * step_per_m);
      }
    }
    if (new_speckle) {
      LineSpeckle speckle(pupil, optics.wavelength_m, optics.image_distance_m,
                          optics.image_distance_m * curvature, pitch_m, ideal,
                          (roi.row_px - margin_px + 0.5 / kSamplesPerPx - 0.5) * pitch_m,
                          pitch_m / kSamplesPerPx);
      if (!before.empty()) {
        speckle = BlurredSpeckle(speckle, optics.transfer, pitch_m, roi.row_px * pitch_m, before,
                                 image());
      }
      line->speckle = std::make_shared<LineSpeckle>(std::move(speckle));
    } else {
      line->speckle = imaging->speckle;
    }
    imaging = std::move(line);
  }
  const std::vector<double> profile =
      BlurAcrossLine(ideal, kSamplesPerPx, margin_px, roi.rows_px, imaging->transfer);
  Image<float> image(roi.columns_px, roi.rows_px);
  for (int row = 0; row < roi.rows_px; ++row) {
    for (int column = 0; column < roi.columns_px; ++column) {
      image.At(row, column) = static_cast<float>(std::max(0.0, profile[row]));
    }
  }
  return image;
}

// Light of lamps and windows on the plate: smooth, so neither blurred nor speckled.
void AddAmbient(const PlateScene& scene, const FrameSetup& frame, PixelIrradiance& light) {
  PlateScene lamps = scene;
  lamps.laser_irradiance_w_m2 = [](double, double) { return 0.0; };
  const IdealImage image = RenderPlate(lamps, frame, {frame.roi, 1, 0, frame.sensor.pixel_pitch_m});
  const int margin = image.incoherent_grid.margin_px;
  for (int channel = 0; channel < frame.sensor.channels(); ++channel) {
    const Image<float>& wide = image.incoherent_electron_flux_m2_s[channel];
    Image<float>& flux = light.incoherent_electron_flux_m2_s[channel];
    flux = Image<float>(frame.roi.columns_px, frame.roi.rows_px);
    for (int row = 0; row < flux.rows_px; ++row) {
      for (int column = 0; column < flux.columns_px; ++column) {
        flux.At(row, column) = wide.At(row + margin, column + margin);
      }
    }
  }
}

bool IsSmear(const ActiveEffect& active) {
  return active.effect->description().id == "sensor.smear";
}

// What smear adds gathers the light of a whole column, whose speckle averages out in part.
struct SmearTrail {
  Image<double> laser, steady;  // mean electrons; empty: no smear
  int crest_row = 0;
  double contrast_kept = 0;  // of the column's sum over that of a pixel
};

SmearTrail TrailOfSmear(const Image<double>& total, const Image<double>& steady,
                        const FrameSetup& frame, std::span<const ActiveEffect> effects,
                        const LineSpeckle* speckle) {
  SmearTrail trail;
  const auto smear = std::find_if(effects.begin(), effects.end(), IsSmear);
  if (smear == effects.end() || smear->parameters[0] == 0) return trail;
  const auto added = [&](const Image<double>& electrons) {
    Image<double> after = electrons;
    smear->effect->OnMeanElectrons(after, nullptr, frame, smear->parameters);
    for (size_t i = 0; i < after.values.size(); ++i) after.values[i] -= electrons.values[i];
    return after;
  };
  trail.steady = added(steady);
  trail.laser = added(total);
  for (size_t i = 0; i < trail.laser.values.size(); ++i) {
    trail.laser.values[i] -= trail.steady.values[i];
  }
  if (speckle == nullptr) return trail;
  std::vector<double> light(total.rows_px);
  for (int row = 0; row < total.rows_px; ++row) light[row] = total.At(row, 0) - steady.At(row, 0);
  trail.crest_row = static_cast<int>(std::max_element(light.begin(), light.end()) - light.begin());
  const SpecklePixelCovariance& crest = speckle->At(
      speckle->PlaceOf((frame.roi.row_px + trail.crest_row) * frame.sensor.pixel_pitch_m));
  double sum = 0, product = 0;
  for (int a = 0; a < total.rows_px; ++a) {
    sum += light[a];
    const int last = std::min(total.rows_px - 1, a + crest.max_lag());
    for (int b = std::max(0, a - crest.max_lag()); b <= last; ++b) {
      product += light[a] * light[b] * crest.At(b - a, 0);
    }
  }
  if (sum > 0) trail.contrast_kept = std::sqrt(std::max(0.0, product / crest.At(0, 0))) / sum;
  return trail;
}

// Every column as the first.
template <typename T>
Image<T> Widened(const Image<T>& column, int columns_px) {
  Image<T> wide(columns_px, column.rows_px);
  for (int row = 0; row < wide.rows_px; ++row) {
    std::fill_n(&wide.At(row, 0), columns_px, column.At(row, 0));
  }
  return wide;
}

ExpectedFrame ExpectColumns(const FrameSetup& nominal, std::span<const ActiveEffect> all_effects,
                            const Image<double>* previous,
                            std::shared_ptr<const LineImaging> known_imaging, int speckle_levels,
                            int block_columns_px) {
  ExpectedFrame expected;
  // Numbers of the sensor may tell how a pattern scatters; what scatters between recordings does
  // not change their expectation.
  std::vector<ActiveEffect> effects, of_frame;
  for (const ActiveEffect& active : all_effects) {
    if (!IsDrawn(*active.effect)) effects.push_back(active);
    const std::string_view id = active.effect->description().id;
    if (id != "illumination.power_noise" && id != "time.exposure_jitter") {
      of_frame.push_back(active);
    }
    const double gain = nominal.sensor.gain_dn_per_electron;
    if (id == "sensor.row_noise") expected.row_scatter_dn = gain * active.parameters[0];
    if (id == "sensor.dsnu_column_pattern")
      expected.column_scatter_dn = gain * active.parameters[0];
    if (id == "surface.albedo_texture" && block_columns_px > 0) {
      expected.drawn_variance_along_line = TextureVarianceAlong(
          nominal, active.parameters, LengthOnPlate(nominal, block_columns_px));
    }
  }
  expected.imaging = std::move(known_imaging);
  expected.frame = ApplyFrameEffects(nominal, of_frame);
  const FrameSetup& frame = expected.frame;
  const OpticsModel optics = MakeOpticsModel(frame, effects);
  PlateScene scene = MakePlateScene(frame);
  SpeckleModel speckle;
  speckle.pattern_weights = frame.speckle_pattern_weights;
  for (const ActiveEffect& active : effects) {
    active.effect->OnPlate(scene, frame, active.parameters);
    active.effect->OnSpeckle(speckle, frame, active.parameters);
  }
  double pattern_share = 0;  // contrast squared of several patterns over that of one
  for (double weight : speckle.pattern_weights) pattern_share += weight * weight;

  const bool lit = frame.laser_on && frame.shutter_open;
  PixelIrradiance light;
  light.roi = frame.roi;
  if (frame.shutter_open && scene.ambient_radiance_w_m2_sr) AddAmbient(scene, frame, light);
  light.laser_irradiance_w_m2 = Image<float>(frame.roi.columns_px, frame.roi.rows_px, 0.0F);
  if (lit) {
    light.laser_irradiance_w_m2 = ImageLine(scene, frame, optics, block_columns_px,
                                            expected.imaging, expected.level_along_line);
    expected.speckle = expected.imaging->speckle;
  }
  for (const ActiveEffect& active : effects) {
    active.effect->OnPixelIrradiance(light, frame, active.parameters);
  }
  PixelIrradiance dark_laser = light;
  std::fill(dark_laser.laser_irradiance_w_m2.values.begin(),
            dark_laser.laser_irradiance_w_m2.values.end(), 0.0F);
  const Image<double> total = MeanPhotoElectrons(light, frame);
  const Image<double> steady = MeanPhotoElectrons(dark_laser, frame);
  // Levels of what spreads by charge follow from the flow at each of them.
  const std::shared_ptr<const LineSpeckle> optical_speckle = expected.speckle;
  std::vector<ActiveEffect> but_by_charge = effects;
  std::erase_if(but_by_charge, [](const auto& active) { return SpreadsByCharge(*active.effect); });
  const bool by_charge = lit && but_by_charge.size() < effects.size();
  if (lit) {
    expected.speckle_of_cell = AfterChargeSpread(*expected.speckle, total, frame, effects);
    const auto& of_cell = expected.speckle_of_cell;
    if (of_cell[0] != nullptr) expected.speckle = of_cell[BrightestCell(total)];
  }

  const Sensor& sensor = frame.sensor;
  const double dark_electrons =
      sensor.dark_mean_electrons +
      sensor.dark_current_electrons_per_s * frame.exposure_time_s *
          std::exp2((frame.sensor_temperature_c - sensor.dark_current_reference_temperature_c) /
                    sensor.dark_current_doubling_k);
  const double read_variance = sensor.dark_noise_electrons * sensor.dark_noise_electrons +
                               dark_electrons - sensor.dark_mean_electrons;
  const double gain = sensor.gain_dn_per_electron;
  const double top_dn = sensor.largest_dn();
  const int level_count = lit ? speckle_levels : 1;
  // Speckle's contrast depends on the place across the line.
  std::array<std::vector<std::vector<double>>, 4> levels_of_place;  // of a cell's pixels
  const bool cells_differ = expected.speckle_of_cell[0] != expected.speckle_of_cell[1];
  auto speckle_of_levels = expected.speckle_of_cell;
  if (by_charge) {
    speckle_of_levels = AfterChargeSpread(*optical_speckle, total, frame, but_by_charge);
    if (speckle_of_levels[0] == nullptr) speckle_of_levels.fill(optical_speckle);
  } else if (!cells_differ) {
    speckle_of_levels.fill(expected.speckle);
  }
  for (int cell = 0; cell < (cells_differ ? 4 : 1); ++cell) {
    if (!lit) {
      levels_of_place[cell] = {{1.0}};
      continue;
    }
    const LineSpeckle& of_cell = *speckle_of_levels[cell];
    for (int place = 0; place < of_cell.places(); ++place) {
      // Strengths beyond sense would move more charge than there is.
      const double contrast_squared =
          std::clamp(of_cell.At(place).At(0, 0) * pattern_share, kLeastContrast, 1.0);
      levels_of_place[cell].push_back(SpeckleLevels(contrast_squared, level_count));
    }
  }
  std::vector<int> place_of_row(frame.roi.rows_px, 0);
  for (int row = 0; lit && row < frame.roi.rows_px; ++row) {
    place_of_row[row] = expected.speckle->PlaceOf((frame.roi.row_px + row) * sensor.pixel_pitch_m);
  }
  const std::vector<uint16_t> converted = ConvertedNumbers(frame, effects);
  // Of the step between the numbers that occur (EMVA 1288 R4.0, section 2.3).
  const double step_dn =
      converted.empty()
          ? 1
          : static_cast<double>(converted.size()) /
                static_cast<double>(std::set(converted.begin(), converted.end()).size());
  const double rounding_variance_dn2 = step_dn * step_dn / 12;
  // A full pixel has no noise: what it would hold is cut off together with its noise, at the number
  // a full pixel gives or at the largest.
  const double capacity = sensor.saturation_capacity_electrons;
  const double overfull_electrons = capacity + 6 * std::sqrt(capacity);
  Image<double> plateau_dn(frame.roi.columns_px, frame.roi.rows_px, capacity);
  for (const ActiveEffect& active : effects) {
    active.effect->OnElectrons(plateau_dn, frame, active.parameters);
  }
  for (double& plateau : plateau_dn.values) {
    plateau = std::clamp(std::floor(gain * plateau + sensor.black_level_dn + 0.5), 0.0, top_dn);
  }
  std::optional<NeighboursOfLevel> neighbours;
  if (by_charge) {
    Image<double> laser = total, other = steady;
    for (size_t i = 0; i < laser.values.size(); ++i) {
      laser.values[i] -= steady.values[i];
      other.values[i] += dark_electrons;
    }
    neighbours.emplace(std::move(laser), std::move(other), *speckle_of_levels[0], frame,
                       pattern_share, overfull_electrons);
  }
  const SmearTrail smear = TrailOfSmear(total, steady, frame, effects, expected.speckle.get());
  // Where there is hardly any light, levels hardly differ: what is clipped is computed once.
  struct Level {
    double mean = 0;
    Clipped clipped;
  };
  Image<double> mean_of_levels(frame.roi.columns_px, frame.roi.rows_px, 0.0);
  std::vector<Level> first_level(mean_of_levels.values.size());
  for (int level = 0; level < level_count; ++level) {
    // Charge comes from neighbours whose light is as far from its mean: what it scatters in all is
    // in the level already.
    Image<double> electrons(total.columns_px, total.rows_px);
    for (int cell = 0; cell < (cells_differ ? 4 : 1); ++cell) {
      Image<double> scaled = total;
      for (int row = 0; row < scaled.rows_px; ++row) {
        const double factor = levels_of_place[cell][place_of_row[row]][level];
        for (int column = 0; column < scaled.columns_px; ++column) {
          const double other = steady.At(row, column);
          scaled.At(row, column) = other + factor * (scaled.At(row, column) - other);
        }
      }
      for (const ActiveEffect& active : effects) {
        if (IsSmear(active)) continue;
        active.effect->OnMeanElectrons(scaled, previous, frame, active.parameters);
      }
      if (!smear.laser.empty()) {
        const std::vector<double>& crest = levels_of_place[cell][place_of_row[smear.crest_row]];
        const double factor = 1 + smear.contrast_kept * (crest[level] - 1);
        for (size_t i = 0; i < scaled.values.size(); ++i) {
          scaled.values[i] += smear.steady.values[i] + factor * smear.laser.values[i];
        }
      }
      if (!cells_differ) {
        electrons = std::move(scaled);
        break;
      }
      for (int row = cell / 2; row < scaled.rows_px; row += 2) {
        for (int column = cell % 2; column < scaled.columns_px; column += 2) {
          electrons.At(row, column) = scaled.At(row, column);
        }
      }
    }
    Image<float> noise(electrons.columns_px, electrons.rows_px);
    for (size_t i = 0; i < electrons.values.size(); ++i) {
      mean_of_levels.values[i] += electrons.values[i] / level_count;
      noise.values[i] = static_cast<float>(
          std::sqrt(gain * gain * (std::max(0.0, electrons.values[i]) + read_variance) +
                    rounding_variance_dn2));
      electrons.values[i] = std::min(electrons.values[i] + dark_electrons, overfull_electrons);
    }
    Image<double> factor;
    if (by_charge) {
      factor = Image<double>(electrons.columns_px, electrons.rows_px);
      for (int row = 0; row < factor.rows_px; ++row) {
        for (int column = 0; column < factor.columns_px; ++column) {
          const int cell = cells_differ ? 2 * (row % 2) + column % 2 : 0;
          factor.At(row, column) = levels_of_place[cell][place_of_row[row]][level];
        }
      }
    }
    for (const ActiveEffect& active : effects) {
      if (by_charge && SpreadsByCharge(*active.effect)) {
        electrons = neighbours->After(active, frame, electrons, factor);
      } else {
        active.effect->OnElectrons(electrons, frame, active.parameters);
      }
    }
    Image<float> dn(electrons.columns_px, electrons.rows_px);
    for (size_t i = 0; i < dn.values.size(); ++i) {
      const double mean = gain * electrons.values[i] + sensor.black_level_dn;
      Level& first = first_level[i];
      if (level == 0 || std::abs(mean - first.mean) > kLinear * noise.values[i]) {
        const Clipped clipped = MeanClipped(mean, noise.values[i], plateau_dn.values[i], gain);
        if (level == 0) first = {mean, clipped};
        dn.values[i] = static_cast<float>(clipped.mean);
      } else {
        dn.values[i] =
            static_cast<float>(first.clipped.mean + first.clipped.slope * (mean - first.mean));
      }
    }
    if (!converted.empty()) {
      for (size_t i = 0; i < dn.values.size(); ++i) {
        dn.values[i] += MeanConversion(converted, dn.values[i], noise.values[i]);
      }
    }
    expected.level_dn.push_back(std::move(dn));
  }
  expected.mean_dn = Image<double>(frame.roi.columns_px, frame.roi.rows_px, 0.0);
  expected.level_variance_dn2 = expected.mean_dn;
  for (const Image<float>& level : expected.level_dn) {
    for (size_t i = 0; i < level.values.size(); ++i) expected.mean_dn.values[i] += level.values[i];
  }
  for (double& mean : expected.mean_dn.values) mean /= level_count;
  for (const Image<float>& level : expected.level_dn) {
    for (size_t i = 0; i < level.values.size(); ++i) {
      const double deviation = level.values[i] - expected.mean_dn.values[i];
      expected.level_variance_dn2.values[i] += deviation * deviation / level_count;
    }
  }
  expected.noise_variance_dn2 = Image<float>(frame.roi.columns_px, frame.roi.rows_px);
  expected.pattern_variance_dn2 = expected.noise_variance_dn2;
  for (size_t i = 0; i < mean_of_levels.values.size(); ++i) {
    const double mean = std::max(0.0, mean_of_levels.values[i]);
    expected.noise_variance_dn2.values[i] =
        static_cast<float>(gain * gain * (mean + read_variance) + rounding_variance_dn2);
    expected.pattern_variance_dn2.values[i] = static_cast<float>(
        gain * gain *
        (std::pow(sensor.prnu_relative * mean, 2) + std::pow(sensor.dsnu_electrons, 2)));
  }
  expected.mean_photo_electrons = std::move(mean_of_levels);
  return expected;
}

}  // namespace

bool IsDrawn(const Effect& effect) {
  static constexpr std::array<std::string_view, 9> kDrawn = {"illumination.power_noise",
                                                             "time.exposure_jitter",
                                                             "surface.albedo_texture",
                                                             "optics.dust",
                                                             "optics.cover_glass_etalon",
                                                             "sensor.row_noise",
                                                             "sensor.hot_pixels",
                                                             "sensor.dsnu_column_pattern",
                                                             "sensor.prnu"};
  return std::find(kDrawn.begin(), kDrawn.end(), effect.description().id) != kDrawn.end();
}

const SpecklePixelCovariance& ExpectedFrame::SpeckleAt(int row, int column) const {
  const LineSpeckle* of_cell = speckle_of_cell[2 * (row % 2) + column % 2].get();
  if (of_cell == nullptr) of_cell = speckle.get();
  return of_cell->At(of_cell->PlaceOf((frame.roi.row_px + row) * frame.sensor.pixel_pitch_m));
}

ExpectedFrame ExpectFrame(const FrameSetup& frame, std::span<const ActiveEffect> effects,
                          const Image<double>* previous, std::shared_ptr<const LineImaging> imaging,
                          int speckle_levels, int block_columns_px) {
  const int columns_px = frame.roi.columns_px;
  if (frame.sensor.colour_filter != ColourFilter::kMono || columns_px < 2) {
    return ExpectColumns(frame, effects, previous, std::move(imaging), speckle_levels,
                         block_columns_px);
  }
  // Without colours all columns are alike: one will do.
  FrameSetup narrow = frame;
  narrow.roi.column_px += columns_px / 2;
  narrow.roi.columns_px = 1;
  Image<double> previous_column;
  if (previous != nullptr && !previous->empty()) {
    previous_column = Image<double>(1, previous->rows_px);
    for (int row = 0; row < previous->rows_px; ++row) {
      previous_column.At(row, 0) = previous->At(row, 0);
    }
  }
  ExpectedFrame expected =
      ExpectColumns(narrow, effects, previous == nullptr ? nullptr : &previous_column,
                    std::move(imaging), speckle_levels, block_columns_px);
  expected.frame.roi.column_px -= columns_px / 2;
  expected.frame.roi.columns_px = columns_px;
  for (Image<float>& level : expected.level_dn) level = Widened(level, columns_px);
  expected.mean_dn = Widened(expected.mean_dn, columns_px);
  expected.level_variance_dn2 = Widened(expected.level_variance_dn2, columns_px);
  expected.noise_variance_dn2 = Widened(expected.noise_variance_dn2, columns_px);
  expected.pattern_variance_dn2 = Widened(expected.pattern_variance_dn2, columns_px);
  expected.mean_photo_electrons = Widened(expected.mean_photo_electrons, columns_px);
  return expected;
}

}  // namespace sightline
