// SPDX-License-Identifier: Apache-2.0
#include "render_worker/material/height_field.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <string>
#include <vector>

#include "tests/render_worker/material/material_fixture.h"
#include "tests/render_worker/material/write_png16.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr double kPitch = 2e-6;
constexpr double kAmplitude = 1e-6;
constexpr int kPeriod = 32;  // samples
constexpr int kSize = 257;   // samples: 256 cells, eight periods

HeightField Cosine() {
  Image<float> heights(kSize, kSize);
  for (int row = 0; row < kSize; ++row) {
    for (int column = 0; column < kSize; ++column) {
      heights.At(row, column) =
          static_cast<float>(kAmplitude * std::cos(2 * std::numbers::pi * column / kPeriod));
    }
  }
  return HeightField(std::move(heights), kPitch);
}

struct SlopeStatistics {
  double mean = 0, deviation = 0, deviation_v = 0, lost = 0;
};
SlopeStatistics Statistics(const HeightField& field, double footprint_m) {
  SlopeStatistics s;
  constexpr int kPlaces = 20000;
  for (int i = 0; i < kPlaces; ++i) {
    CounterRandom random(1, i);
    const HeightField::Patch patch =
        field.At((random.Uniform() * 4 - 2) * kSize * kPitch,
                 (random.Uniform() * 4 - 2) * kSize * kPitch, footprint_m);
    s.mean += patch.slope_u / kPlaces;
    s.deviation += patch.slope_u * patch.slope_u / kPlaces;
    s.deviation_v += patch.slope_v * patch.slope_v / kPlaces;
    s.lost += patch.lost_slope_variance / kPlaces;
  }
  s.deviation = std::sqrt(s.deviation);
  return s;
}

TEST(HeightField, SlopesOfACosine) {
  const HeightField field = Cosine();
  // One sample more than whole periods adds (1 - 1/2)/257 to the variance.
  EXPECT_NEAR(field.height_deviation_m() / kAmplitude, std::sqrt(0.5 + 0.5 / 257), 1e-4);
  const double k = 2 * std::numbers::pi / (kPeriod * kPitch);
  const double rms = kAmplitude * k / std::sqrt(2);
  const SlopeStatistics s = Statistics(field, 0);
  // Differences over one pitch see sin(x/2)/(x/2) of the slope, x = 2 pi/period; bilinear
  // interpolation to a random place leaves (2 + cos x)/3 of the variance. Standard error of the
  // deviation of a sine at random places: relative sqrt(1/2/places)/2.
  const double x = 2 * std::numbers::pi / kPeriod;
  EXPECT_NEAR(s.deviation / (rms * std::sin(x / 2) / (x / 2) * std::sqrt((2 + std::cos(x)) / 3)), 1,
              4 * 0.5 * std::sqrt(0.5 / 20000));
  EXPECT_NEAR(s.mean, 0, 4 * rms / std::sqrt(20000));
  EXPECT_EQ(s.deviation_v, 0);
  EXPECT_EQ(s.lost, 0);
}

TEST(HeightField, FootprintAveragesSlopesAndKeepsTheirVariance) {
  const HeightField field = Cosine();
  const SlopeStatistics fine = Statistics(field, 0);
  const SlopeStatistics coarse = Statistics(field, kPeriod * kPitch);
  EXPECT_LT(coarse.deviation, 1e-3 * fine.deviation);
  // The variance that the mean lost is reported as variance inside the footprint.
  const double k = 2 * std::numbers::pi / (kPeriod * kPitch), x = 2 * std::numbers::pi / kPeriod;
  EXPECT_NEAR(coarse.lost / std::pow(kAmplitude * k * std::sin(x / 2) / (x / 2), 2), 0.5, 0.005);
}

TEST(HeightField, MirroredBeyondItsEdges) {
  Image<float> heights(8, 4);
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 8; ++column) {
      heights.At(row, column) = static_cast<float>((column * column + 3 * row * column) * 1e-7);
    }
  }
  const HeightField field(heights, kPitch);
  for (const double u : {0.3, 2.6, 6.9}) {
    const HeightField::Patch inside = field.At(u * kPitch, 1.2 * kPitch, 0);
    // Mirror planes are the first and the last sample.
    const HeightField::Patch mirrored = field.At(-u * kPitch, 1.2 * kPitch, 0);
    const HeightField::Patch period = field.At((u + 14) * kPitch, 1.2 * kPitch, 0);
    EXPECT_NEAR(mirrored.slope_u, -inside.slope_u, 1e-6);
    EXPECT_NEAR(mirrored.slope_v, inside.slope_v, 1e-6);
    EXPECT_NEAR(period.slope_u, inside.slope_u, 1e-6);
  }
}

TEST(HeightField, TextAndImageAgree) {
  const std::string text = TestFile("heights.txt");
  const std::string png = TestFile("heights.png");
  std::vector<uint16_t> numbers;
  {
    std::ofstream file(text);
    for (int row = 0; row < 5; ++row) {
      for (int column = 0; column < 6; ++column) {
        numbers.push_back(static_cast<uint16_t>(1000 * row + 37 * column * column));
        file << numbers.back() << (column == 5 ? "\n" : "\t");
      }
    }
  }
  ASSERT_TRUE(WritePng16(png, 6, 5, numbers));
  const auto a = ReadHeightField(text, kPitch, 1e-9, "test");
  const auto b = ReadHeightField(png, kPitch, 1e-9, "test");
  ASSERT_TRUE(a.ok()) << a.status();
  ASSERT_TRUE(b.ok()) << b.status();
  for (const double u : {0.0, 3.3, 5.0}) {
    EXPECT_EQ(a->At(u * kPitch, kPitch, 0).slope_v, b->At(u * kPitch, kPitch, 0).slope_v);
  }
}

TEST(HeightField, BadFilesAreNamedWithTheirLine) {
  const std::string path = TestFile("broken.txt");
  std::ofstream(path) << "1\t2\t3\n4\tx\t6\n";
  EXPECT_THAT(std::string(ReadHeightField(path, 1e-6, 1e-6, "m").status().message()),
              HasSubstr("line 2, column 2: not a number"));
  std::ofstream(path) << "1\t2\t3\n4\t6\n";
  EXPECT_THAT(std::string(ReadHeightField(path, 1e-6, 1e-6, "m").status().message()),
              HasSubstr("line 2 has 2 values"));
  EXPECT_EQ(ReadHeightField("/does/not/exist.txt", 1e-6, 1e-6, "m").status().code(),
            absl::StatusCode::kNotFound);
}

// The same heights with tabs and decimal commas, as instruments with German settings write them.
TEST(HeightField, DecimalCommasAreReadOrRefused) {
  const auto heights = [](const char* separator, char decimal) {
    std::string text;
    for (int row = 0; row < 4; ++row) {
      for (int column = 0; column < 5; ++column) {
        text += std::to_string(row) + decimal + std::to_string(1237 * (row + 1) + column);
        text += column == 4 ? "\n" : separator;
      }
    }
    return text;
  };
  const std::string path = TestFile("heights_decimal.txt");
  std::ofstream(path) << heights("\t", '.');
  const auto points = ReadHeightField(path, kPitch, 1e-6, "m");
  ASSERT_TRUE(points.ok()) << points.status();
  for (const char* separator : {"\t", ";"}) {
    std::ofstream(path) << heights(separator, ',');
    const auto commas = ReadHeightField(path, kPitch, 1e-6, "m");
    ASSERT_TRUE(commas.ok()) << commas.status();
    EXPECT_EQ(commas->height_deviation_m(), points->height_deviation_m());
  }
  std::ofstream(path) << heights(" ", ',');
  const auto blanks = ReadHeightField(path, kPitch, 1e-6, "m");
  EXPECT_EQ(blanks.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(blanks.status().message()),
              AllOf(HasSubstr(path), HasSubstr("read in two ways")));
}

// A ramp along part x on a face whose normal is z: the detail's normal leans against the slope, in
// the local frame whose x is the machining direction (here part y).
TEST(HeightField, BoxProjectionOntoAFace) {
  const std::string path = TestFile("ramp.txt");
  {
    std::ofstream file(path);
    for (int row = 0; row < 16; ++row) {
      for (int column = 0; column < 16; ++column) file << column << "\t";
      file << "\n";
    }
  }
  v1::Material message = ConductorMessage(0.2, 0.3, 0);
  message.mutable_conductor()->mutable_machining_direction()->set_x(0);
  message.mutable_conductor()->mutable_machining_direction()->set_y(1);
  message.mutable_height_field()->set_file(path);
  message.mutable_height_field()->set_sample_pitch_m(4e-6);  // slope 1/4
  const auto material = Make(message);
  ASSERT_TRUE(material->has_detail());
  const SurfaceDetail detail = material->DetailAt({20e-6F, 20e-6F, 0}, Eigen::Vector3f::UnitZ(), 0);
  const Eigen::Vector3f in_part =
      LocalFrame(Eigen::Vector3f::UnitZ(), material->machining_direction()) * detail.normal;
  EXPECT_NEAR(in_part.x() / in_part.z(), -0.25, 1e-5);
  EXPECT_NEAR(in_part.y(), 0, 1e-6);
  EXPECT_EQ(material->measured_scale_m(), 4e-6);
  EXPECT_TRUE(CheckScale(*material, "machined", 1e-4).has_value());
  EXPECT_FALSE(CheckScale(*material, "machined", 8e-6).has_value());
}

// Albedo and roughness maps must not create energy.
TEST(HeightField, MapsKeepTheWhiteFurnaceBelowOne) {
  const std::string path = TestFile("bumps.txt");
  {
    std::ofstream file(path);
    for (int row = 0; row < 16; ++row) {
      for (int column = 0; column < 16; ++column) file << (row * 7 + column * 11) % 5 << " ";
      file << "\n";
    }
  }
  v1::Material message = LambertGgxMessage(0.4, 0.6, 0.3);
  message.mutable_height_field()->set_file(path);
  message.mutable_height_field()->set_sample_pitch_m(20e-6);
  message.mutable_height_field()->set_albedo_contrast_relative(0.5);
  message.mutable_height_field()->set_roughness_contrast_relative(0.4);
  const auto material = Make(message);
  for (int place = 0; place < 12; ++place) {
    SurfaceDetail detail = material->DetailAt({20e-6F * static_cast<float>(place), 1e-4F, 0},
                                              Eigen::Vector3f::UnitZ(), 0);
    EXPECT_GT(detail.albedo_scale, 0);
    detail.normal = Eigen::Vector3f::UnitZ();
    for (const double theta : {10.0, 60.0, 80.0}) {
      double sum = 0;
      for (int i = 0; i < 100; ++i) {
        const double angle = std::asin(std::sqrt((i + 0.5) / 100)) * 180 / std::numbers::pi;
        for (int j = 0; j < 100; ++j) {
          sum += material->Brdf(Direction(theta, 0), Direction(angle, 3.6 * (j + 0.5)), detail);
        }
      }
      EXPECT_LE(std::numbers::pi * sum / 10000, 1.01)
          << detail.albedo_scale << " " << detail.roughness_scale;
    }
  }
}

// Measured aluminium, where it lies beside the tree: the numbers published with the heights.
std::vector<std::string> MeasuredTopographies() {
  const char* source = std::getenv("SIGHTLINE_SOURCE_DIR");
  const std::string folder = std::string(source == nullptr ? "." : source) +
                             "/../shared/data/surface/aluminium_topography";
  return std::filesystem::exists(folder + "/AP_AOut.txt") ? std::vector{folder}
                                                          : std::vector<std::string>();
}

class MeasuredTopography : public ::testing::TestWithParam<std::string> {};
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(MeasuredTopography);
INSTANTIATE_TEST_SUITE_P(Shared, MeasuredTopography, ::testing::ValuesIn(MeasuredTopographies()));

TEST_P(MeasuredTopography, HasThePublishedNumbers) {
  const std::string& folder = GetParam();
  std::ifstream statistics(folder + "/AP_AOut.txt");
  double area_um2 = 0, skip = 0, deviation_um = 0;
  ASSERT_TRUE(statistics >> area_um2 >> skip >> skip >> deviation_um);
  const double pitch = 800e-6 / 512;
  const auto field = ReadHeightField(folder + "/AP_A1F.txt", pitch, 1e-6, "test");
  ASSERT_TRUE(field.ok()) << field.status();
  // The published deviation has five digits and divides by n - 1 or n: 2e-6 apart.
  EXPECT_NEAR(field->height_deviation_m() * 1e6 / deviation_um, 1, 1e-4);
  double area = 0;
  for (int row = 0; row < 511; ++row) {
    for (int column = 0; column < 511; ++column) {
      const HeightField::Patch patch = field->At((column + 0.5) * pitch, (row + 0.5) * pitch, 0);
      area += std::sqrt(1 + patch.slope_u * patch.slope_u + patch.slope_v * patch.slope_v +
                        patch.lost_slope_variance);
    }
  }
  // The published area is of triangles, whose slopes scatter up to three times as much within a
  // cell as those of the bilinear surface: it is larger, here by 1 %.
  EXPECT_NEAR(area * pitch * pitch * 1e12 / area_um2, 0.99, 0.005);
}

}  // namespace
}  // namespace sightline
