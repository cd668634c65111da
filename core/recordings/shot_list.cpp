// SPDX-License-Identifier: Apache-2.0
#include "core/recordings/shot_list.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstdlib>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/field_limits/field_checks.h"
#include "core/recordings/expected_line.h"
#include "core/status/status_macros.h"
#include "core/text/number_text.h"

namespace sightline {
namespace {

constexpr std::array<double, 9> kStops = {1.4, 2, 2.8, 4, 5.6, 8, 11, 16, 22};
// Usual limits of industrial cameras [s].
constexpr double kShortestExposure = 2e-5, kLongestExposure = 2;
// To set something, and between frames of a burst [s].
constexpr double kSettingTime = 40, kFrameTime = 0.2;
constexpr int kColumnsPx = 384, kRowsPx = 256;

// By way of text, so that the file holds short decimal fractions.
double TwoDigits(double value) {
  return std::strtod(absl::StrFormat("%.1e", value).c_str(), nullptr);
}
double ToMillionths(double value) {
  return std::strtod(absl::StrFormat("%.6f", value).c_str(), nullptr);
}
double ToThousandths(double value) {
  return std::strtod(absl::StrFormat("%.3f", value).c_str(), nullptr);
}

// Nearest value of a parameter to `wish`.
double Nearest(const ParameterDomain& domain, double wish) {
  double best = wish, distance = 1e300;
  const auto offer = [&](double value) {
    if (std::abs(value - wish) < distance) {
      distance = std::abs(value - wish);
      best = value;
    }
  };
  for (const ParameterDomain::Range& range : domain.ranges) {
    offer(std::clamp(wish, range.min, range.max));
  }
  for (const double value : domain.values) offer(value);
  return best;
}

// The plate's Lambert + GGX for a material of the inspection; a note where that is a guess.
RecordedSurface SurfaceOf(const v1::Material& material, double wavelength_m,
                          std::vector<std::string>* notes) {
  RecordedSurface surface = {0.35, 0.6, 0.4};
  if (material.has_lambert_ggx()) {
    return {material.lambert_ggx().diffuse_albedo(), material.lambert_ggx().specular_f0(),
            material.lambert_ggx().ggx_alpha()};
  }
  if (material.has_lambert()) return {material.lambert().diffuse_albedo(), 0, 1};
  const auto& conductor = material.conductor();
  if (material.has_conductor() && conductor.refractive_index_size() > 0) {
    const auto& nearest =
        *std::min_element(conductor.refractive_index().begin(), conductor.refractive_index().end(),
                          [&](const auto& a, const auto& b) {
                            return std::abs(a.wavelength_m() - wavelength_m) <
                                   std::abs(b.wavelength_m() - wavelength_m);
                          });
    const std::complex<double> index(nearest.n(), nearest.k());
    surface = {conductor.diffuse_albedo(), std::norm((index - 1.0) / (index + 1.0)),
               std::sqrt(conductor.ggx_alpha_x() * conductor.ggx_alpha_y())};
    if (conductor.ggx_alpha_x() != conductor.ggx_alpha_y()) {
      notes->push_back(
          "surface.ggx_alpha is the geometric mean of the material's two; the plate's machining "
          "marks are not described");
    }
    return surface;
  }
  notes->push_back(
      "surface holds assumed values (bare metal): the inspection's first material has no Lambert + "
      "GGX values; put in those of the plate, since exposures follow from them");
  return surface;
}

class Planner {
 public:
  Planner(const Inspection& inspection, ShotList* list)
      : inspection_(inspection), list_(list), set_(list->set) {}

  void Plan(int images) {
    ChooseSetting();
    // Most telling first; bursts stay whole.
    std::vector<Unit> units = Units();
    std::vector<Unit> chosen;
    int count = 0;
    for (size_t next = 0; count < images && !units.empty(); ++next) {
      const size_t place = next % units.size();
      if (next >= 50 * units.size()) break;
      // From the second round on only recordings that profit from new speckle.
      const bool burst = units[place].size() > 1;
      if (next >= units.size() && (burst || units[place].front().kind == RecordingKind::kDark)) {
        continue;
      }
      chosen.push_back(units[place]);
      count += static_cast<int>(units[place].size());
    }
    std::stable_sort(chosen.begin(), chosen.end(), [](const Unit& a, const Unit& b) {
      return Turn(a.front().series) < Turn(b.front().series);
    });
    Spread(&chosen);
    Number(chosen);
  }

 private:
  using Unit = std::vector<RecordedImage>;  // one recording, or a burst

  // Series that need the same changes of the rig follow each other.
  static int Turn(const std::string& series) {
    constexpr std::array<const char*, 7> kTurns = {
        "aperture", "exposure_sweep", "noise", "field", "laser_distance", "distance", "focus"};
    for (size_t i = 0; i < kTurns.size(); ++i) {
      if (series == kTurns[i]) return static_cast<int>(i);
    }
    return static_cast<int>(kTurns.size());
  }

  void ChooseSetting() {
    const ParameterDomain& distances = inspection_.domain.parameters[0];
    const Lens& lens = *inspection_.rig.lens;
    // A third of a metre keeps the magnification of small parts.
    distance_m_ = Nearest(distances, lens.focus_distance_m.value_or(0.33));
    const ParameterDomain& angles = inspection_.domain.parameters[1];
    const double positive = Nearest(angles, Radians(45)), negative = Nearest(angles, Radians(-45));
    const double angle =
        std::abs(positive - Radians(45)) <= std::abs(negative + Radians(45)) ? positive : negative;
    set_.incidence_angle_rad = std::abs(angle);
    laser_distance_m_ = set_.laser.distance_m.value_or(distance_m_);
    set_.laser.distance_m.reset();
    columns_px_ = std::min(kColumnsPx, set_.camera.columns_px) / 2 * 2;
    rows_px_ = std::min(kRowsPx, set_.camera.rows_px) / 2 * 2;
  }

  RecordedImage Base(const char* series, double f_number) const {
    RecordedImage image;
    image.series = series;
    image.plate_position_id = 0;
    image.f_number = f_number;
    image.camera_distance_m = image.focus_distance_m = distance_m_;
    image.laser_distance_m = laser_distance_m_;
    image.roi_column_px = -(columns_px_ / 4 * 2);
    image.roi_row_px = -(rows_px_ / 4 * 2);
    image.roi_columns_px = columns_px_;
    image.roi_rows_px = rows_px_;
    return image;
  }

  // Sets the exposure that brings the brightest channel's crest to `share` of the largest number;
  // 0: to as much as speckle allows. False: no camera can do that.
  bool Expose(RecordedImage* image, double share = 0) const {
    image->exposure_time_s = 1;
    const ExpectedLine line = ExpectLine(set_, *image);
    double crest_dn = 0;
    for (int c = 0; c < set_.camera.channels(); ++c) {
      crest_dn = std::max(crest_dn, line.CrestDn(set_.camera, c));
    }
    const Sensor& sensor = set_.camera;
    const double dark_dn =
        sensor.black_level_dn + sensor.gain_dn_per_electron * sensor.dark_mean_electrons;
    const double full_dn = std::min(sensor.largest_dn(), sensor.gain_dn_per_electron *
                                                             sensor.saturation_capacity_electrons) -
                           dark_dn;
    // Three standard deviations of speckle above the mean still fit.
    const double contrast = std::sqrt(line.speckle_contrast_squared);
    const double reach = share > 0 ? share : std::min(0.7, 1 / (1 + 3 * contrast));
    if (!(crest_dn > 0) || !(full_dn > 0)) return false;
    const double exposure = reach * full_dn / crest_dn;
    if (exposure > kLongestExposure || exposure < kShortestExposure) return false;
    image->exposure_time_s = TwoDigits(exposure);
    return true;
  }

  std::vector<Unit> Units() {
    std::vector<Unit> units;
    const auto add = [&](RecordedImage image) {
      if (!Expose(&image)) return false;
      units.push_back({std::move(image)});
      return true;
    };
    // Nearest stop to `wish` that can be exposed.
    const auto stop = [&](double wish) {
      double best = 0;
      for (const double f_number : kStops) {
        RecordedImage image = Base("", f_number);
        if (!Expose(&image)) continue;
        if (best == 0 || std::abs(std::log(f_number / wish)) < std::abs(std::log(best / wish))) {
          best = f_number;
        }
      }
      return best;
    };
    if (stop(8) == 0) return units;
    AddSweep(stop(8), &units);
    for (const double exposure : {0.02, 0.5}) AddDark(exposure, &units);
    for (const double f_number : {stop(2.8), stop(16)}) add(Base("aperture", f_number));
    AddRepeats(stop(5.6), &units);
    add(Base("shifted_plate", stop(8)));
    for (const double factor : {0.75, 1.3}) AddDistance(factor, stop(4), add);
    AddFocus(0.75, stop(2.8), add);
    AddFocus(1.45, stop(2.8), add);
    AddField(1, 0, stop(2.8), add);
    AddField(1, 1, stop(5.6), add);
    std::string left_out;
    for (const double f_number : kStops) {
      if (f_number == stop(2.8) || f_number == stop(16)) continue;
      if (!add(Base("aperture", f_number))) {
        absl::StrAppend(&left_out, left_out.empty() ? "f/" : ", f/", NumberText(f_number));
      }
    }
    if (!left_out.empty()) {
      list_->notes.push_back(absl::StrCat(
          left_out, " left out: with laser.power_w of ", NumberText(set_.laser.power_w),
          " W they need exposures shorter than 20 us or longer than 2 s"));
    }
    AddField(-1, 0, stop(2.8), add);
    AddField(-1, -1, stop(5.6), add);
    for (const double factor : {0.7, 1.3}) {
      RecordedImage image = Base("laser_distance", stop(8));
      image.laser_distance_m = ToThousandths(factor * laser_distance_m_);
      add(image);
    }
    for (const double exposure : {0.002, 0.1}) AddDark(exposure, &units);
    for (const double factor : {0.6, 0.9, 1.2, 1.5}) AddDistance(factor, stop(4), add);
    for (const double factor : {0.75, 1.5}) AddDistance(factor, stop(2), add);
    AddFocus(0.9, stop(1.4), add);
    for (int i = 0; i < 2; ++i) add(Base("shifted_plate", stop(8)));
    if (!has_distances_) {
      list_->notes.push_back(
          "no distance series: the inspection fixes camera_distance_m; a wrong camera distance and "
          "a wrong focus distance then look alike");
    }
    return units;
  }

  // Far below the limit to far above it, and back, with the same speckle; then a dark frame, which
  // shows what the sensor keeps of the frame before.
  void AddSweep(double f_number, std::vector<Unit>* units) const {
    Unit burst;
    for (const double share : {0.025, 0.43, 0.17, 0.07, 1.0, 2.1, 0.025, 2.1}) {
      RecordedImage image = Base("exposure_sweep", f_number);
      if (Expose(&image, share)) burst.push_back(image);
    }
    RecordedImage dark = Base("exposure_sweep", f_number);
    dark.kind = RecordingKind::kDark;
    dark.exposure_time_s = 2e-4;
    burst.push_back(dark);
    if (burst.size() > 4) units->push_back(std::move(burst));
  }

  void AddRepeats(double f_number, std::vector<Unit>* units) const {
    RecordedImage image = Base("noise", f_number);
    if (Expose(&image)) units->push_back({image, image, image});
  }

  void AddDark(double exposure_s, std::vector<Unit>* units) const {
    RecordedImage image = Base("dark", 8);
    image.kind = RecordingKind::kDark;
    image.exposure_time_s = exposure_s;
    units->push_back({image});
  }

  template <typename Add>
  void AddDistance(double factor, double f_number, const Add& add) {
    const double distance = Nearest(inspection_.domain.parameters[0], factor * distance_m_);
    // Bounds may leave nothing of the step.
    if (std::abs(distance / distance_m_ - 1) < 0.5 * std::abs(factor - 1)) return;
    if (distance <= 2 * set_.focal_length_m) return;
    has_distances_ = true;
    RecordedImage image = Base("distance", f_number);
    image.camera_distance_m = ToThousandths(distance);
    // A strongly blurred line must leave background in the region of interest.
    if (ExpectLine(set_, image).width_px > rows_px_ / 12.0) return;
    add(image);
  }

  template <typename Add>
  void AddFocus(double factor, double f_number, const Add& add) const {
    RecordedImage image = Base("focus", f_number);
    image.focus_distance_m = ToThousandths(std::max(factor * distance_m_, 2 * set_.focal_length_m));
    if (ExpectLine(set_, image).width_px > rows_px_ / 12.0) return;
    add(image);
  }

  // `across`, `along`: -1, 0 or 1, towards an edge of the sensor.
  template <typename Add>
  void AddField(int across, int along, double f_number, const Add& add) const {
    RecordedImage image = Base("field", f_number);
    const int columns = set_.camera.columns_px, rows = set_.camera.rows_px;
    // Even, so that it starts with a Bayer cell.
    image.roi_column_px +=
        along == 0 && across == 0 ? 0 : across * ((columns - columns_px_) / 4 * 2);
    const int shift_px = along * ((rows - rows_px_) / 4 * 2);
    image.roi_row_px += shift_px;
    if (columns - columns_px_ < 16 && rows - rows_px_ < 16) return;
    const double b = 1 / (1 / set_.focal_length_m - 1 / image.focus_distance_m);
    image.line_offset_m =
        ToMillionths(shift_px * set_.camera.pixel_pitch_m * image.camera_distance_m / b);
    add(image);
  }

  // Dark frames and the repeated setting come at the beginning, at the end and in between.
  static void Spread(std::vector<Unit>* units) {
    std::vector<Unit> fixed, spread;
    for (Unit& unit : *units) {
      const std::string& series = unit.front().series;
      (series == "dark" || series == "shifted_plate" ? spread : fixed).push_back(std::move(unit));
    }
    std::stable_partition(spread.begin(), spread.end(),
                          [](const Unit& unit) { return unit.front().series == "dark"; });
    // Dark and repeated alternate.
    std::vector<Unit> mixed;
    const size_t darks =
        static_cast<size_t>(std::count_if(spread.begin(), spread.end(), [](const Unit& unit) {
          return unit.front().series == "dark";
        }));
    for (size_t i = 0; i < std::max(darks, spread.size() - darks); ++i) {
      if (darks + i < spread.size()) mixed.push_back(spread[darks + i]);
      if (i < darks) mixed.push_back(spread[i]);
    }
    units->clear();
    size_t next = 0;
    for (size_t i = 0; i < mixed.size(); ++i) {
      const size_t until = mixed.size() < 2 ? 0 : i * fixed.size() / (mixed.size() - 1);
      for (; next < until; ++next) units->push_back(fixed[next]);
      units->push_back(mixed[i]);
    }
    for (; next < fixed.size(); ++next) units->push_back(fixed[next]);
  }

  void Number(const std::vector<Unit>& units) {
    double time_s = 20;
    int position = 0, group = 0;
    for (const Unit& unit : units) {
      time_s += kSettingTime;
      const bool lit = std::any_of(unit.begin(), unit.end(), [](const RecordedImage& image) {
        return image.kind == RecordingKind::kLaser;
      });
      if (lit) ++position;
      for (size_t k = 0; k < unit.size(); ++k) {
        RecordedImage image = unit[k];
        const int index = static_cast<int>(set_.recordings.size());
        image.file = absl::StrFormat("images/%03d.png", index);
        image.burst_frame_index = static_cast<int>(k);
        image.timestamp_s = time_s;
        time_s += std::max(kFrameTime, 2 * image.exposure_time_s);
        image.plate_position_id.reset();
        if (image.kind == RecordingKind::kLaser) {
          image.plate_position_id = position;
          image.same_speckle = k > 0;
        }
        image.repeat_group = -1;
        for (const RecordedImage& other : set_.recordings) {
          if (SameSetting(other, image)) image.repeat_group = other.repeat_group;
        }
        if (image.repeat_group < 0) image.repeat_group = group++;
        image.timestamp_s = ToThousandths(image.timestamp_s);
        set_.recordings.push_back(std::move(image));
      }
    }
  }

  static bool SameSetting(const RecordedImage& a, const RecordedImage& b) {
    return a.kind == b.kind && a.exposure_time_s == b.exposure_time_s && a.f_number == b.f_number &&
           a.camera_distance_m == b.camera_distance_m && a.focus_distance_m == b.focus_distance_m &&
           a.laser_distance_m == b.laser_distance_m && a.line_offset_m == b.line_offset_m &&
           a.roi_column_px == b.roi_column_px && a.roi_row_px == b.roi_row_px;
  }

  const Inspection& inspection_;
  ShotList* list_;
  RecordingSet& set_;
  double distance_m_ = 0, laser_distance_m_ = 0;
  int columns_px_ = 0, rows_px_ = 0;
  bool has_distances_ = false;
};

}  // namespace

absl::StatusOr<ShotList> PlanShotList(const Inspection& inspection, const std::string& context,
                                      int images) {
  const Checker check(context);
  SIGHTLINE_RETURN_IF_ERROR(check.Range("images", images, Limits{kFewestShots, kMostShots, ""}));
  if (!inspection.sensor) {
    return check.Error("camera.sensor_file", "is missing: exposures need a sensor");
  }
  if (!inspection.rig.lens) return check.Error("lens", "is missing: exposures need a lens");
  ShotList list;
  RecordingSet& set = list.set;
  set.name = inspection.name.empty() ? "plate" : inspection.name;
  set.camera = *inspection.sensor;
  const Lens& lens = *inspection.rig.lens;
  set.focal_length_m = lens.focal_length_m;
  set.transmission = lens.transmission;
  set.laser = inspection.rig.laser;
  if (set.laser.line_profile != LineProfile::kPowell) {
    list.notes.push_back(
        "laser.line_profile is not uniform along the line; recordings of plates describe uniform "
        "ones only");
    set.laser.line_profile = LineProfile::kPowell;
  }
  set.laser.beam_quality_m2 = 1;
  if (inspection.rig.laser.beam_quality_m2 != 1) {
    list.notes.push_back("laser.beam_quality_m2 is taken as 1, the only value in recordings.json");
  }
  if (inspection.materials.empty()) {
    set.surface = SurfaceOf({}, set.laser.wavelength_m, &list.notes);
  } else {
    set.surface =
        SurfaceOf(inspection.materials.front().material, set.laser.wavelength_m, &list.notes);
  }
  set.uncertainty.camera_distance_m = 0.002;
  set.uncertainty.focus_distance_relative = 0.015;
  set.uncertainty.f_number_relative = 0.015;
  set.uncertainty.laser_distance_m = 0.003;
  set.uncertainty.beam_focus_distance_m = 0.01;
  set.uncertainty.incidence_angle_rad = Radians(0.3);
  set.uncertainty.divergence_relative = 0.02;
  set.uncertainty.power_relative = 0.02;
  set.uncertainty.transmission_relative = 0.02;
  set.uncertainty.diffuse_albedo_relative = 0.1;
  set.uncertainty.specular_f0_relative = 0.05;
  set.uncertainty.ggx_alpha_relative = 0.03;
  set.uncertainty.quantum_efficiency_relative = 0.02;
  set.uncertainty.gain_relative = 0.01;
  set.uncertainty.dark_mean_electrons = 0.3;
  set.uncertainty.dark_noise_relative = 0.03;
  set.uncertainty.line_position_common_px = 1.5;
  set.uncertainty.line_position_each_px = 0.3;
  Planner(inspection, &list).Plan(images);
  if (set.recordings.empty()) {
    return check.Error("laser.power_w",
                       absl::StrCat("is ", NumberText(set.laser.power_w),
                                    ": at no f-number does an exposure between 20 us and 2 s bring "
                                    "the line well into the camera's range"));
  }
  return list;
}

std::string ShotListText(const ShotList& list) {
  const RecordingSet& set = list.set;
  std::string text = absl::StrCat(
      "# Shot list: ", set.name, "\n\n", set.recordings.size(),
      " raw images of the laser line on a flat plate, perpendicular to the camera's axis.\n\n"
      "1. Check recordings.json: surface, laser, camera and lens should describe this rig, and\n"
      "   `uncertainty` how well they are known (standard uncertainties; those given are what an\n"
      "   ordinary calibration reaches).\n"
      "2. Switch off everything that changes numbers: automatic exposure and gain, gamma, black\n"
      "   correction, denoising, colour conversion. Read out all bits, save 16-bit greyscale PNG\n"
      "   (or TIFF) without scaling: never JPEG, never 8 bits.\n"
      "3. Darken the room. Let the laser warm up and leave it on; `timestamp_s` counts from when "
      "it\n"
      "   was switched on: write down the true times.\n"
      "4. Take the images in this order. \"New\" plate: shift the plate in its plane by more than "
      "the\n"
      "   width of the image, so that the speckle is new. \"Same\": touch nothing, take the "
      "frames\n"
      "   one right after the other. Dark: an opaque cover on the lens.\n"
      "5. What your rig cannot do, leave out: delete the entry. What you set otherwise, correct "
      "in\n"
      "   recordings.json: it must describe the recordings as made, not as planned.\n"
      "6. `sightline recordings check` on this folder while the rig still stands.\n");
  for (const std::string& note : list.notes) absl::StrAppend(&text, "\nNote: ", note, ".\n");
  absl::StrAppend(
      &text, "\nIncidence angle of the laser: ", NumberText(Degrees(set.incidence_angle_rad)),
      " degrees to the plate's normal.\n\n"
      "| file | series | plate | f/ | exposure | camera | focused on | laser | line at | "
      "region (column, row) |\n|---|---|---|---|---|---|---|---|---|---|\n");
  for (const RecordedImage& image : set.recordings) {
    const bool dark = image.kind == RecordingKind::kDark;
    absl::StrAppend(&text, "| ", image.file, " | ", image.series, " | ",
                    dark                 ? "cover on"
                    : image.same_speckle ? "same"
                                         : "new",
                    " | ", dark ? "any" : NumberText(image.f_number), " | ",
                    absl::StrFormat("%.6g ms", 1e3 * image.exposure_time_s), " | ",
                    absl::StrFormat("%.0f mm | %.0f mm | %.0f mm | %.2f mm | %d, %d |\n",
                                    1e3 * image.camera_distance_m, 1e3 * image.focus_distance_m,
                                    1e3 * image.laser_distance_m, 1e3 * image.line_offset_m,
                                    image.roi_column_px, image.roi_row_px));
  }
  absl::StrAppend(
      &text, "\nEvery region is ", set.recordings.front().roi_columns_px, " x ",
      set.recordings.front().roi_rows_px,
      " px; its first pixel counts from the principal point, which is pixel (",
      set.camera.columns_px / 2, ", ", set.camera.rows_px / 2,
      ") of the sensor. The line is moved across the plate together with its projector.\n\n"
      "| series | what it is for |\n|---|---|\n"
      "| aperture | aperture error, aberrations, speckle size, sharpness |\n"
      "| exposure_sweep | response, saturation and exposure time with everything else the same; "
      "the dark frame after the bright one shows image lag |\n"
      "| noise | temporal noise, gain, vibration |\n"
      "| field | distortion, vignetting, field curvature, uniformity of the line |\n"
      "| laser_distance | beam focus, divergence |\n"
      "| distance, focus | distances and focus, separately from aberrations |\n"
      "| shifted_plate | the same again with new speckle: drift, and how well levels are known |\n"
      "| dark | dark level, dark current, fixed patterns |\n");
  return text;
}

}  // namespace sightline
