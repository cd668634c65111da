// SPDX-License-Identifier: Apache-2.0
#include "core/calibration_set/calibration_set.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

using testing::HasSubstr;

// Reads a set without images whose `assumed` is this.
absl::Status ReadWithAssumed(const std::string& assumed) {
  const auto folder =
      std::filesystem::temp_directory_path() / absl::StrCat("calibration_set_", getpid());
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "calibration_set.json") << absl::StrCat(
      R"({"format": "laser-line-calibration", "format_version": 1, "name": "set",
          "checkerboard": {"inner_corners_x": 8, "inner_corners_y": 6, "square_m": 0.01},
          "frames": {"images": "frame*.png"}, "assumed": )",
      assumed, "}");
  const absl::Status status = ReadCalibrationSet(folder.string()).status();
  std::filesystem::remove_all(folder);
  return status;
}

TEST(CalibrationSet, RefusesAssumedValuesThatNoDeviceHas) {
  for (const auto& [assumed, message] :
       {std::pair(R"({"pixel_pitch_m": 5.3})", "assumed.pixel_pitch_m is 5.3"),
        std::pair(R"({"f_number": -8})", "assumed.f_number is -8"),
        std::pair(R"({"wavelength_m": 660})", "assumed.wavelength_m is 660"),
        std::pair(R"({"pixel_pitch_m": 5.3e-6, "sensor": {"pixel_pitch_m": 1.06e-5}})",
                  "but assumed.sensor has")}) {
    EXPECT_THAT(std::string(ReadWithAssumed(assumed).message()), HasSubstr(message));
  }
  // The next thing that is missing: the frames.
  EXPECT_THAT(std::string(ReadWithAssumed(R"({"pixel_pitch_m": 5.3e-6, "f_number": 8})").message()),
              HasSubstr("frames.images"));
}

}  // namespace
}  // namespace sightline
