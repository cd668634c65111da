// SPDX-License-Identifier: Apache-2.0
#include "core/sensor/sensor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>

#include "absl/strings/str_cat.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"
#include "google/protobuf/util/message_differencer.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr char kMono[] = R"("sensor_type": "mono", "pixel_pitch_m": 5.3e-6,
  "sensor_columns_px": 1280, "sensor_rows_px": 1024, "bit_depth_bit": 10,
  "gain_dn_per_electron": 0.16, "saturation_capacity_electrons": 9893, "dark_noise_electrons": 6.5,
  "quantum_efficiency": {"mono": 0.53})";

// Replaces the field of the same name in kMono by `member`, or adds it.
std::string WithMember(const std::string& member) {
  std::string text = kMono;
  const std::string name = member.substr(0, member.find(':'));
  const size_t start = text.find(name + ":");
  if (start == std::string::npos) return absl::StrCat("{", text, ", ", member, "}");
  size_t end = start;
  int depth = 0;
  while (end < text.size() && (depth > 0 || text[end] != ',')) {
    if (text[end] == '{') ++depth;
    if (text[end] == '}') --depth;
    ++end;
  }
  return absl::StrCat("{", text.substr(0, start), member, text.substr(end), "}");
}

absl::StatusOr<Sensor> Parse(const std::string& json) {
  v1::Sensor message;
  SIGHTLINE_RETURN_IF_ERROR(ParseStrictJson(json, "cam.json", &message));
  return ParseSensor(message, "cam.json");
}

std::string SensorErrorOf(const std::string& json) {
  const absl::StatusOr<Sensor> sensor = Parse(json);
  EXPECT_EQ(sensor.status().code(), absl::StatusCode::kInvalidArgument) << json;
  return std::string(sensor.status().message());
}

TEST(Sensor, ReadsAMonoSensorWithDefaults) {
  const auto sensor = Parse(WithMember(R"("prnu_relative": 0.01)"));
  ASSERT_TRUE(sensor.ok()) << sensor.status();
  EXPECT_EQ(sensor->channels(), 1);
  EXPECT_EQ(sensor->gain_dn_per_electron, 0.16);
  EXPECT_EQ(sensor->dark_noise_electrons, 6.5);
  EXPECT_EQ(sensor->largest_dn(), 1023);
  EXPECT_EQ(sensor->prnu_relative, 0.01);
  EXPECT_EQ(sensor->dark_mean_electrons, 0);
  EXPECT_EQ(sensor->dark_current_electrons_per_s, 0);
  EXPECT_EQ(sensor->dark_current_doubling_k, 8);
  EXPECT_EQ(sensor->dark_current_reference_temperature_c, 25);
  EXPECT_EQ(sensor->black_level_dn, 0);
  EXPECT_EQ(sensor->quantum_efficiency[0].At(400e-9), 0.53);
  EXPECT_EQ(sensor->quantum_efficiency[0].At(900e-9), 0.53);
  EXPECT_EQ(sensor->ChannelAt(1, 0), 0);
}

TEST(Sensor, FileErrorsNameTheFieldTheValueAndTheRange) {
  struct Case {
    const char* member;
    std::vector<std::string> parts;
  };
  for (const Case& c : std::vector<Case>{
           {R"("gain_dn_per_electron": 0)", {"gain_dn_per_electron is 0", "(0, 1000000]"}},
           {R"("gain_dn_per_electron": -1)", {"is -1", "(0, 1000000]"}},
           {R"("quantum_efficiency": {"mono": 48})",
            {"quantum_efficiency.mono is 48", "[0, 1]", "48 % write 0.48"}},
           {R"("quantum_efficiency": {"mono": 1.2})", {"quantum_efficiency.mono is 1.2", "[0, 1]"}},
           {R"("quantum_efficiency": {"mono": -0.1})", {"is -0.1", "[0, 1]"}},
           {R"("quantum_efficiency": {"red": 0.5})",
            {"quantum_efficiency.red is given", "mono has only mono"}},
           {R"("quantum_efficiency": {})", {"quantum_efficiency.mono is missing"}},
           {R"("sensor_type": "monochrome")", {"is \"monochrome\"", "did you mean \"mono\""}},
           {R"("sensor_type": "colour")", {"is \"colour\"", "did you mean \"bayer_rggb\""}},
           {R"("sensor_type": "bayer_gbrg")", {"is \"bayer_gbrg\"", "starts with red"}},
           {R"("sensor_type": "")", {"sensor_type is missing"}},
           {R"("bit_depth_bit": 0)", {"bit_depth_bit is 0", "[1, 16] bit"}},
           {R"("bit_depth_bit": 17)", {"bit_depth_bit is 17", "[1, 16] bit"}},
           {R"("pixel_pitch_m": 5.3)", {"pixel_pitch_m is 5.3", "write 5.3e-06"}},
           {R"("sensor_rows_px": 0)", {"sensor_rows_px is 0"}},
           {R"("saturation_capacity_electrons": 0)", {"saturation_capacity_electrons is 0"}},
           {R"("dark_mean_electrons": 9893)", {"dark_mean_electrons is 9893", "must be below"}},
           {R"("dark_noise_electrons": -1)", {"dark_noise_electrons is -1"}},
           {R"("dark_current_doubling_k": 0)", {"dark_current_doubling_k is 0"}},
           {R"("prnu_relative": 1)", {"prnu_relative is 1", "1 % write 0.01"}},
           {R"("black_level_dn": 1024)", {"black_level_dn is 1024", "[0, 1023] DN"}},
           {R"("dsnu_electrons": "NaN")", {"dsnu_electrons"}},
           {R"("quantum_efficiency_curve": [{"wavelength_m": 660, "mono": 0.5}])",
            {"quantum_efficiency_curve[0].wavelength_m is 660", "660 nm write 6.6e-07"}},
           {R"("quantum_efficiency_curve": [{"wavelength_m": 6e-7, "mono": 0.5},
                                            {"wavelength_m": 6e-7, "mono": 0.5}])",
            {"quantum_efficiency_curve[1].wavelength_m is 6e-07", "must be above"}},
           {R"("quantum_efficiency_curve": [{"wavelength_m": 6e-7, "mono": 53}])",
            {"quantum_efficiency_curve[0].mono is 53", "53 % write 0.53"}},
           {R"("gain_dn_per_elektron": 1)", {"\"gain_dn_per_electron\""}},
       }) {
    const std::string error = SensorErrorOf(WithMember(c.member));
    EXPECT_THAT(error, HasSubstr("cam.json")) << c.member;
    for (const std::string& part : c.parts) EXPECT_THAT(error, HasSubstr(part)) << c.member;
  }
}

TEST(Sensor, MissingFieldsAreNamed) {
  EXPECT_THAT(SensorErrorOf(R"({"sensor_type": "mono"})"), HasSubstr("pixel_pitch_m is missing"));
  std::string text = WithMember(R"("quantum_efficiency": {"red": 0.48, "green": 0.09})");
  text.replace(text.find("\"mono\""), 6, "\"bayer_rggb\"");
  EXPECT_THAT(SensorErrorOf(text), AllOf(HasSubstr("quantum_efficiency.blue is missing")));
}

TEST(Sensor, CurvesAreLinearBetweenPointsOfTheirChannelAndConstantBeyond) {
  std::string text = WithMember(
      R"("quantum_efficiency": {"blue": 0.03}, "quantum_efficiency_curve": [
           {"wavelength_m": 4e-7, "red": 0.1, "green": 0.2},
           {"wavelength_m": 5e-7, "green": 0.6},
           {"wavelength_m": 6e-7, "red": 0.5, "green": 0.4}])");
  text.replace(text.find("\"mono\""), 6, "\"bayer_rggb\"");
  const auto sensor = Parse(text);
  ASSERT_TRUE(sensor.ok()) << sensor.status();
  EXPECT_NEAR(sensor->quantum_efficiency[kRed].At(5e-7), 0.3, 1e-15);
  EXPECT_NEAR(sensor->quantum_efficiency[kGreen].At(4.5e-7), 0.4, 1e-15);
  EXPECT_EQ(sensor->quantum_efficiency[kGreen].At(6e-7), 0.4);
  EXPECT_EQ(sensor->quantum_efficiency[kGreen].At(9e-7), 0.4);
  EXPECT_EQ(sensor->quantum_efficiency[kRed].At(3e-7), 0.1);
  EXPECT_EQ(sensor->quantum_efficiency[kBlue].At(3e-7), 0.03);

  // And back.
  const v1::Sensor message = SensorToProto(*sensor);
  const auto again = ParseSensor(message, "");
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_TRUE(google::protobuf::util::MessageDifferencer::Equals(message, SensorToProto(*again)));
  for (int channel = 0; channel < 3; ++channel) {
    EXPECT_EQ(again->quantum_efficiency[channel].quantum_efficiency,
              sensor->quantum_efficiency[channel].quantum_efficiency);
  }
}

TEST(Sensor, BayerPatternStartsWithRedAtEvenPlaces) {
  Sensor sensor;
  sensor.colour_filter = ColourFilter::kBayerRggb;
  for (const int row : {-4, 0, 2}) {
    for (const int column : {-2, 0, 6}) {
      EXPECT_EQ(sensor.ChannelAt(row, column), kRed);
      EXPECT_EQ(sensor.ChannelAt(row, column + 1), kGreen);
      EXPECT_EQ(sensor.ChannelAt(row + 1, column), kGreen);
      EXPECT_EQ(sensor.ChannelAt(row - 1, column - 1), kBlue);
    }
  }
}

TEST(Sensor, MissingFileIsNotFound) {
  EXPECT_EQ(ReadSensorFile("/nonexistent/camera.json").status().code(),
            absl::StatusCode::kNotFound);
}

// Table 5.3 of the thesis, at 660 nm.
TEST(SensorCatalogue, HoldsBothSensorsOfTheThesis) {
  const char* root = std::getenv("SIGHTLINE_SOURCE_DIR");
  ASSERT_NE(root, nullptr);
  const std::string folder = std::string(root) + "/examples/catalogue/cameras/";

  const auto colour = ReadSensorFile(folder + "bfly_pge_23s6c.json");
  ASSERT_TRUE(colour.ok()) << colour.status();
  EXPECT_EQ(colour->colour_filter, ColourFilter::kBayerRggb);
  EXPECT_EQ(colour->pixel_pitch_m, 5.86e-6);
  EXPECT_EQ(colour->columns_px, 1920);
  EXPECT_EQ(colour->rows_px, 1200);
  EXPECT_EQ(colour->gain_dn_per_electron, 0.53);
  EXPECT_EQ(colour->saturation_capacity_electrons, 33456);
  EXPECT_EQ(colour->dark_mean_electrons, 15.06);
  EXPECT_EQ(colour->bit_depth_bit, 10);
  EXPECT_NEAR(colour->quantum_efficiency[kRed].At(660e-9), 0.48, 1e-12);
  EXPECT_NEAR(colour->quantum_efficiency[kGreen].At(660e-9), 0.09, 1e-12);
  EXPECT_NEAR(colour->quantum_efficiency[kBlue].At(660e-9), 0.03, 1e-12);

  const auto mono = ReadSensorFile(folder + "bfly_pge_13e4m.json");
  ASSERT_TRUE(mono.ok()) << mono.status();
  EXPECT_EQ(mono->colour_filter, ColourFilter::kMono);
  EXPECT_EQ(mono->pixel_pitch_m, 5.3e-6);
  EXPECT_EQ(mono->columns_px, 1280);
  EXPECT_EQ(mono->rows_px, 1024);
  EXPECT_EQ(mono->gain_dn_per_electron, 0.16);
  EXPECT_EQ(mono->saturation_capacity_electrons, 9893);
  EXPECT_EQ(mono->dark_mean_electrons, 27.57);
  EXPECT_EQ(mono->bit_depth_bit, 10);
  EXPECT_NEAR(mono->quantum_efficiency[0].At(660e-9), 0.53, 1e-12);

  EXPECT_TRUE(ReadSensorFile(folder + "../templates/camera.json").ok());
}

}  // namespace
}  // namespace sightline
