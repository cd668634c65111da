// SPDX-License-Identifier: Apache-2.0
#include "core/frame_light/board_tiles.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace sightline {
namespace {

constexpr int kTilesPerSquare = 3, kSamplesPerTile = 8;
// Part of a square's edge that is left out on each side: blur and errors of the corners.
constexpr double kBorder = 0.12;
// A second difference of independent values of variance v has the variance 6 v.
constexpr double kSecondDifference = 6;

struct Pixel {
  int row = 0, column = 0;
};

std::optional<Pixel> PixelAt(const Image<uint16_t>& image, const Eigen::Vector2d& at) {
  const int column = static_cast<int>(std::lround(at.x()));
  const int row = static_cast<int>(std::lround(at.y()));
  if (row < 1 || column < 0 || row + 1 >= image.rows_px || column >= image.columns_px) {
    return std::nullopt;
  }
  return Pixel{row, column};
}

// The laser line on the board: a . (x, y) = b, |a| = 1.
struct LineOnBoard {
  Eigen::Vector2d a;
  double b = 0;
  double DistanceM(const Eigen::Vector2d& at) const { return std::abs(a.dot(at) - b); }
};

LineOnBoard LineOf(const Eigen::VectorXd& shared, const Eigen::Isometry3d& motion) {
  const Eigen::Vector3d plane = shared.segment<3>(kPlaneX);
  const Eigen::Vector2d a = (motion.linear().transpose() * plane).head<2>();
  return {a / a.norm(), (1 - plane.dot(motion.translation())) / a.norm()};
}

// One tile, its lower corner at `from` on the board. None: clipped or beyond the image.
std::optional<BoardTile> TileAt(const Image<uint16_t>& image, double saturation_dn,
                                const TargetCamera& camera, const Eigen::Isometry3d& motion,
                                const Eigen::Vector2d& from, double edge_m) {
  double sum = 0, squares = 0;
  constexpr int kCount = kSamplesPerTile * kSamplesPerTile;
  for (int i = 0; i < kCount; ++i) {
    const Eigen::Vector2d step(i % kSamplesPerTile + 0.5, i / kSamplesPerTile + 0.5);
    const Eigen::Vector2d at = from + edge_m / kSamplesPerTile * step;
    const auto pixel = PixelAt(image, camera.Project(motion * Eigen::Vector3d(at.x(), at.y(), 0)));
    if (!pixel) return std::nullopt;
    const double value = image.At(pixel->row, pixel->column);
    if (value >= saturation_dn) return std::nullopt;
    const double second = image.At(pixel->row - 1, pixel->column) - 2 * value +
                          image.At(pixel->row + 1, pixel->column);
    sum += value;
    squares += second * second / kSecondDifference;
  }
  BoardTile tile;
  tile.raw_dn = sum / kCount;
  tile.variance_dn2 = squares / kCount;
  return tile;
}

// Squares of one parity are print: those that are darker.
void MarkPrint(const std::vector<bool>& odd, std::vector<BoardTile>* tiles) {
  double sum[2] = {0, 0}, count[2] = {0, 0};
  for (size_t i = 0; i < tiles->size(); ++i) {
    sum[odd[i] ? 1 : 0] += (*tiles)[i].raw_dn;
    count[odd[i] ? 1 : 0] += 1;
  }
  const bool odd_is_print = sum[1] * count[0] < sum[0] * count[1];
  for (size_t i = 0; i < tiles->size(); ++i) (*tiles)[i].print = odd[i] == odd_is_print;
}

std::vector<LineSide> SidesOf(const Image<uint16_t>& image, double saturation_dn,
                              const LineInFrame& line, double from_px) {
  std::vector<LineSide> sides;
  for (const LineSample& sample : line.samples) {
    double sum = 0, count = 0;
    for (int i = 0; i < 16; ++i) {
      const double away = from_px * (1.5 + 1.0 * (i % 8) / 8) * (i < 8 ? 1 : -1);
      const auto pixel = PixelAt(image, sample.image_px + away * line.across);
      if (!pixel) continue;
      const double value = image.At(pixel->row, pixel->column);
      if (value >= saturation_dn) continue;
      sum += value;
      count += 1;
    }
    if (count >= 8) sides.push_back({sample.image_px, sum / count});
  }
  return sides;
}

}  // namespace

FrameTiles MeasureTiles(const Image<uint16_t>& image, double saturation_dn,
                        const TargetBoard& board, const Eigen::VectorXd& shared,
                        const Eigen::VectorXd& pose, const LineInFrame& line,
                        double least_distance_m) {
  const TargetCamera camera = CameraOf(shared);
  const Eigen::Isometry3d motion = MotionOf(pose);
  const LineOnBoard line_on_board = LineOf(shared, motion);
  const double edge_m = (1 - 2 * kBorder) * board.square_m / kTilesPerSquare;
  FrameTiles measured;
  std::vector<bool> odd;
  for (int y = 0; y + 1 < board.inner_corners_y; ++y) {
    for (int x = 0; x + 1 < board.inner_corners_x; ++x) {
      const Eigen::Vector2d corner = board.Corner(y * board.inner_corners_x + x) +
                                     Eigen::Vector2d::Constant(kBorder * board.square_m);
      for (int i = 0; i < kTilesPerSquare * kTilesPerSquare; ++i) {
        const Eigen::Vector2d from =
            corner + edge_m * Eigen::Vector2d(i % kTilesPerSquare, i / kTilesPerSquare);
        const double distance_m =
            line_on_board.DistanceM(from + Eigen::Vector2d::Constant(0.5 * edge_m));
        if (distance_m < least_distance_m) continue;
        auto tile = TileAt(image, saturation_dn, camera, motion, from, edge_m);
        if (!tile) continue;
        tile->from_line_m = distance_m;
        measured.tiles.push_back(*tile);
        odd.push_back((x + y) % 2 == 1);
      }
    }
  }
  MarkPrint(odd, &measured.tiles);
  const double px_per_m = camera.fx / std::max(1e-6, motion.translation().z());
  measured.sides = SidesOf(image, saturation_dn, line, least_distance_m * px_per_m);
  return measured;
}

}  // namespace sightline
