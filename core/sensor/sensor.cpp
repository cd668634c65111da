// SPDX-License-Identifier: Apache-2.0
#include "core/sensor/sensor.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "core/field_limits/field_checks.h"
#include "core/field_limits/imaging_limits.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"
#include "core/text/number_text.h"

namespace sightline {
namespace {

constexpr Limits kSensorSize{1, 65536, " px"};
constexpr Limits kBitDepth{1, 16, " bit"};
constexpr Limits kGain{0, 1e6, " DN per electron", true};
constexpr Limits kElectrons{0, 1e9, " electrons"};
constexpr Limits kSaturation{0, 1e9, " electrons", true};
constexpr Limits kDarkCurrent{0, 1e9, " electrons/s"};
constexpr Limits kReferenceTemperature{-273.15, 200, " degrees Celsius"};
constexpr Limits kDoubling{0, 100, " K", true};
constexpr Limits kFraction{0, 1, ""};
// Beyond this the normal law of the sensitivities has no meaning: some would be negative.
constexpr Limits kPrnu{0, 0.3, ""};
constexpr Limits kEfficiencyWavelength{1e-7, 2e-6, " m"};

constexpr const char* kChannelNames[2][3] = {{"mono", "", ""}, {"red", "green", "blue"}};

// A hint if the value is in range once taken for another unit than the field's.
std::string UnitHint(double value, double factor, const Limits& limits, const std::string& unit) {
  if (!(value > 0) || !limits.Contains(value * factor)) return "";
  return absl::StrCat("for ", NumberText(value), " ", unit, " write ", value * factor);
}

// `hint` follows the message; empty or a whole clause.
absl::Status CheckRange(const Checker& check, const std::string& path, double value,
                        const Limits& limits, const std::string& hint) {
  absl::Status status = check.Range(path, value, limits);
  if (status.ok() || hint.empty()) return status;
  return absl::InvalidArgumentError(absl::StrCat(std::string(status.message()), "; ", hint));
}

absl::Status CheckFraction(const Checker& check, const std::string& path, double value,
                           const Limits& limits) {
  return CheckRange(check, path, value, limits, UnitHint(value, 0.01, limits, "%"));
}

absl::StatusOr<ColourFilter> ParseSensorType(const std::string& type, const Checker& check) {
  if (type == "mono") return ColourFilter::kMono;
  if (type == "bayer_rggb") return ColourFilter::kBayerRggb;
  if (type.empty()) {
    return check.Error("sensor_type", "is missing, must be \"mono\" or \"bayer_rggb\"");
  }
  const std::string lower = absl::AsciiStrToLower(type);
  const auto has = [&](const char* part) { return lower.find(part) != std::string::npos; };
  // Another order of the filters is no slip of the pen.
  if (has("grbg") || has("gbrg") || has("bggr")) {
    return check.Error("sensor_type",
                       absl::StrCat("is \"", type,
                                    "\", must be \"mono\" or \"bayer_rggb\"; leave out the first "
                                    "row or column of the sensor so that it starts with red"));
  }
  const bool mono = has("mono") || has("grey") || has("gray") || has("b/w");
  return check.Error("sensor_type", absl::StrCat("is \"", type,
                                                 "\", must be \"mono\" or \"bayer_rggb\"; did you "
                                                 "mean \"",
                                                 mono ? "mono" : "bayer_rggb", "\"?"));
}

// mono, red, green, blue of a message that has these optional fields.
template <typename Message>
std::array<std::optional<double>, 4> ChannelValues(const Message& m) {
  std::array<std::optional<double>, 4> values;
  if (m.has_mono()) values[0] = m.mono();
  if (m.has_red()) values[1] = m.red();
  if (m.has_green()) values[2] = m.green();
  if (m.has_blue()) values[3] = m.blue();
  return values;
}

// Checks the range of what is given and that it belongs to this type of sensor.
template <typename Message>
absl::StatusOr<std::array<std::optional<double>, 3>> ParseChannelValues(const Message& message,
                                                                        bool mono,
                                                                        const std::string& path,
                                                                        const Checker& check) {
  const std::array<std::optional<double>, 4> given = ChannelValues(message);
  std::array<std::optional<double>, 3> values;
  for (int i = 0; i < 4; ++i) {
    if (!given[i]) continue;
    const bool mono_field = i == 0;
    const char* name = mono_field ? kChannelNames[0][0] : kChannelNames[1][i - 1];
    const std::string field = absl::StrCat(path, ".", name);
    if (mono_field != mono) {
      return check.Error(
          field, absl::StrCat("is given, but a sensor of type ",
                              mono ? "mono has only mono" : "bayer_rggb has red, green and blue"));
    }
    SIGHTLINE_RETURN_IF_ERROR(CheckFraction(check, field, *given[i], kFraction));
    values[mono_field ? 0 : i - 1] = given[i];
  }
  return values;
}

absl::Status ParseQuantumEfficiency(const v1::Sensor& message, const Checker& check,
                                    Sensor* sensor) {
  const bool mono = sensor->colour_filter == ColourFilter::kMono;
  for (int i = 0; i < message.quantum_efficiency_curve_size(); ++i) {
    const v1::Sensor::QuantumEfficiencyPoint& point = message.quantum_efficiency_curve(i);
    const std::string path = absl::StrCat("quantum_efficiency_curve[", i, "]");
    const double wavelength = point.wavelength_m();
    SIGHTLINE_RETURN_IF_ERROR(CheckRange(check, path + ".wavelength_m", wavelength,
                                         kEfficiencyWavelength,
                                         UnitHint(wavelength, 1e-9, kEfficiencyWavelength, "nm")));
    if (i > 0 && wavelength <= message.quantum_efficiency_curve(i - 1).wavelength_m()) {
      return check.Error(
          path + ".wavelength_m",
          absl::StrCat("is ", NumberText(wavelength), " m, must be above that of the point before ",
                       "it, ", NumberText(message.quantum_efficiency_curve(i - 1).wavelength_m()),
                       " m"));
    }
    SIGHTLINE_ASSIGN_OR_RETURN(const auto values, ParseChannelValues(point, mono, path, check));
    for (int channel = 0; channel < sensor->channels(); ++channel) {
      if (!values[channel]) continue;
      sensor->quantum_efficiency[channel].wavelength_m.push_back(wavelength);
      sensor->quantum_efficiency[channel].quantum_efficiency.push_back(*values[channel]);
    }
  }
  SIGHTLINE_ASSIGN_OR_RETURN(
      const auto values,
      ParseChannelValues(message.quantum_efficiency(), mono, "quantum_efficiency", check));
  for (int channel = 0; channel < sensor->channels(); ++channel) {
    QuantumEfficiencyCurve& curve = sensor->quantum_efficiency[channel];
    if (!curve.wavelength_m.empty()) continue;
    const char* name = kChannelNames[mono ? 0 : 1][channel];
    if (!values[channel]) {
      return check.Error(
          absl::StrCat("quantum_efficiency.", name),
          absl::StrCat("is missing, and quantum_efficiency_curve has no ", name, " either"));
    }
    curve = {{0}, {*values[channel]}};
  }
  return absl::OkStatus();
}

// The times of the camera file, which images do not depend on.
absl::Status CheckExposureTimes(const v1::Sensor& message, const Checker& check) {
  if (message.has_min_exposure_time_s()) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range("min_exposure_time_s", message.min_exposure_time_s(), kExposureTime));
  }
  if (message.has_max_exposure_time_s()) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range("max_exposure_time_s", message.max_exposure_time_s(), kExposureTime));
  }
  if (message.has_min_exposure_time_s() && message.has_max_exposure_time_s() &&
      message.min_exposure_time_s() > message.max_exposure_time_s()) {
    return check.Error("min_exposure_time_s",
                       absl::StrCat("is ", NumberText(message.min_exposure_time_s()),
                                    " s, must be at most max_exposure_time_s, ",
                                    NumberText(message.max_exposure_time_s()), " s"));
  }
  return absl::OkStatus();
}

}  // namespace

double QuantumEfficiencyCurve::At(double wavelength) const {
  assert(!wavelength_m.empty() && wavelength_m.size() == quantum_efficiency.size());
  const auto above = std::upper_bound(wavelength_m.begin(), wavelength_m.end(), wavelength);
  if (above == wavelength_m.begin()) return quantum_efficiency.front();
  if (above == wavelength_m.end()) return quantum_efficiency.back();
  const size_t i = above - wavelength_m.begin();
  const double share = (wavelength - wavelength_m[i - 1]) / (wavelength_m[i] - wavelength_m[i - 1]);
  return (1 - share) * quantum_efficiency[i - 1] + share * quantum_efficiency[i];
}

int Sensor::ChannelAt(int row, int column) const {
  if (colour_filter == ColourFilter::kMono) return 0;
  const int odd_row = row & 1, odd_column = column & 1;
  return odd_row == odd_column ? (odd_row ? kBlue : kRed) : kGreen;
}

int MostSensitiveChannel(const Sensor& sensor, double wavelength_m) {
  int best = 0;
  for (int channel = 1; channel < sensor.channels(); ++channel) {
    if (sensor.quantum_efficiency[channel].At(wavelength_m) >
        sensor.quantum_efficiency[best].At(wavelength_m)) {
      best = channel;
    }
  }
  return best;
}

absl::StatusOr<Sensor> ParseSensor(const v1::Sensor& message, const std::string& context) {
  const Checker check(context);
  Sensor sensor;
  sensor.name = message.name();
  SIGHTLINE_ASSIGN_OR_RETURN(sensor.colour_filter, ParseSensorType(message.sensor_type(), check));

  for (const auto& [given, name] :
       {std::pair(message.has_pixel_pitch_m(), "pixel_pitch_m"),
        std::pair(message.has_sensor_columns_px(), "sensor_columns_px"),
        std::pair(message.has_sensor_rows_px(), "sensor_rows_px"),
        std::pair(message.has_bit_depth_bit(), "bit_depth_bit"),
        std::pair(message.has_gain_dn_per_electron(), "gain_dn_per_electron"),
        std::pair(message.has_saturation_capacity_electrons(), "saturation_capacity_electrons"),
        std::pair(message.has_dark_noise_electrons(), "dark_noise_electrons")}) {
    if (!given) return check.Error(name, "is missing");
  }
  const auto optional = [](bool given, double value, double* target) {
    if (given) *target = value;
  };
  sensor.pixel_pitch_m = message.pixel_pitch_m();
  sensor.columns_px = message.sensor_columns_px();
  sensor.rows_px = message.sensor_rows_px();
  sensor.bit_depth_bit = message.bit_depth_bit();
  sensor.gain_dn_per_electron = message.gain_dn_per_electron();
  sensor.saturation_capacity_electrons = message.saturation_capacity_electrons();
  sensor.dark_noise_electrons = message.dark_noise_electrons();
  optional(message.has_dark_mean_electrons(), message.dark_mean_electrons(),
           &sensor.dark_mean_electrons);
  optional(message.has_dark_current_electrons_per_s(), message.dark_current_electrons_per_s(),
           &sensor.dark_current_electrons_per_s);
  optional(message.has_dark_current_reference_temperature_c(),
           message.dark_current_reference_temperature_c(),
           &sensor.dark_current_reference_temperature_c);
  optional(message.has_dark_current_doubling_k(), message.dark_current_doubling_k(),
           &sensor.dark_current_doubling_k);
  optional(message.has_prnu_relative(), message.prnu_relative(), &sensor.prnu_relative);
  optional(message.has_dsnu_electrons(), message.dsnu_electrons(), &sensor.dsnu_electrons);
  optional(message.has_black_level_dn(), message.black_level_dn(), &sensor.black_level_dn);

  SIGHTLINE_RETURN_IF_ERROR(
      CheckRange(check, "pixel_pitch_m", sensor.pixel_pitch_m, kPixelPitch,
                 UnitHint(sensor.pixel_pitch_m, 1e-6, kPixelPitch, "micrometres")));
  SIGHTLINE_RETURN_IF_ERROR(check.Range("sensor_columns_px", sensor.columns_px, kSensorSize));
  SIGHTLINE_RETURN_IF_ERROR(check.Range("sensor_rows_px", sensor.rows_px, kSensorSize));
  SIGHTLINE_RETURN_IF_ERROR(check.Range("bit_depth_bit", sensor.bit_depth_bit, kBitDepth));
  SIGHTLINE_RETURN_IF_ERROR(
      CheckRange(check, "gain_dn_per_electron", sensor.gain_dn_per_electron, kGain,
                 sensor.gain_dn_per_electron == 0 ? "no number would ever differ from the black "
                                                    "level; data sheets that give electrons per "
                                                    "DN give its reciprocal"
                                                  : ""));
  SIGHTLINE_RETURN_IF_ERROR(check.Range("saturation_capacity_electrons",
                                        sensor.saturation_capacity_electrons, kSaturation));
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range("dark_mean_electrons", sensor.dark_mean_electrons, kElectrons));
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range("dark_noise_electrons", sensor.dark_noise_electrons, kElectrons));
  SIGHTLINE_RETURN_IF_ERROR(check.Range("dark_current_electrons_per_s",
                                        sensor.dark_current_electrons_per_s, kDarkCurrent));
  SIGHTLINE_RETURN_IF_ERROR(check.Range("dark_current_reference_temperature_c",
                                        sensor.dark_current_reference_temperature_c,
                                        kReferenceTemperature));
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range("dark_current_doubling_k", sensor.dark_current_doubling_k, kDoubling));
  SIGHTLINE_RETURN_IF_ERROR(CheckFraction(check, "prnu_relative", sensor.prnu_relative, kPrnu));
  SIGHTLINE_RETURN_IF_ERROR(check.Range("dsnu_electrons", sensor.dsnu_electrons, kElectrons));
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range("black_level_dn", sensor.black_level_dn, {0, sensor.largest_dn(), " DN"}));
  if (sensor.dark_mean_electrons >= sensor.saturation_capacity_electrons) {
    return check.Error("dark_mean_electrons",
                       absl::StrCat("is ", NumberText(sensor.dark_mean_electrons),
                                    ", must be below saturation_capacity_electrons, ",
                                    NumberText(sensor.saturation_capacity_electrons)));
  }
  SIGHTLINE_RETURN_IF_ERROR(CheckExposureTimes(message, check));
  SIGHTLINE_RETURN_IF_ERROR(ParseQuantumEfficiency(message, check, &sensor));
  return sensor;
}

absl::StatusOr<Sensor> ReadSensorFile(const std::string& path) {
  v1::Sensor message;
  SIGHTLINE_RETURN_IF_ERROR(ReadStrictJsonFile(path, &message));
  return ParseSensor(message, path);
}

v1::Sensor SensorToProto(const Sensor& sensor) {
  v1::Sensor message;
  const bool mono = sensor.colour_filter == ColourFilter::kMono;
  message.set_name(sensor.name);
  message.set_sensor_type(mono ? "mono" : "bayer_rggb");
  message.set_pixel_pitch_m(sensor.pixel_pitch_m);
  message.set_sensor_columns_px(sensor.columns_px);
  message.set_sensor_rows_px(sensor.rows_px);
  message.set_bit_depth_bit(sensor.bit_depth_bit);
  message.set_gain_dn_per_electron(sensor.gain_dn_per_electron);
  message.set_saturation_capacity_electrons(sensor.saturation_capacity_electrons);
  message.set_dark_mean_electrons(sensor.dark_mean_electrons);
  message.set_dark_noise_electrons(sensor.dark_noise_electrons);
  message.set_dark_current_electrons_per_s(sensor.dark_current_electrons_per_s);
  message.set_dark_current_reference_temperature_c(sensor.dark_current_reference_temperature_c);
  message.set_dark_current_doubling_k(sensor.dark_current_doubling_k);
  message.set_prnu_relative(sensor.prnu_relative);
  message.set_dsnu_electrons(sensor.dsnu_electrons);
  message.set_black_level_dn(sensor.black_level_dn);

  const auto set = [mono](auto* target, int channel, double value) {
    if (mono) {
      target->set_mono(value);
    } else if (channel == kRed) {
      target->set_red(value);
    } else if (channel == kGreen) {
      target->set_green(value);
    } else {
      target->set_blue(value);
    }
  };
  // A curve of one point is the same at all wavelengths.
  std::vector<double> wavelengths_m;
  for (int channel = 0; channel < sensor.channels(); ++channel) {
    const QuantumEfficiencyCurve& curve = sensor.quantum_efficiency[channel];
    if (curve.wavelength_m.size() == 1) {
      set(message.mutable_quantum_efficiency(), channel, curve.quantum_efficiency[0]);
    } else {
      wavelengths_m.insert(wavelengths_m.end(), curve.wavelength_m.begin(),
                           curve.wavelength_m.end());
    }
  }
  std::sort(wavelengths_m.begin(), wavelengths_m.end());
  wavelengths_m.erase(std::unique(wavelengths_m.begin(), wavelengths_m.end()), wavelengths_m.end());
  for (const double wavelength : wavelengths_m) {
    v1::Sensor::QuantumEfficiencyPoint* point = message.add_quantum_efficiency_curve();
    point->set_wavelength_m(wavelength);
    for (int channel = 0; channel < sensor.channels(); ++channel) {
      const QuantumEfficiencyCurve& curve = sensor.quantum_efficiency[channel];
      if (curve.wavelength_m.size() == 1) continue;
      const auto found =
          std::lower_bound(curve.wavelength_m.begin(), curve.wavelength_m.end(), wavelength);
      if (found == curve.wavelength_m.end() || *found != wavelength) continue;
      set(point, channel, curve.quantum_efficiency[found - curve.wavelength_m.begin()]);
    }
  }
  return message;
}

}  // namespace sightline
