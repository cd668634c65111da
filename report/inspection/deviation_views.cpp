// SPDX-License-Identifier: Apache-2.0
#include "report/inspection/deviation_views.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"
#include "report/page/number_text.h"
#include "report/raw_image/raw_png.h"

namespace sightline {
namespace {

constexpr int kViewWidth_px = 420, kViewMargin_px = 12;
constexpr std::array<uint8_t, 3> kNotMeasured = {128, 128, 128}, kPaper = {255, 255, 255};

struct AxisView {
  const char* name;
  Eigen::Vector3f right, up, towards;  // of the viewer
};

const std::array<AxisView, 6>& AxisViews() {
  static const std::array<AxisView, 6> views = {{
      {"from +z", {1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
      {"from -z", {-1, 0, 0}, {0, 1, 0}, {0, 0, -1}},
      {"from +x", {0, 1, 0}, {0, 0, 1}, {1, 0, 0}},
      {"from -x", {0, -1, 0}, {0, 0, 1}, {-1, 0, 0}},
      {"from +y", {-1, 0, 0}, {0, 0, 1}, {0, 1, 0}},
      {"from -y", {1, 0, 0}, {0, 0, 1}, {0, -1, 0}},
  }};
  return views;
}

// A picture of dots on white paper.
class DotPicture {
 public:
  DotPicture(int columns_px, int rows_px)
      : columns_px_(columns_px),
        rows_px_(rows_px),
        values_(3 * static_cast<size_t>(columns_px) * static_cast<size_t>(rows_px), 255) {}

  void Dot(double x, double y, double radius_px, const std::array<uint8_t, 3>& colour) {
    const int first_row = std::max(0, static_cast<int>(std::ceil(y - radius_px)));
    const int last_row = std::min(rows_px_ - 1, static_cast<int>(std::floor(y + radius_px)));
    const int first_column = std::max(0, static_cast<int>(std::ceil(x - radius_px)));
    const int last_column = std::min(columns_px_ - 1, static_cast<int>(std::floor(x + radius_px)));
    for (int row = first_row; row <= last_row; ++row) {
      for (int column = first_column; column <= last_column; ++column) {
        if (std::hypot(column - x, row - y) > radius_px) continue;
        const size_t at = 3 * (static_cast<size_t>(row) * static_cast<size_t>(columns_px_) +
                               static_cast<size_t>(column));
        std::copy(colour.begin(), colour.end(), values_.begin() + static_cast<std::ptrdiff_t>(at));
      }
    }
  }

  absl::StatusOr<std::string> Png(const std::string& description) const {
    return EncodePng(values_, columns_px_, rows_px_, true, description);
  }

 private:
  int columns_px_, rows_px_;
  std::vector<uint8_t> values_;
};

// The targets that face the viewer, farthest first.
std::vector<uint32_t> TargetsSeen(const TargetSet& targets, const AxisView& view) {
  constexpr float kLeastCosine = 0.1f;
  std::vector<uint32_t> seen;
  for (size_t t = 0; t < targets.size(); ++t) {
    if (targets.normals[t].dot(view.towards) > kLeastCosine) {
      seen.push_back(static_cast<uint32_t>(t));
    }
  }
  std::sort(seen.begin(), seen.end(), [&](uint32_t a, uint32_t b) {
    const float depth_a = targets.positions_m[a].dot(view.towards);
    const float depth_b = targets.positions_m[b].dot(view.towards);
    return depth_a < depth_b || (depth_a == depth_b && a < b);
  });
  return seen;
}

absl::StatusOr<v1::ReportBlock> ViewPicture(const SurfaceDeviations& surface,
                                            const Eigen::AlignedBox3f& box, const AxisView& view,
                                            const std::vector<uint32_t>& seen) {
  // The extent of a box along an axis direction is that of its corners.
  const double width_m = static_cast<double>(std::abs(box.sizes().dot(view.right)));
  const double height_m = static_cast<double>(std::abs(box.sizes().dot(view.up)));
  const double scale_px_per_m =
      (kViewWidth_px - 2 * kViewMargin_px) / std::max({width_m, height_m, 1e-9});
  const double rows_px = scale_px_per_m * height_m + 2 * kViewMargin_px;
  const double area_px = scale_px_per_m * width_m * scale_px_per_m * height_m;
  const double radius_px =
      std::clamp(0.6 * std::sqrt(area_px / static_cast<double>(seen.size())), 1.0, 6.0);
  DotPicture picture(static_cast<int>(scale_px_per_m * width_m) + 2 * kViewMargin_px,
                     static_cast<int>(rows_px));
  for (const uint32_t t : seen) {
    const Eigen::Vector3f d = surface.targets->positions_m[t] - box.center();
    const double x =
        kViewMargin_px + scale_px_per_m * (static_cast<double>(d.dot(view.right)) + 0.5 * width_m);
    const double y = rows_px - kViewMargin_px -
                     scale_px_per_m * (static_cast<double>(d.dot(view.up)) + 0.5 * height_m);
    if (surface.measured[t] == 0) {
      picture.Dot(x, y, radius_px, kNotMeasured);
      picture.Dot(x, y, radius_px - 1, kPaper);
    } else {
      picture.Dot(x, y, radius_px,
                  DeviationColour(static_cast<double>(surface.deviations_m[t]), surface.scale_m));
    }
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto png, picture.Png("deviation"));
  return PictureBlock(png, view.name, std::string("Deviation of the part seen ") + view.name);
}

// Colours from minus to plus `scale_m`.
absl::StatusOr<v1::ReportBlock> ScalePicture(double scale_m) {
  constexpr int kColumns_px = 280, kRows_px = 14;
  std::vector<uint8_t> values;
  for (int row = 0; row < kRows_px; ++row) {
    for (int column = 0; column < kColumns_px; ++column) {
      const double at = 2 * (column + 0.5) / kColumns_px - 1;
      const auto colour = DeviationColour(at * scale_m, scale_m);
      values.insert(values.end(), colour.begin(), colour.end());
    }
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto png, EncodePng(values, kColumns_px, kRows_px, true));
  const std::string end = FixedNumber(1e3 * scale_m, 3);
  return PictureBlock(png,
                      absl::StrCat("Deviation from the model along the normal, from \u2212", end,
                                   " mm (inside, blue) to +", end, " mm (outside, red)"),
                      "Scale of deviations");
}

}  // namespace

std::array<uint8_t, 3> DeviationColour(double deviation_m, double scale_m) {
  const double s = std::clamp(deviation_m / scale_m, -1.0, 1.0);
  // From a light grey to a saturated blue or red.
  const std::array<double, 3> zero = {215, 215, 215};
  const std::array<double, 3> end =
      s < 0 ? std::array<double, 3>{30, 80, 190} : std::array<double, 3>{200, 30, 30};
  std::array<uint8_t, 3> colour{};
  for (size_t k = 0; k < 3; ++k) {
    colour[k] = static_cast<uint8_t>(std::lround(zero[k] + std::abs(s) * (end[k] - zero[k])));
  }
  return colour;
}

absl::StatusOr<ReportBlocks> DeviationViews(const SurfaceDeviations& surface) {
  const TargetSet& targets = *surface.targets;
  if (targets.size() == 0) return ReportBlocks();
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& position : targets.positions_m) box.extend(position);
  SIGHTLINE_ASSIGN_OR_RETURN(auto scale, ScalePicture(surface.scale_m));
  ReportBlocks views;
  for (const AxisView& view : AxisViews()) {
    const std::vector<uint32_t> seen = TargetsSeen(targets, view);
    if (seen.empty()) continue;
    SIGHTLINE_ASSIGN_OR_RETURN(auto picture, ViewPicture(surface, box, view, seen));
    views.push_back(std::move(picture));
  }
  return ReportBlocks{std::move(scale), RemarkBlock("Hollow dots were not measured."),
                      GroupBlock(v1::ReportGroup::THREE_COLUMNS, std::move(views))};
}

}  // namespace sightline
