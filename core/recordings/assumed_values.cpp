// SPDX-License-Identifier: Apache-2.0
#include "core/recordings/assumed_values.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/statistics/order_statistics.h"

namespace sightline {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;

// Usual values of a laser-line scanner, and how much scanners differ (k = 1). Relative
// uncertainties are at most a third of the value where the quantity enters linearly: a normal law
// must keep away from zero.
struct UsualValue {
  const char* part;   // field of Recordings
  const char* field;  // of that part
  double value;
  const char* uncertainty;  // field of Recordings.Uncertainty; "" if none
  double standard_uncertainty;
  const char* unit;
};
constexpr UsualValue kUsualValues[] = {
    // Coated lenses of machine vision: 0.8 to 0.95.
    {"lens", "transmission", 0.85, "transmission_relative", 0.1, ""},
    // Line lasers of class 2 and 3R. The brightness of the line determines it together with the
    // surface.
    {"laser", "power_w", 1e-3, "power_relative", 3, " W"},
    {"laser", "divergence_rad", 1e-3, "divergence_relative", 0.3, " rad"},
    {"laser", "fan_angle_deg", 45, "", 0, " deg"},
    // Milled or sandblasted metal.
    {"surface", "diffuse_albedo", 0.35, "diffuse_albedo_relative", 0.3, ""},
    {"surface", "specular_f0", 0.6, "specular_f0_relative", 0.3, ""},
    {"surface", "ggx_alpha", 0.4, "ggx_alpha_relative", 0.3, ""},
    {"rig", "incidence_angle_deg", 45, "incidence_angle_deg", 10, " deg"},
    // Industrial CMOS cameras by their EMVA 1288 data sheets: 2 to 15 electrons.
    {"camera", "dark_noise_electrons", 6, "dark_noise_relative", 0.3, " electrons"},
};
// Version 3, in place of those above: plates are targets from paper to metal, which tilts tell
// apart, and cameras of 8 bits may be noisy. Normal laws are cut at a tenth of the value.
constexpr UsualValue kUsualValuesOfPoses[] = {
    {"surface", "specular_f0", 0.3, "specular_f0_relative", 1, ""},
    {"surface", "ggx_alpha", 0.4, "ggx_alpha_relative", 0.5, ""},
    {"camera", "dark_noise_electrons", 10, "dark_noise_relative", 1, " electrons"},
    // Its start is the width of the lines in the images (core/recordings/reduction).
    {"laser", "divergence_rad", 1e-3, "divergence_relative", 0.2, " rad"},
};
// The waist is not known, but divergence and waist change together with the width of the lines. A
// wide uncertainty here would let the line become as wide as a halo.
constexpr double kBeamFocusUncertaintyOfPoses_m = 0.02;
constexpr double kDarkMeanUncertaintyOfPoses_electrons = 100;
// Quantum efficiency of mono sensors in the red.
constexpr double kQuantumEfficiency = 0.5, kQuantumEfficiencyRelative = 0.2;
// Pixels hold about this much where nothing is said.
constexpr double kSaturation_electrons = 10000, kGainRelative = 0.3;
constexpr double kBeamFocusUncertainty_m = 0.1, kLaserDistanceUncertainty_m = 0.05;
constexpr double kFocusRelative = 0.05;
// Cameras have black levels so that noise is not cut off at zero; dark frames determine it.
constexpr double kDarkMean_electrons = 30;
constexpr int kLargestBits = 16;
// Version 3. Pixels of machine-vision sensors: 2.4 to 7 um. Exposure time and power only count as
// a product. Apertures between f/4 and f/16.
constexpr double kPixelPitch_m = 5e-6, kExposure_s = 1e-3, kFNumber = 8, kFNumberRelative = 0.2;
// Poses from corners of a board put the line to some pixels.
constexpr double kLinePosition_px = 2;

class Completion {
 public:
  explicit Completion(v1::Recordings* message) : message_(message) {}

  std::vector<std::string> Run() {
    const bool posed = message_->format_version() == 3;
    if (posed) {
      AssumeLengths();
      for (const UsualValue& usual : kUsualValuesOfPoses) Assume(usual);
    }
    for (const UsualValue& usual : kUsualValues) {
      // Angles follow from the poses.
      if (!(posed && std::string_view(usual.part) == "rig")) Assume(usual);
    }
    AssumeConversion();
    AssumeDarkLevel();
    AssumeEfficiency();
    if (posed) {
      AssumeExposure();
    } else {
      AssumeDistances();
    }
    AssumeOrder();
    return std::move(notes_);
  }

 private:
  Message* Part(const char* name) {
    const FieldDescriptor* field = message_->GetDescriptor()->FindFieldByName(name);
    return message_->GetReflection()->MutableMessage(message_, field);
  }

  // The wider one of the stated and the assumed uncertainty.
  void Widen(const std::string& name, double standard_uncertainty) {
    v1::Recordings::Uncertainty* uncertainty = message_->mutable_uncertainty();
    const FieldDescriptor* field = uncertainty->GetDescriptor()->FindFieldByName(name);
    const Reflection* reflection = uncertainty->GetReflection();
    reflection->SetDouble(
        uncertainty, field,
        std::max(reflection->GetDouble(*uncertainty, field), standard_uncertainty));
  }

  void Note(const std::string& field, double value, const std::string& unit,
            const std::string& uncertainty) {
    notes_.push_back(absl::StrCat(field, " is not stated: ", absl::StrFormat("%.4g", value), unit,
                                  uncertainty.empty()
                                      ? " is assumed"
                                      : absl::StrCat(" ", uncertainty, " is assumed, and fitted")));
  }

  static std::string PlusMinus(const std::string& name, double uncertainty,
                               const std::string& unit) {
    if (name.ends_with("_relative")) return absl::StrFormat("+- %.3g %%", 100 * uncertainty);
    return absl::StrFormat("+- %.3g%s", uncertainty, unit);
  }

  void Assume(const UsualValue& usual) {
    Message* part = Part(usual.part);
    const FieldDescriptor* field = part->GetDescriptor()->FindFieldByName(usual.field);
    if (part->GetReflection()->HasField(*part, field)) return;
    part->GetReflection()->SetDouble(part, field, usual.value);
    const std::string uncertainty = usual.uncertainty;
    if (!uncertainty.empty()) Widen(uncertainty, usual.standard_uncertainty);
    Note(absl::StrCat(usual.part, ".", usual.field), usual.value, usual.unit,
         uncertainty.empty() ? "" : PlusMinus(uncertainty, usual.standard_uncertainty, usual.unit));
  }

  // Gain and saturation follow from each other: the converter's range is that of the pixel.
  void AssumeConversion() {
    v1::Sensor* camera = message_->mutable_camera();
    if (camera->bit_depth_bit() < 1 || camera->bit_depth_bit() > kLargestBits) return;
    const double full_dn = std::ldexp(1.0, camera->bit_depth_bit()) - 1;
    if (!camera->has_gain_dn_per_electron()) {
      const double saturation = camera->saturation_capacity_electrons() > 0
                                    ? camera->saturation_capacity_electrons()
                                    : kSaturation_electrons;
      camera->set_gain_dn_per_electron(full_dn / saturation);
      Widen("gain_relative", kGainRelative);
      Note("camera.gain_dn_per_electron", full_dn / saturation, " DN/e-",
           PlusMinus("gain_relative", kGainRelative, ""));
    }
    if (!camera->has_saturation_capacity_electrons() && camera->gain_dn_per_electron() > 0) {
      const double saturation = full_dn / camera->gain_dn_per_electron();
      camera->set_saturation_capacity_electrons(saturation);
      Note("camera.saturation_capacity_electrons", saturation, " electrons", "");
    }
  }

  void AssumeDarkLevel() {
    v1::Sensor* camera = message_->mutable_camera();
    if (camera->has_dark_mean_electrons() || camera->has_black_level_dn()) return;
    const double uncertainty = message_->format_version() == 3
                                   ? kDarkMeanUncertaintyOfPoses_electrons
                                   : kDarkMean_electrons;
    camera->set_dark_mean_electrons(kDarkMean_electrons);
    Widen("dark_mean_electrons", uncertainty);
    Note("camera.dark_mean_electrons", kDarkMean_electrons, " electrons",
         PlusMinus("dark_mean_electrons", uncertainty, " electrons"));
  }

  void AssumeEfficiency() {
    v1::Sensor* camera = message_->mutable_camera();
    if (camera->has_quantum_efficiency() || !camera->quantum_efficiency_curve().empty()) return;
    v1::Sensor::QuantumEfficiency* efficiency = camera->mutable_quantum_efficiency();
    if (camera->sensor_type() == "mono") {
      efficiency->set_mono(kQuantumEfficiency);
    } else {
      efficiency->set_red(kQuantumEfficiency);
      efficiency->set_green(kQuantumEfficiency);
      efficiency->set_blue(kQuantumEfficiency);
    }
    Widen("quantum_efficiency_relative", kQuantumEfficiencyRelative);
    Note("camera.quantum_efficiency", kQuantumEfficiency, "",
         PlusMinus("quantum_efficiency_relative", kQuantumEfficiencyRelative, ""));
  }

  // Median distance of the plate along the camera's axis; 0: no recording has a pose.
  double PlateDepth() const {
    std::vector<double> depths_m;
    for (const v1::Recording& recording : message_->recordings()) {
      if (!recording.plate_pose().has_translation_m()) continue;
      depths_m.push_back(recording.plate_pose().translation_m().z());
    }
    return depths_m.empty() ? 0 : UpperMedian(std::move(depths_m));
  }

  // Pixel pitch, focal length and focus distance make the focal length in pixels: those that are
  // not stated follow. The geometry depends on the pitch in no other way.
  void AssumeLengths() {
    const double depth_m = PlateDepth(), focal_px = message_->pixel_camera().focal_length_px();
    if (!(depth_m > 0 && focal_px > 0)) return;  // ParseRecordings says what is missing
    v1::Sensor* camera = message_->mutable_camera();
    v1::Recordings::RecordedLens* lens = message_->mutable_lens();
    const bool no_pitch = !camera->has_pixel_pitch_m();
    if (no_pitch && lens->has_focal_length_m() && lens->focal_length_m() < depth_m) {
      camera->set_pixel_pitch_m(1 / (1 / lens->focal_length_m() - 1 / depth_m) / focal_px);
      notes_.push_back(absl::StrFormat(
          "camera.pixel_pitch_m is not stated: %.4g m follows from lens.focal_length_m and "
          "pixel_camera.focal_length_px, with the focus on the plate",
          camera->pixel_pitch_m()));
    } else if (no_pitch) {
      camera->set_pixel_pitch_m(kPixelPitch_m);
      notes_.push_back(absl::StrFormat(
          "camera.pixel_pitch_m is not stated: %.4g m is assumed. Geometry and brightness do not "
          "depend on it; size of speckle and diffraction do, so that wavelength and f-number "
          "cannot "
          "be told",
          kPixelPitch_m));
      Widen("f_number_relative", kFNumberRelative);
    }
    const double image_m = focal_px * camera->pixel_pitch_m();
    if (!lens->has_focal_length_m()) {
      lens->set_focal_length_m(1 / (1 / image_m + 1 / depth_m));
      notes_.push_back(absl::StrFormat(
          "lens.focal_length_m is not stated: %.4g m follows from pixel_camera.focal_length_px and "
          "camera.pixel_pitch_m",
          lens->focal_length_m()));
    }
    const double inverse = 1 / lens->focal_length_m() - 1 / image_m;
    const double focus_m = inverse > 0 ? 1 / inverse : depth_m;
    if (AssumeInRecordings([](const auto& r) { return r.has_focus_distance_m(); },
                           [focus_m](auto* r) { r->set_focus_distance_m(focus_m); })) {
      Widen("focus_distance_relative", kFocusRelative);
      notes_.push_back(absl::StrFormat(
          "recordings[].focus_distance_m is not stated: %.4g m follows from the focal lengths, "
          "+- %.3g %%, which is fitted",
          focus_m, 100 * kFocusRelative));
    }
    const double laser_m = message_->laser_plane().has_origin_m()
                               ? LaserDistance(message_->laser_plane().origin_m())
                               : depth_m;
    if (!message_->laser().has_beam_focus_distance_m()) {
      message_->mutable_laser()->set_beam_focus_distance_m(laser_m);
      Widen("beam_focus_distance_m", kBeamFocusUncertaintyOfPoses_m);
      Note("laser.beam_focus_distance_m", laser_m, " m",
           PlusMinus("beam_focus_distance_m", kBeamFocusUncertaintyOfPoses_m, " m"));
    }
    if (message_->uncertainty().line_position_each_px() == 0) {
      Widen("line_position_each_px", kLinePosition_px);
      Note("uncertainty.line_position_each_px", kLinePosition_px, " px", "");
    }
  }

  // From the origin of the light to the plates' origins, median.
  double LaserDistance(const v1::Vector3& origin) const {
    std::vector<double> distances_m;
    for (const v1::Recording& recording : message_->recordings()) {
      if (!recording.plate_pose().has_translation_m()) continue;
      const v1::Vector3& t = recording.plate_pose().translation_m();
      distances_m.push_back(std::hypot(t.x() - origin.x(), t.y() - origin.y(), t.z() - origin.z()));
    }
    return std::clamp(UpperMedian(std::move(distances_m)), 1e-3, 100.0);
  }

  void AssumeExposure() {
    if (AssumeInRecordings([](const auto& r) { return r.has_exposure_time_s(); },
                           [](auto* r) { r->set_exposure_time_s(kExposure_s); })) {
      Widen("power_relative", 3);
      notes_.push_back(absl::StrFormat(
          "recordings[].exposure_time_s is not stated: %.3g s is assumed for all of them; only its "
          "product with laser.power_w counts, which is fitted",
          kExposure_s));
    }
    if (AssumeInRecordings([](const auto& r) { return r.has_f_number(); },
                           [](auto* r) { r->set_f_number(kFNumber); })) {
      Widen("f_number_relative", kFNumberRelative);
      notes_.push_back(absl::StrFormat(
          "recordings[].f_number is not stated: %.3g +- %.3g %% is assumed for all of them, and "
          "fitted",
          kFNumber, 100 * kFNumberRelative));
    }
    int position = 0;
    for (const v1::Recording& recording : message_->recordings()) {
      position = std::max(position, recording.plate_position_id());
    }
    for (v1::Recording& recording : *message_->mutable_recordings()) {
      if (recording.kind() == "dark" || recording.has_plate_position_id()) continue;
      recording.set_plate_position_id(++position);  // not known to be where another was
    }
  }

  // Says once for all recordings that miss a field.
  template <typename Has, typename Set>
  bool AssumeInRecordings(const Has& has, const Set& set) {
    bool missing = false;
    for (v1::Recording& recording : *message_->mutable_recordings()) {
      if (has(recording)) continue;
      set(&recording);
      missing = true;
    }
    return missing;
  }

  void AssumeDistances() {
    if (AssumeInRecordings([](const auto& r) { return r.has_focus_distance_m(); },
                           [](auto* r) { r->set_focus_distance_m(r->camera_distance_m()); })) {
      Widen("focus_distance_relative", kFocusRelative);
      notes_.push_back(absl::StrFormat(
          "recordings[].focus_distance_m is not stated: the camera is assumed to be "
          "focused on the plate +- %.3g %%, which is fitted",
          100 * kFocusRelative));
    }
    if (AssumeInRecordings([](const auto& r) { return r.has_laser_distance_m(); },
                           [](auto* r) { r->set_laser_distance_m(r->camera_distance_m()); })) {
      Widen("laser_distance_m", kLaserDistanceUncertainty_m);
      notes_.push_back(absl::StrFormat(
          "recordings[].laser_distance_m is not stated: the distance of the camera is assumed "
          "+- %.3g m, which is fitted",
          kLaserDistanceUncertainty_m));
    }
    if (!message_->laser().has_beam_focus_distance_m() && !message_->recordings().empty()) {
      const double distance = message_->recordings(0).laser_distance_m();
      message_->mutable_laser()->set_beam_focus_distance_m(distance);
      Widen("beam_focus_distance_m", kBeamFocusUncertainty_m);
      Note("laser.beam_focus_distance_m", distance, " m",
           PlusMinus("beam_focus_distance_m", kBeamFocusUncertainty_m, " m"));
    }
    if (AssumeInRecordings([](const auto& r) { return r.has_line_offset_m(); },
                           [](auto* r) { r->set_line_offset_m(0); })) {
      notes_.emplace_back("recordings[].line_offset_m is not stated: 0 m is assumed");
    }
  }

  void AssumeOrder() {
    double time_s = 0;
    bool times_missing = false;
    int group = 0;
    for (const v1::Recording& recording : message_->recordings()) {
      group = std::max(group, recording.repeat_group());
    }
    for (v1::Recording& recording : *message_->mutable_recordings()) {
      if (!recording.has_timestamp_s()) {
        recording.set_timestamp_s(time_s);
        times_missing = true;
      }
      time_s = std::max(time_s, recording.timestamp_s()) + 1;
      if (!recording.has_burst_frame_index()) recording.set_burst_frame_index(0);
      if (!recording.has_same_speckle()) recording.set_same_speckle(false);
      // A group of its own: not known to be a repetition.
      if (!recording.has_repeat_group()) recording.set_repeat_group(++group);
    }
    if (times_missing) {
      notes_.emplace_back(
          "recordings[].timestamp_s is not stated: one recording per second is assumed; "
          "changes with time cannot be determined");
    }
  }

  v1::Recordings* message_;
  std::vector<std::string> notes_;
};

}  // namespace

std::vector<std::string> AssumeMissingValues(v1::Recordings* message) {
  if (message->format_version() != 1 && message->format_version() != 3) return {};
  return Completion(message).Run();
}

}  // namespace sightline
