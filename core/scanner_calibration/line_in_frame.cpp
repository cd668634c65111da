// SPDX-License-Identifier: Apache-2.0
#include "core/scanner_calibration/line_in_frame.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "absl/strings/str_cat.h"
#include "core/laser_line/detect_laser_line.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

constexpr double kInlierPx = 3;
constexpr int kFewestSamples = 12;
constexpr int kPiece = 8;  // samples of a straight piece

struct Crossing {
  Eigen::Vector2d image_px;
  double along_px;
  Eigen::Vector2d straight_px;  // undistorted, times the focal length
  bool saturated;
};

// Profiles are taken along the columns of what is detected in: a line down the image needs it
// transposed.
Image<float> ProfilesOf(const Image<uint16_t>& image, bool transpose) {
  Image<float> out(transpose ? image.rows_px : image.columns_px,
                   transpose ? image.columns_px : image.rows_px);
  for (int row = 0; row < image.rows_px; ++row) {
    for (int column = 0; column < image.columns_px; ++column) {
      (transpose ? out.At(column, row) : out.At(row, column)) = image.At(row, column);
    }
  }
  return out;
}

absl::StatusOr<std::vector<Crossing>> Crossings(const Image<uint16_t>& image, bool along_columns,
                                                double saturation_dn, const TargetCamera& camera) {
  LaserLineOptions options;
  options.ridge_sigma_px = 3;
  options.min_ridge_score_dn = 0.01 * saturation_dn;
  options.saturation_dn = saturation_dn;
  options.max_lines = 2;
  options.background_dn = std::numeric_limits<double>::quiet_NaN();
  SIGHTLINE_ASSIGN_OR_RETURN(const auto points,
                             DetectLaserLine(ProfilesOf(image, along_columns), options,
                                             LaserLineMethod::kStegerCentreOfGravity));
  std::vector<Crossing> crossings;
  for (const LinePoint& point : points) {
    const Eigen::Vector2d image_px = along_columns ? Eigen::Vector2d(point.row_px, point.column_px)
                                                   : Eigen::Vector2d(point.column_px, point.row_px);
    const Eigen::Vector3d ray = camera.Ray(image_px);
    crossings.push_back({image_px,
                         static_cast<double>(point.column_px),
                         {ray.x() * camera.fx, ray.y() * camera.fy},
                         point.saturated});
  }
  return crossings;
}

// Crossings of the straight line with the most of them.
std::vector<Crossing> OnOneLine(const std::vector<Crossing>& all) {
  std::vector<Crossing> best;
  if (all.size() < 2) return best;
  std::mt19937 random(1);
  const auto near = [&](const Eigen::Vector2d& at, const Eigen::Vector2d& normal) {
    std::vector<Crossing> inliers;
    for (const Crossing& c : all) {
      if (std::abs(normal.dot(c.straight_px - at)) < kInlierPx) inliers.push_back(c);
    }
    return inliers;
  };
  for (int trial = 0; trial < 300; ++trial) {
    const Eigen::Vector2d a = all[random() % all.size()].straight_px;
    const Eigen::Vector2d step = all[random() % all.size()].straight_px - a;
    if (step.norm() < 100) continue;
    std::vector<Crossing> inliers = near(a, Eigen::Vector2d(-step.y(), step.x()).normalized());
    if (inliers.size() > best.size()) best = std::move(inliers);
  }
  return best;
}

// Standard deviation of places about straight lines fitted to pieces of `piece` in a row.
double ScatterAboutPieces(const std::vector<double>& along, const std::vector<double>& place,
                          size_t piece) {
  double sum = 0, freedom = 0;
  for (size_t begin = 0; begin + piece <= along.size(); begin += piece) {
    double x = 0, y = 0, xx = 0, xy = 0;
    for (size_t i = begin; i < begin + piece; ++i) {
      x += along[i] / static_cast<double>(piece);
      y += place[i] / static_cast<double>(piece);
    }
    for (size_t i = begin; i < begin + piece; ++i) {
      xx += (along[i] - x) * (along[i] - x);
      xy += (along[i] - x) * (place[i] - y);
    }
    for (size_t i = begin; i < begin + piece; ++i) {
      sum += std::pow(place[i] - y - xy / xx * (along[i] - x), 2);
    }
    freedom += static_cast<double>(piece) - 2;
  }
  return freedom > 0 ? std::sqrt(sum / freedom) : 0;
}

LineInFrame SamplesOf(std::vector<Crossing> crossings, bool along_columns) {
  std::sort(crossings.begin(), crossings.end(),
            [](const Crossing& a, const Crossing& b) { return a.along_px < b.along_px; });
  LineInFrame line;
  line.along_columns = along_columns;
  const Eigen::Vector2d way = crossings.back().image_px - crossings.front().image_px;
  line.across = Eigen::Vector2d(-way.y(), way.x()).normalized();
  std::vector<double> along, place, sample_along, sample_place;
  for (const Crossing& c : crossings) {
    along.push_back(c.along_px);
    place.push_back(line.across.dot(c.image_px));
    line.clipped_fraction += c.saturated ? 1.0 / static_cast<double>(crossings.size()) : 0;
  }
  for (size_t begin = 0; begin < crossings.size();) {
    size_t end = begin;
    LineSample sample{Eigen::Vector2d::Zero(), 0};
    const double bin = std::floor(along[begin] / kSamplePx);
    for (; end < crossings.size() && std::floor(along[end] / kSamplePx) == bin; ++end) {
      sample.image_px += crossings[end].image_px;
      sample.along_px += along[end];
    }
    const double count = static_cast<double>(end - begin);
    begin = end;
    if (count < 0.5 * kSamplePx) continue;
    sample.image_px /= count;
    sample.along_px /= count;
    line.samples.push_back(sample);
    sample_along.push_back(sample.along_px);
    sample_place.push_back(line.across.dot(sample.image_px));
  }
  line.crossing_sd_px = ScatterAboutPieces(along, place, kPiece * kSamplePx);
  line.sample_sd_px = ScatterAboutPieces(sample_along, sample_place, kPiece);
  return line;
}

}  // namespace

absl::StatusOr<LineInFrame> FindLineInFrame(const Image<uint16_t>& image, double saturation_dn,
                                            const TargetCamera& camera) {
  std::vector<Crossing> best;
  bool along_columns = true;
  for (const bool down : {true, false}) {
    SIGHTLINE_ASSIGN_OR_RETURN(const auto all, Crossings(image, down, saturation_dn, camera));
    std::vector<Crossing> on_line = OnOneLine(all);
    if (on_line.size() <= best.size()) continue;
    best = std::move(on_line);
    along_columns = down;
  }
  if (best.size() < static_cast<size_t>(kFewestSamples * kSamplePx)) {
    return absl::InvalidArgumentError(
        absl::StrCat("no straight laser line is seen: only ", best.size(),
                     " rows or columns have a bright line at one straight line"));
  }
  LineInFrame line = SamplesOf(std::move(best), along_columns);
  if (line.samples.size() < kFewestSamples) {
    return absl::InvalidArgumentError("the laser line has gaps nearly everywhere");
  }
  return line;
}

}  // namespace sightline
