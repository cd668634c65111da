// SPDX-License-Identifier: Apache-2.0
// Rendered pictures: decode the PNG and look.
#include "coverage_server/view/render_view.h"

#include <gtest/gtest.h>
#include <png.h>

#include <cmath>
#include <numbers>
#include <thread>

#include "tests/core/part/test_meshes.h"
#include "tests/coverage_server/test_parts.h"

namespace sightline {
namespace {

struct Image {
  int columns = 0, rows = 0;
  std::vector<uint8_t> rgb;
  const uint8_t* At(int column, int row) const {
    return &rgb[3 * (static_cast<size_t>(row) * columns + column)];
  }
  template <typename Predicate>
  int Count(Predicate predicate) const {
    int count = 0;
    for (size_t i = 0; i < rgb.size(); i += 3) count += predicate(rgb[i], rgb[i + 1], rgb[i + 2]);
    return count;
  }
};

Image Decode(const std::string& bytes) {
  Image image;
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  if (!png_image_begin_read_from_memory(&png, bytes.data(), bytes.size())) {
    ADD_FAILURE() << png.message;
    return image;
  }
  png.format = PNG_FORMAT_RGB;
  image.columns = static_cast<int>(png.width);
  image.rows = static_cast<int>(png.height);
  image.rgb.resize(PNG_IMAGE_SIZE(png));
  EXPECT_TRUE(png_image_finish_read(&png, nullptr, image.rgb.data(), 0, nullptr)) << png.message;
  return image;
}

// Also where half of a pixel is the line and half the grey part.
constexpr auto kRed = [](int r, int g, int b) { return r > g + 80 && r > b + 80; };
constexpr auto kWhite = [](int r, int g, int b) { return r > 250 && g > 250 && b > 250; };
constexpr auto kPurple = [](int r, int g, int b) { return b > r + 15 && r > g; };
constexpr auto kYellow = [](int r, int g, int b) { return r > b + 60 && g > b + 40; };

class RenderViewTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    SceneDefinition definition;
    definition.part = PlateMesh(0.2, 0.2, 8, 8);
    definition.field_directions = 64;
    scene_ = BuildScene(std::move(definition), 1).release();
  }
  static void TearDownTestSuite() {
    delete scene_;
    scene_ = nullptr;
  }
  void SetUp() override { ASSERT_NE(scene_, nullptr); }
  static Image Render(const ViewRequest& request) {
    const auto png = RenderView(*scene_, request);
    EXPECT_TRUE(png.ok()) << png.status();
    if (!png.ok()) return {};
    EXPECT_EQ(png->substr(0, 8), "\x89PNG\r\n\x1a\n");
    const Image image = Decode(*png);
    EXPECT_EQ(image.columns, request.columns_px);
    EXPECT_EQ(image.rows, request.rows_px);
    return image;
  }
  static const CoverageScene* scene_;
};
const CoverageScene* RenderViewTest::scene_ = nullptr;

TEST_F(RenderViewTest, CameraSeesTheLineWhereItIs) {
  ViewRequest request;
  request.kind = ViewKind::kCamera;
  request.measurement = OverheadMeasurement(30 * std::numbers::pi / 180);
  request.columns_px = request.rows_px = 256;
  const Image image = Render(request);
  // The camera looks down on the plate: 0.2 m of 2 * 0.4 * tan(22.5 degrees) = 0.331 m, 155 of 256
  // px. The line lies along the rows through the middle of the image, on the plate only.
  double row_sum = 0;
  int count = 0, first = 1000, last = -1;
  for (int row = 0; row < 256; ++row) {
    for (int column = 0; column < 256; ++column) {
      const uint8_t* p = image.At(column, row);
      if (!kRed(p[0], p[1], p[2])) continue;
      row_sum += row + 0.5;
      ++count;
      first = std::min(first, column);
      last = std::max(last, column);
    }
  }
  ASSERT_GT(count, 100);
  EXPECT_NEAR(row_sum / count, 128, 1.0);
  EXPECT_NEAR(first, 128 - 77.3, 2.0);
  EXPECT_NEAR(last, 128 + 76.3, 2.0);

  // 50 mm higher the line of a laser at -x moves to +x or -x by 50 mm * tan(tau) at depth 0.35 m,
  // which is down or up the image; 0.35 m away the image holds 0.290 m.
  request.measurement->offset_z_m = 0.05;
  const Image higher = Render(request);
  double higher_sum = 0;
  int higher_count = 0;
  for (int row = 0; row < 256; ++row) {
    for (int column = 0; column < 256; ++column) {
      const uint8_t* p = higher.At(column, row);
      if (!kRed(p[0], p[1], p[2])) continue;
      higher_sum += row + 0.5;
      ++higher_count;
    }
  }
  ASSERT_GT(higher_count, 100);
  const double moved_px = 0.05 * std::tan(30 * std::numbers::pi / 180) /
                          (2 * 0.35 * std::tan(22.5 * std::numbers::pi / 180)) * 256;
  EXPECT_NEAR(std::abs(higher_sum / higher_count - 128), moved_px, 1.5);

  // Beside the plate there is no line.
  request.stage_m = 0.3;
  EXPECT_EQ(Render(request).Count(kRed), 0);
}

TEST_F(RenderViewTest, CoverageColoursFollowTheBits) {
  ViewRequest request;
  request.kind = ViewKind::kCoverage;
  request.elevation_rad = 1.2;
  request.columns_px = 320;
  request.rows_px = 200;
  request.covered = TargetBits(scene_->targets().size());
  const Image none = Render(request);
  for (size_t t = 0; t < request.covered.size(); ++t) {
    if (scene_->targets().positions_m[t].x() < 0.1f) request.covered.Set(t);
  }
  const Image half = Render(request);
  for (size_t t = 0; t < request.covered.size(); ++t) request.covered.Set(t);
  const Image all = Render(request);
  const int part = none.Count([](int r, int g, int b) { return !kWhite(r, g, b); });
  ASSERT_GT(part, 3000);
  EXPECT_EQ(none.Count(kPurple), 0);
  EXPECT_GT(none.Count(kYellow), 0.95 * part);
  EXPECT_EQ(all.Count(kYellow), 0);
  EXPECT_GT(all.Count(kPurple), 0.95 * part);
  EXPECT_GT(half.Count(kPurple), 0.35 * part);
  EXPECT_LT(half.Count(kPurple), 0.65 * part);
}

TEST_F(RenderViewTest, FreeViewShowsPartLineAndSensors) {
  ViewRequest request;
  request.measurement = OverheadMeasurement(0.6);
  const Image with = Render(request);
  EXPECT_GT(with.Count(kRed), 50);  // line and x axis
  EXPECT_GT(with.Count([](int r, int g, int b) { return b > r + 40 && b > g + 20; }),
            100);  // camera
  request.measurement.reset();
  const Image without = Render(request);
  EXPECT_EQ(without.Count(kRed), 0);
  EXPECT_GT(without.Count([](int r, int g, int b) { return !kWhite(r, g, b); }), 5000);
  request.kind = ViewKind::kMeasurability;
  EXPECT_FALSE(Render(request).rgb == without.rgb);
}

TEST_F(RenderViewTest, RefusesWhatItCannotDraw) {
  ViewRequest request;
  request.columns_px = 15;
  EXPECT_EQ(RenderView(*scene_, request).status().code(), absl::StatusCode::kInvalidArgument);
  request.columns_px = 5000;
  EXPECT_EQ(RenderView(*scene_, request).status().code(), absl::StatusCode::kInvalidArgument);
  request.columns_px = 64;
  request.kind = ViewKind::kCamera;
  EXPECT_EQ(RenderView(*scene_, request).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST_F(RenderViewTest, TwoThreadsAtTheSameTime) {
  ViewRequest first, second;
  first.kind = ViewKind::kCamera;
  first.measurement = OverheadMeasurement(0.5);
  second.kind = ViewKind::kMeasurability;
  first.columns_px = second.columns_px = 200;
  const auto alone_first = RenderView(*scene_, first), alone_second = RenderView(*scene_, second);
  ASSERT_TRUE(alone_first.ok() && alone_second.ok());
  std::vector<std::string> a(3), b(3);
  std::thread one([&] {
    for (auto& png : a) png = *RenderView(*scene_, first);
  });
  std::thread two([&] {
    for (auto& png : b) png = *RenderView(*scene_, second);
  });
  one.join();
  two.join();
  for (const auto& png : a) EXPECT_TRUE(png == *alone_first);
  for (const auto& png : b) EXPECT_TRUE(png == *alone_second);
}

}  // namespace
}  // namespace sightline
