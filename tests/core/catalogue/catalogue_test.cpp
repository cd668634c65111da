// SPDX-License-Identifier: Apache-2.0
#include "core/catalogue/catalogue.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "core/catalogue/combination.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr char kCamera[] = R"({"name": "Cam", "mount": "C", "sensor_type": "mono",
  "pixel_pitch_m": 3.45e-6, "sensor_columns_px": 2448, "sensor_rows_px": 2048, "bit_depth_bit": 12,
  "gain_dn_per_electron": 0.37, "saturation_capacity_electrons": 10500, "dark_noise_electrons": 2.4,
  "max_frame_rate_hz": 75, "price_eur": 900, "quantum_efficiency": {"mono": 0.6}})";
constexpr char kLens[] = R"({"name": "Lens", "mount": "C", "focal_length_m": 0.016,
  "min_f_number": 1.6, "max_f_number": 16, "min_focus_distance_m": 0.1, "image_circle_m": 0.011,
  "transmission": 0.9, "aperture_blades": 6, "distortion": {"k1": -0.1}, "price_eur": 300})";
constexpr char kLaser[] = R"({"name": "Laser", "safety_class": "3R", "price_eur": 700, "laser": {
  "fan_angle_deg": 30, "wavelength_m": 660e-9, "power_w": 0.05, "divergence_rad": 0.002,
  "beam_focus_distance_m": 0.4}})";

constexpr char kProfileSensor[] = R"({"name": "Head", "near_distance_m": 0.2, "far_distance_m": 0.4,
  "near_width_m": 0.1, "far_width_m": 0.2, "points_per_profile": 1280, "wavelength_m": 660e-9,
  "triangulation_angle_deg": 30, "safety_class": "2M", "price_eur": 9000})";

void WriteText(const fs::path& file, const std::string& text) {
  fs::create_directories(file.parent_path());
  std::ofstream(file) << text;
}

std::string Replaced(const std::string& text, const std::string& from, const std::string& to) {
  EXPECT_THAT(text, HasSubstr(from));
  return absl::StrReplaceAll(text, {{from, to}});
}

// A catalogue in a temporary folder with one device of each kind.
class CatalogueFolder : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) / absl::StrCat("catalogue_", std::random_device()());
    Write("cameras/a.json", kCamera);
    Write("lenses/a.json", kLens);
    Write("lasers/a.json", kLaser);
  }
  void TearDown() override { fs::remove_all(folder_); }

  void Write(const std::string& file, const std::string& text) { WriteText(folder_ / file, text); }
  absl::StatusOr<Catalogue> Read() const { return ReadCatalogue(folder_.string()); }
  std::string Error() const {
    const auto catalogue = Read();
    EXPECT_EQ(catalogue.status().code(), absl::StatusCode::kInvalidArgument);
    return std::string(catalogue.status().message());
  }

  fs::path folder_;
};

TEST_F(CatalogueFolder, ReadsEveryField) {
  const auto catalogue = Read();
  ASSERT_TRUE(catalogue.ok()) << catalogue.status();
  ASSERT_EQ(catalogue->cameras.size(), 1u);
  const DeviceCamera& camera = catalogue->cameras[0];
  EXPECT_EQ(camera.sensor.name, "Cam");
  EXPECT_EQ(camera.sensor.columns_px, 2448);
  EXPECT_EQ(camera.mount, "C");
  EXPECT_EQ(camera.max_frame_rate_hz, 75);
  EXPECT_EQ(camera.price_eur, 900);
  EXPECT_EQ(camera.file, (folder_ / "cameras/a.json").string());
  EXPECT_EQ(camera.message.name(), "Cam");

  ASSERT_EQ(catalogue->lenses.size(), 1u);
  const DeviceLens& lens = catalogue->lenses[0];
  EXPECT_EQ(lens.name, "Lens");
  EXPECT_EQ(lens.mount, "C");
  EXPECT_EQ(lens.lens.focal_length_m, 0.016);
  EXPECT_EQ(lens.lens.f_number, 1.6);
  EXPECT_EQ(lens.lens.transmission, 0.9);
  EXPECT_EQ(lens.lens.aperture_blades, 6);
  EXPECT_EQ(lens.lens.distortion.k1, -0.1);
  EXPECT_EQ(lens.min_f_number, 1.6);
  EXPECT_EQ(lens.max_f_number, 16);
  EXPECT_EQ(lens.min_focus_distance_m, 0.1);
  EXPECT_EQ(lens.image_circle_m, 0.011);
  EXPECT_EQ(lens.price_eur, 300);
  EXPECT_EQ(lens.message.focal_length_m(), 0.016);

  ASSERT_EQ(catalogue->lasers.size(), 1u);
  const DeviceLaser& laser = catalogue->lasers[0];
  EXPECT_EQ(laser.name, "Laser");
  EXPECT_NEAR(laser.laser.fan_angle_rad, std::numbers::pi / 6, 1e-15);
  EXPECT_EQ(laser.laser.wavelength_m, 660e-9);
  EXPECT_EQ(laser.safety_class, "3R");
  EXPECT_EQ(laser.price_eur, 700);
  EXPECT_EQ(laser.message.laser().power_w(), 0.05);
}

TEST_F(CatalogueFolder, ReadsProfileSensorsIfThereAreAny) {
  EXPECT_THAT(Read()->profile_sensors, IsEmpty());
  Write("profile_sensors/a.json", kProfileSensor);
  Write("profile_sensors/b.json",
        R"({"name": "Other", "near_distance_m": 0.1, "far_distance_m": 0.2, "near_width_m": 0.05,
            "far_width_m": 0.06, "points_per_profile": 640})");
  const auto catalogue = Read();
  ASSERT_TRUE(catalogue.ok()) << catalogue.status();
  ASSERT_EQ(catalogue->profile_sensors.size(), 2u);
  const DeviceProfileSensor& head = catalogue->profile_sensors[0];
  EXPECT_EQ(head.name, "Head");
  EXPECT_NEAR(head.MiddleDistance(), 0.3, 1e-15);
  EXPECT_NEAR(head.MiddleWidth(), 0.15, 1e-15);
  EXPECT_EQ(head.points_per_profile, 1280);
  EXPECT_EQ(head.wavelength_m, 660e-9);
  EXPECT_NEAR(*head.triangulation_angle_rad, std::numbers::pi / 6, 1e-15);
  EXPECT_EQ(head.safety_class, "2M");
  EXPECT_EQ(head.price_eur, 9000);
  const DeviceProfileSensor& other = catalogue->profile_sensors[1];
  EXPECT_FALSE(other.triangulation_angle_rad || other.wavelength_m || other.price_eur);
}

TEST_F(CatalogueFolder, RefusesWrongProfileSensors) {
  struct Case {
    const char *from, *to, *message;
  };
  const Case cases[] = {
      {R"("near_distance_m": 0.2, )", "", "near_distance_m is missing"},
      {R"("far_distance_m": 0.4)", R"("far_distance_m": 0.2)",
       "far_distance_m is 0.2, must be in (0.2, 10] m"},
      {R"("near_width_m": 0.1)", R"("near_width_m": 0)", "near_width_m is 0"},
      {R"("points_per_profile": 1280)", R"("points_per_profile": 8)",
       "points_per_profile is 8, must be in [16, 16384]"},
      {R"("triangulation_angle_deg": 30)", R"("triangulation_angle_deg": 90)",
       "triangulation_angle_deg is 90, must be in [10, 80] degrees"},
      {"2M", "II", "safety_class is \"II\""},
      {"660e-9", "660", "wavelength_m is 660"},
  };
  for (const Case& c : cases) {
    Write("profile_sensors/a.json", Replaced(kProfileSensor, c.from, c.to));
    EXPECT_THAT(Error(), AllOf(HasSubstr("profile_sensors/a.json"), HasSubstr(c.message)));
  }
}

TEST_F(CatalogueFolder, LeavesWhatADataSheetDoesNotGive) {
  Write("cameras/a.json", Replaced(kCamera, R"("max_frame_rate_hz": 75, "price_eur": 900, )", ""));
  Write("lenses/a.json", R"({"name": "L", "mount": "C", "focal_length_m": 0.016,
    "min_f_number": 1.6, "max_f_number": 16})");
  Write("lasers/a.json", Replaced(kLaser, R"("safety_class": "3R", "price_eur": 700, )", ""));
  const auto catalogue = Read();
  ASSERT_TRUE(catalogue.ok()) << catalogue.status();
  EXPECT_FALSE(catalogue->cameras[0].max_frame_rate_hz || catalogue->cameras[0].price_eur);
  const DeviceLens& lens = catalogue->lenses[0];
  EXPECT_FALSE(lens.min_focus_distance_m || lens.image_circle_m || lens.price_eur);
  EXPECT_FALSE(lens.lens.min_focus_distance_m);
  EXPECT_EQ(lens.lens.transmission, Lens().transmission);
  EXPECT_EQ(lens.lens.aperture_blades, 0);
  EXPECT_EQ(catalogue->lasers[0].safety_class, "");
  EXPECT_FALSE(catalogue->lasers[0].price_eur);
}

// Written in another order than that of their names.
TEST_F(CatalogueFolder, IsInTheOrderOfFileNames) {
  for (const char* name : {"c", "B", "d", "10", "2"}) {
    Write(absl::StrCat("lenses/", name, ".json"), Replaced(kLens, "Lens", name));
  }
  const auto catalogue = Read();
  ASSERT_TRUE(catalogue.ok()) << catalogue.status();
  std::vector<std::string> names;
  for (const DeviceLens& lens : catalogue->lenses) names.push_back(lens.name);
  EXPECT_THAT(names, ElementsAre("10", "2", "B", "Lens", "c", "d"));
}

TEST_F(CatalogueFolder, PassesOverOtherFiles) {
  Write("cameras/README.md", "# no camera");
  Write("cameras/._a.json", "left by a file manager");
  Write("cameras/a.json.orig", "left by an editor");
  Write("cameras/old.json/b.json", "{}");
  Write("templates/camera.json", "{}");
  const auto catalogue = Read();
  ASSERT_TRUE(catalogue.ok()) << catalogue.status();
  EXPECT_EQ(catalogue->cameras.size(), 1u);
}

TEST_F(CatalogueFolder, NamesTheFolderThatIsNotThere) {
  fs::remove_all(folder_);
  const absl::Status status = Read().status();
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(status.message(), absl::StrCat(folder_.string(), ": there is no such folder"));
}

TEST_F(CatalogueFolder, NamesTheKindWithoutAFile) {
  fs::remove(folder_ / "lasers/a.json");
  EXPECT_EQ(Error(), absl::StrCat(folder_.string(), ": lasers/ holds no laser file"));
  fs::remove_all(folder_ / "lenses");
  EXPECT_EQ(Error(), absl::StrCat(folder_.string(), ": lenses/ holds no lens file"));
  fs::rename(folder_ / "cameras/a.json", folder_ / "cameras/a.txt");
  EXPECT_EQ(Error(), absl::StrCat(folder_.string(), ": cameras/ holds no camera file"));
}

TEST_F(CatalogueFolder, HoldsAtMostAThousandFilesOfAKind) {
  for (int i = 1; i < 1000; ++i) {
    Write(absl::StrCat("lenses/", i, ".json"), Replaced(kLens, "Lens", absl::StrCat("L", i)));
  }
  const auto catalogue = Read();
  ASSERT_TRUE(catalogue.ok()) << catalogue.status();
  EXPECT_EQ(catalogue->lenses.size(), 1000u);
  Write("lenses/1000.json", Replaced(kLens, "Lens", "L1000"));
  EXPECT_EQ(Error(),
            absl::StrCat(folder_.string(), ": lenses/ holds 1001 lens files, at most 1000"));
}

TEST_F(CatalogueFolder, RefusesTwoDevicesOfOneName) {
  Write("cameras/b.json", kCamera);
  EXPECT_THAT(Error(), AllOf(HasSubstr("cameras/b.json: name is \"Cam\" like that of"),
                             HasSubstr("cameras/a.json")));
  fs::remove(folder_ / "cameras/b.json");
  // A lens may be called like a camera.
  Write("lenses/a.json", Replaced(kLens, "\"Lens\"", "\"Cam\""));
  EXPECT_TRUE(Read().ok());
}

TEST_F(CatalogueFolder, NamesFileFieldValueAndRange) {
  struct Case {
    const char* file;
    const char* text;
    const char *from, *to;
    const char* message;  // after the file's name
  };
  const Case cases[] = {
      {"cameras", kCamera, R"("name": "Cam", )", "", "name is missing"},
      {"cameras", kCamera, R"("mount": "C", )", "",
       "mount is missing, must be one of C, CS, S, F, EF, M42, M58, TFL"},
      {"cameras", kCamera, R"("mount": "C")", R"("mount": "c")",
       "mount is \"c\", must be one of C, CS"},
      {"cameras", kCamera, R"("max_frame_rate_hz": 75)", R"("max_frame_rate_hz": 0)",
       "max_frame_rate_hz is 0, must be in (0, 1000000] Hz"},
      {"cameras", kCamera, R"("price_eur": 900)", R"("price_eur": 0)",
       "price_eur is 0, must be in (0, 10000000] EUR"},
      {"cameras", kCamera, R"("bit_depth_bit": 12)", R"("bit_depth_bit": 17)",
       "bit_depth_bit is 17"},
      {"cameras", kCamera, R"("bit_depth_bit": 12)", R"("bits": 12)", "bits"},
      {"lenses", kLens, R"("name": "Lens")", R"("name": "")", "name is missing"},
      {"lenses", kLens, R"("mount": "C")", R"("mount": "PL")", "mount is \"PL\", must be one of C"},
      {"lenses", kLens, R"("focal_length_m": 0.016,)", "", "focal_length_m is missing"},
      {"lenses", kLens, R"("min_f_number": 1.6, )", "", "min_f_number is missing"},
      {"lenses", kLens, R"("max_f_number": 16, )", "", "max_f_number is missing"},
      {"lenses", kLens, "0.016", "16", "focal_length_m is 16, must be in [0.001, 0.1) m"},
      {"lenses", kLens, R"("min_f_number": 1.6)", R"("min_f_number": 0.4)",
       "min_f_number is 0.4, must be in [0.5, 128]"},
      {"lenses", kLens, R"("max_f_number": 16)", R"("max_f_number": 1.4)",
       "max_f_number is 1.4, must be in [1.6, 128]"},
      {"lenses", kLens, R"("min_focus_distance_m": 0.1)", R"("min_focus_distance_m": 0.01)",
       "min_focus_distance_m is 0.01, must be in [0.01616, 1000] m"},
      {"lenses", kLens, "0.011", "11", "image_circle_m is 11, must be in [0.001, 0.2] m"},
      {"lenses", kLens, R"("transmission": 0.9)", R"("transmission": 90)",
       "transmission is 90, must be in (0, 1]"},
      {"lenses", kLens, R"("aperture_blades": 6)", R"("aperture_blades": 2)",
       "aperture_blades is 2, must be in [3, 64]"},
      {"lenses", kLens, R"("k1": -0.1)", R"("k1": -11)",
       "distortion.k1 is -11, must be in [-10, 10]"},
      {"lenses", kLens, R"("price_eur": 300)", R"("price_eur": -1)", "price_eur is -1"},
      {"lasers", kLaser, R"("name": "Laser", )", "", "name is missing"},
      {"lasers", kLaser, R"("fan_angle_deg": 30,)", "", "laser.fan_angle_deg is missing"},
      {"lasers", kLaser, R"("wavelength_m": 660e-9,)", "", "laser.wavelength_m is missing"},
      {"lasers", kLaser, R"("power_w": 0.05,)", "", "laser.power_w is missing"},
      {"lasers", kLaser, R"("divergence_rad": 0.002,)", "", "laser.divergence_rad is missing"},
      {"lasers", kLaser, R"(,
  "beam_focus_distance_m": 0.4)",
       "", "laser.beam_focus_distance_m is missing"},
      {"lasers", kLaser, "660e-9", "660", "wavelength_m is 660, must be in"},
      {"lasers", kLaser, R"("power_w": 0.05)", R"("distance_m": 0.4, "power_w": 0.05)",
       "laser.distance_m is given, but where a laser stands is the rig's"},
      {"lasers", kLaser, "3R", "IIIb",
       "safety_class is \"IIIb\", must be one of 1, 1M, 2, 2M, 3R, 3B, 4"},
      {"lasers", kLaser, R"("price_eur": 700)", R"("price_eur": 1e8)", "price_eur is"},
  };
  for (const Case& c : cases) {
    const std::string good = c.text;
    Write(absl::StrCat(c.file, "/a.json"), Replaced(good, c.from, c.to));
    EXPECT_THAT(Error(), AllOf(HasSubstr(absl::StrCat(c.file, "/a.json")), HasSubstr(c.message)));
    Write(absl::StrCat(c.file, "/a.json"), good);
  }
  EXPECT_TRUE(Read().ok());
}

TEST_F(CatalogueFolder, NamesTheLineThatIsNoJson) {
  Write("lenses/a.json", "{\n\"name\": \"Lens\",\n}");
  EXPECT_THAT(Error(), HasSubstr("lenses/a.json"));
}

class ExampleCatalogue : public ::testing::Test {
 protected:
  void SetUp() override {
    const char* root = std::getenv("SIGHTLINE_SOURCE_DIR");
    ASSERT_NE(root, nullptr);
    folder_ = fs::path(root) / "examples/catalogue";
    const auto catalogue = ReadCatalogue(folder_.string());
    ASSERT_TRUE(catalogue.ok()) << catalogue.status();
    catalogue_ = *catalogue;
  }

  size_t FileCount(const char* kind) const {
    size_t count = 0;
    for (const auto& entry : fs::directory_iterator(folder_ / kind)) {
      count += entry.path().extension() == ".json";
    }
    return count;
  }

  fs::path folder_;
  Catalogue catalogue_;
};

TEST_F(ExampleCatalogue, LoadsEveryFileAndEachNamesItsSource) {
  EXPECT_EQ(catalogue_.cameras.size(), FileCount("cameras"));
  EXPECT_EQ(catalogue_.lenses.size(), FileCount("lenses"));
  EXPECT_EQ(catalogue_.lasers.size(), FileCount("lasers"));
  EXPECT_EQ(catalogue_.profile_sensors.size(), FileCount("profile_sensors"));
  for (const DeviceCamera& d : catalogue_.cameras) EXPECT_NE(d.message.source(), "") << d.file;
  for (const DeviceLens& d : catalogue_.lenses) EXPECT_NE(d.message.source(), "") << d.file;
  for (const DeviceLaser& d : catalogue_.lasers) EXPECT_NE(d.message.source(), "") << d.file;
  for (const DeviceProfileSensor& d : catalogue_.profile_sensors) {
    EXPECT_NE(d.message.source(), "") << d.file;
  }
}

// The page lists what is there.
TEST_F(ExampleCatalogue, IsListedInItsReadme) {
  std::ifstream file(folder_ / "README.md");
  const std::string text((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  for (const DeviceCamera& d : catalogue_.cameras) EXPECT_THAT(text, HasSubstr(d.sensor.name));
  for (const DeviceLens& d : catalogue_.lenses) EXPECT_THAT(text, HasSubstr(d.name));
  for (const DeviceLaser& d : catalogue_.lasers) EXPECT_THAT(text, HasSubstr(d.name));
  for (const DeviceProfileSensor& d : catalogue_.profile_sensors) {
    EXPECT_THAT(text, HasSubstr(d.name));
  }
}

// Otherwise there would be nothing to plan: a part of 5 cm, seen from 0.4 m with 50 um a pixel.
TEST_F(ExampleCatalogue, HasACombinationForACommonTask) {
  FitRequirements required;
  required.max_pixel_footprint_m = 50e-6;
  required.min_field_of_view_m = 0.05;
  required.min_depth_of_field_m = 0.01;
  int fits = 0, all = 0;
  for (const DeviceCamera& camera : catalogue_.cameras) {
    for (const DeviceLens& lens : catalogue_.lenses) {
      for (const DeviceLaser& laser : catalogue_.lasers) {
        fits += WhyUnfit(camera, lens, laser, 0.4, required).empty();
        ++all;
      }
    }
  }
  EXPECT_GT(fits, 0);
  EXPECT_LT(fits, all);
}

Sensor SensorOf(double pixel_pitch_m, int columns_px, int rows_px) {
  Sensor sensor;
  sensor.pixel_pitch_m = pixel_pitch_m;
  sensor.columns_px = columns_px;
  sensor.rows_px = rows_px;
  return sensor;
}

Lens LensOf(double focal_length_m) {
  Lens lens;
  lens.focal_length_m = focal_length_m;
  return lens;
}

TEST(Combination, FootprintAndFieldOfViewByHand) {
  // m = 0.02 / (0.42 - 0.02) = 1/20.
  const Sensor sensor = SensorOf(5e-6, 2000, 1000);
  EXPECT_NEAR(PixelFootprint(sensor, LensOf(0.02), 0.42), 100e-6, 1e-15);
  const FieldOfView field = FieldOfViewAt(sensor, LensOf(0.02), 0.42);
  EXPECT_NEAR(field.width_m, 0.2, 1e-13);
  EXPECT_NEAR(field.height_m, 0.1, 1e-13);
  // Twice the focal length away: as large as the image.
  EXPECT_NEAR(PixelFootprint(sensor, LensOf(0.02), 0.04), 5e-6, 1e-18);
}

// Diameter of the disc on the sensor by tracing the two outermost rays of the pupil from a point of
// the axis at s through its image, by the lens equation alone.
double DiscDiameter(double focal_length_m, double f_number, double z_m, double s_m) {
  const double sensor_m = 1 / (1 / focal_length_m - 1 / z_m);
  const double image_m = 1 / (1 / focal_length_m - 1 / s_m);
  const double edge_m = 0.5 * focal_length_m / f_number;
  const double hit_m = edge_m - edge_m / image_m * sensor_m;
  return 2 * std::abs(hit_m);
}

// Root of `function`, monotonic between a and b.
double Root(const std::function<double(double)>& function, double a, double b) {
  for (int i = 0; i < 200; ++i) {
    const double middle = 0.5 * (a + b);
    ((function(middle) > 0) == (function(a) > 0) ? a : b) = middle;
  }
  return 0.5 * (a + b);
}

TEST(Combination, DepthOfFieldIsWhereTheDiscIsTheCircle) {
  int infinite = 0, finite = 0;
  for (const double f : {0.008, 0.016, 0.05}) {
    for (const double z : {0.1, 0.4, 2.0, 20.0}) {
      for (const double f_number : {1.4, 5.6, 16.0}) {
        for (const double circle : {2e-6, 5.86e-6}) {
          SCOPED_TRACE(absl::StrCat("f ", f, " z ", z, " N ", f_number, " c ", circle));
          const auto excess = [&](double s) { return DiscDiameter(f, f_number, z, s) - circle; };
          const DepthOfField depth = DepthOfFieldAt(LensOf(f), z, f_number, circle);
          EXPECT_NEAR(depth.near_m, Root(excess, 1.000001 * f, z), 1e-9 * z);
          if (excess(1e9) > 0) {
            EXPECT_NEAR(depth.far_m, Root(excess, z, 1e9), 1e-6 * depth.far_m);
            EXPECT_EQ(depth.depth_m(), depth.far_m - depth.near_m);
            ++finite;
          } else {
            EXPECT_EQ(depth.far_m, std::numeric_limits<double>::infinity());
            EXPECT_EQ(depth.depth_m(), std::numeric_limits<double>::infinity());
            ++infinite;
          }
          EXPECT_LT(depth.near_m, z);
          EXPECT_GT(depth.far_m, z);
        }
      }
    }
  }
  EXPECT_GT(infinite, 5);
  EXPECT_GT(finite, 20);
}

// The formula of text books: H = f^2 / (N c) + f; near = z (H - f) / (H + z - 2f) and
// far = z (H - f) / (H - z).
TEST(Combination, DepthOfFieldAgreesWithTheHyperfocalDistance) {
  const double f = 0.025, f_number = 8, circle = 3.45e-6;
  const double hyperfocal = f * f / (f_number * circle) + f;
  for (const double z : {0.3, 1.0, 10.0, 0.99 * hyperfocal}) {
    const DepthOfField depth = DepthOfFieldAt(LensOf(f), z, f_number, circle);
    EXPECT_NEAR(depth.near_m, z * (hyperfocal - f) / (hyperfocal + z - 2 * f), 1e-12 * z);
    EXPECT_NEAR(depth.far_m, z * (hyperfocal - f) / (hyperfocal - z), 1e-9 * depth.far_m);
  }
  EXPECT_TRUE(std::isinf(DepthOfFieldAt(LensOf(f), 1.01 * hyperfocal, f_number, circle).far_m));
}

TEST(Combination, IsMonotonic) {
  const Sensor sensor = SensorOf(3.45e-6, 2448, 2048);
  const Lens lens = LensOf(0.016);
  double footprint = 0, width = 0, depth = 0;
  for (double z = 0.1; z < 3; z *= 1.1) {
    EXPECT_GT(PixelFootprint(sensor, lens, z), footprint);
    EXPECT_GT(FieldOfViewAt(sensor, lens, z).width_m, width);
    EXPECT_GT(DepthOfFieldAt(lens, z, 4, 3.45e-6).depth_m(), depth);
    footprint = PixelFootprint(sensor, lens, z);
    width = FieldOfViewAt(sensor, lens, z).width_m;
    depth = DepthOfFieldAt(lens, z, 4, 3.45e-6).depth_m();
  }
  depth = 0;
  for (double f_number = 1.4; f_number < 23; f_number *= std::numbers::sqrt2) {
    EXPECT_GT(DepthOfFieldAt(lens, 0.4, f_number, 3.45e-6).depth_m(), depth);
    depth = DepthOfFieldAt(lens, 0.4, f_number, 3.45e-6).depth_m();
  }
  depth = 0;
  for (double circle = 1e-6; circle < 1e-5; circle *= 1.2) {
    EXPECT_GT(DepthOfFieldAt(lens, 0.4, 4, circle).depth_m(), depth);
    depth = DepthOfFieldAt(lens, 0.4, 4, circle).depth_m();
  }
  // A longer lens sees less, finer and with less depth.
  footprint = width = depth = std::numeric_limits<double>::infinity();
  for (double f = 0.008; f < 0.06; f *= 1.2) {
    EXPECT_LT(PixelFootprint(sensor, LensOf(f), 0.4), footprint);
    EXPECT_LT(FieldOfViewAt(sensor, LensOf(f), 0.4).width_m, width);
    EXPECT_LT(DepthOfFieldAt(LensOf(f), 0.4, 4, 3.45e-6).depth_m(), depth);
    footprint = PixelFootprint(sensor, LensOf(f), 0.4);
    width = FieldOfViewAt(sensor, LensOf(f), 0.4).width_m;
    depth = DepthOfFieldAt(LensOf(f), 0.4, 4, 3.45e-6).depth_m();
  }
}

TEST(Combination, ImageCircleHoldsTheDiagonal) {
  const Sensor sensor = SensorOf(3.45e-6, 2464, 2056);  // 11.07 mm
  EXPECT_NEAR(SensorDiagonal(sensor), 11.072e-3, 1e-6);
  DeviceLens lens;
  EXPECT_TRUE(ImageCircleHolds(lens, sensor));
  lens.image_circle_m = 0.0176;
  EXPECT_TRUE(ImageCircleHolds(lens, sensor));
  lens.image_circle_m = 0.011;  // as printed for 2/3"
  EXPECT_TRUE(ImageCircleHolds(lens, sensor));
  lens.image_circle_m = 0.0109;
  EXPECT_FALSE(ImageCircleHolds(lens, sensor));
  lens.image_circle_m = 0.008;
  EXPECT_FALSE(ImageCircleHolds(lens, sensor));
}

TEST(Combination, MountsFit) {
  for (const std::string& mount : KnownMounts()) {
    EXPECT_EQ(FitOfMounts(mount, mount), MountFit::kFits) << mount;
  }
  EXPECT_EQ(FitOfMounts("C", "CS"), MountFit::kFitsWithRing);
  EXPECT_EQ(FitOfMounts("CS", "C"), MountFit::kDoesNotFit);
  EXPECT_EQ(FitOfMounts("F", "C"), MountFit::kDoesNotFit);
  EXPECT_EQ(FitOfMounts("C", "S"), MountFit::kDoesNotFit);
}

TEST(Combination, FocusesFromItsNearestDistanceOn) {
  DeviceLens lens;
  lens.lens.focal_length_m = 0.016;
  EXPECT_FALSE(FocusesAt(lens, 0.016));
  EXPECT_TRUE(FocusesAt(lens, 0.02));
  lens.min_focus_distance_m = 0.1;
  EXPECT_FALSE(FocusesAt(lens, 0.0999));
  EXPECT_TRUE(FocusesAt(lens, 0.1));
  EXPECT_TRUE(FocusesAt(lens, 1e6));
}

TEST(Combination, LineLength) {
  Laser laser;
  laser.fan_angle_rad = std::numbers::pi / 2;
  EXPECT_NEAR(LineLength(laser, 0.4), 0.8, 1e-15);
}

class Unfit : public ::testing::Test {
 protected:
  Unfit() {
    camera_.mount = "C";
    camera_.sensor = SensorOf(5e-6, 2000, 1000);  // diagonal 11.18 mm
    camera_.sensor.quantum_efficiency[0] = {{500e-9, 900e-9, 1100e-9}, {0.6, 0.1, 0}};
    lens_.mount = "C";
    lens_.lens.focal_length_m = 0.02;
    lens_.min_f_number = 2;
    lens_.max_f_number = 16;
    lens_.min_focus_distance_m = 0.1;
    lens_.image_circle_m = 0.0176;
    laser_.laser.wavelength_m = 660e-9;
    laser_.laser.fan_angle_rad = std::numbers::pi / 6;
  }
  // At 0.42 m a pixel sees 0.1 mm, the camera 200 mm.
  std::vector<std::string> Why() const { return WhyUnfit(camera_, lens_, laser_, z_m_, required_); }

  DeviceCamera camera_;
  DeviceLens lens_;
  DeviceLaser laser_;
  double z_m_ = 0.42;
  FitRequirements required_;
};

TEST_F(Unfit, NothingSpeaksAgainstIt) {
  EXPECT_THAT(Why(), IsEmpty());
  required_ = {0.1001e-3, 0.1999, 0.06};
  EXPECT_THAT(Why(), IsEmpty());
}

TEST_F(Unfit, MountsAndImageCircle) {
  camera_.mount = "CS";
  EXPECT_THAT(Why(), IsEmpty());
  lens_.mount = "F";
  lens_.image_circle_m = 0.0088;
  EXPECT_THAT(Why(), ElementsAre("a lens with F mount does not fit a camera with CS mount",
                                 "the image circle of the lens is 8.8 mm, the sensor's diagonal "
                                 "11.18 mm"));
}

TEST_F(Unfit, Wavelength) {
  laser_.laser.wavelength_m = 1100e-9;
  EXPECT_THAT(Why(), ElementsAre("the camera does not see the laser's 1100 nm"));
}

TEST_F(Unfit, WorkingDistance) {
  z_m_ = 0.09;
  // The pixel footprint there does not count.
  required_.max_pixel_footprint_m = 1e-6;
  EXPECT_THAT(Why(), ElementsAre("the lens focuses no nearer than 100 mm, the working distance is "
                                 "90 mm"));
  lens_.min_focus_distance_m.reset();
  z_m_ = 0.01;
  EXPECT_THAT(Why(), ElementsAre("the lens focuses no nearer than 20 mm, the working distance is "
                                 "10 mm"));
}

TEST_F(Unfit, Requirements) {
  required_.max_pixel_footprint_m = 0.05e-3;
  EXPECT_THAT(Why(), ElementsAre("a pixel sees 0.1 mm at 420 mm, at most 0.05 mm is asked"));
  required_ = {};
  // The line: 2 * 420 mm * tan(15 deg) = 225.1 mm.
  required_.min_field_of_view_m = 0.3;
  EXPECT_THAT(Why(), ElementsAre("the camera sees 200 mm along the laser line at 420 mm, at least "
                                 "300 mm is asked",
                                 "the laser line is 225.1 mm long at 420 mm, at least 300 mm is "
                                 "asked"));
  required_ = {};
  // D b = 0.02 / 16 * 0.021 m^2; 1/0.42 -+ 5e-6 / (D b) per metre.
  const double shift = 5e-6 * 16 / (0.02 * 0.021);
  const double depth_m = 1 / (1 / 0.42 - shift) - 1 / (1 / 0.42 + shift);
  required_.min_depth_of_field_m = 0.999 * depth_m;
  EXPECT_THAT(Why(), IsEmpty());
  required_.min_depth_of_field_m = 0.5;
  EXPECT_THAT(Why(), ElementsAre("depth of field is 67.63 mm at 420 mm even at its smallest "
                                 "aperture, f/16, at least 500 mm is asked"));
}

}  // namespace
}  // namespace sightline
