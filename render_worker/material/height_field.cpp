// SPDX-License-Identifier: Apache-2.0
#include "render_worker/material/height_field.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <filesystem>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/file/read_file.h"
#include "core/image/read_raw_image.h"
#include "core/status/status_macros.h"
#include "core/text/number_table.h"

namespace sightline {
namespace {

// With the slopes made of them a height takes some 30 bytes: 2 GiB.
constexpr int64_t kMostSamples = int64_t{1} << 26;
// As text.
constexpr uint64_t kMaxTextBytes = uint64_t{1} << 30;

// Means over 2 x 2 samples; the last row or column of an odd size counts alone.
Image<float> Halved(const Image<float>& image) {
  Image<float> half((image.columns_px + 1) / 2, (image.rows_px + 1) / 2);
  for (int row = 0; row < half.rows_px; ++row) {
    const int row1 = std::min(2 * row + 1, image.rows_px - 1);
    for (int column = 0; column < half.columns_px; ++column) {
      const int column1 = std::min(2 * column + 1, image.columns_px - 1);
      half.At(row, column) = 0.25F * (image.At(2 * row, 2 * column) + image.At(2 * row, column1) +
                                      image.At(row1, 2 * column) + image.At(row1, column1));
    }
  }
  return half;
}

// Place within [-1/2, size - 1/2] of the mirrored field; true if it is seen in a mirror.
bool Mirror(double size, double& place) {
  double shifted = std::fmod(place + 0.5, 2 * size);
  if (shifted < 0) shifted += 2 * size;
  const bool mirrored = shifted >= size;
  place = (mirrored ? 2 * size - shifted : shifted) - 0.5;
  return mirrored;
}

// Two neighbours of a place with their weights; `flip` -1 where the neighbour lies behind an edge.
struct Neighbours {
  int index[2];
  float weight[2];
  float flip[2];

  Neighbours(double place, int size) {
    const int first = static_cast<int>(std::floor(place));
    const float share = static_cast<float>(place - first);
    for (int i = 0; i < 2; ++i) {
      const int wanted = first + i;
      index[i] = std::clamp(wanted, 0, size - 1);
      flip[i] = wanted == index[i] ? 1.0F : -1.0F;
      weight[i] = i == 0 ? 1 - share : share;
    }
  }
};

absl::StatusOr<Image<float>> ReadHeightText(const std::string& path, const std::string& context) {
  const absl::StatusOr<std::string> bytes = ReadRegularFile(path, kMaxTextBytes);
  if (!bytes.ok()) {
    return absl::Status(bytes.status().code(),
                        absl::StrCat(context, ": ", bytes.status().message()));
  }
  Image<float> image;
  const absl::Status status =
      ReadNumberTable(*bytes, {.max_numbers = kMostSamples}, absl::StrCat(context, ": ", path), {},
                      [&](int, const std::vector<double>& values) {
                        for (const double value : values) {
                          image.values.push_back(static_cast<float>(value));
                        }
                        image.columns_px = static_cast<int>(values.size());
                        ++image.rows_px;
                        return absl::OkStatus();
                      });
  if (!status.ok()) return status;
  return image;
}

absl::StatusOr<Image<float>> ReadHeightImage(const std::string& path, const std::string& context) {
  const auto check_size = [](int columns, int rows) {
    if (int64_t{columns} * rows <= kMostSamples) return absl::OkStatus();
    return absl::InvalidArgumentError(absl::StrCat(
        "has ", columns, " x ", rows, " heights, at most ", kMostSamples, " can be used"));
  };
  const absl::StatusOr<RawImageFile> file = ReadRawImageFile(path, check_size);
  if (!file.ok()) {
    return absl::Status(file.status().code(), absl::StrCat(context, ": ", file.status().message()));
  }
  if (file->file_bits != 16) {
    return absl::InvalidArgumentError(absl::StrCat(context, ": ", path, " has ", file->file_bits,
                                                   " bits, must have 16 bits without sign"));
  }
  Image<float> image(file->raw_dn.columns_px, file->raw_dn.rows_px);
  std::copy(file->raw_dn.values.begin(), file->raw_dn.values.end(), image.values.begin());
  return image;
}

}  // namespace

HeightField::HeightField(Image<float> height_m, double sample_pitch_m)
    : sample_pitch_m_(sample_pitch_m) {
  assert(height_m.columns_px >= 2 && height_m.rows_px >= 2);
  const int columns = height_m.columns_px;
  const int rows = height_m.rows_px;
  double sum = 0;
  for (const float height : height_m.values) sum += height;
  const double mean = sum / static_cast<double>(height_m.values.size());
  double square = 0;
  for (const float height : height_m.values) square += (height - mean) * (height - mean);
  height_deviation_m_ = std::sqrt(square / static_cast<double>(height_m.values.size()));

  // Cells between four samples each: mean and variance of the gradient of the bilinear surface,
  // whose slope along u changes linearly from one edge (u0) to the other (u1) and so has the
  // variance (u1 - u0)^2/12.
  Level level;
  level.slope_u = Image<float>(columns - 1, rows - 1);
  level.slope_v = level.slope_u;
  level.slope_variance = level.slope_u;
  level.relative_height = level.slope_u;
  Image<float> squares = level.slope_u;  // mean square of both slopes
  for (int row = 0; row + 1 < rows; ++row) {
    for (int column = 0; column + 1 < columns; ++column) {
      const double a = height_m.At(row, column), b = height_m.At(row, column + 1);
      const double c = height_m.At(row + 1, column), d = height_m.At(row + 1, column + 1);
      const double u0 = (b - a) / sample_pitch_m_, u1 = (d - c) / sample_pitch_m_;
      const double v0 = (c - a) / sample_pitch_m_, v1 = (d - b) / sample_pitch_m_;
      const double u = 0.5 * (u0 + u1), v = 0.5 * (v0 + v1);
      const double variance = ((u1 - u0) * (u1 - u0) + (v1 - v0) * (v1 - v0)) / 12;
      level.slope_u.At(row, column) = static_cast<float>(u);
      level.slope_v.At(row, column) = static_cast<float>(v);
      level.slope_variance.At(row, column) = static_cast<float>(variance);
      squares.At(row, column) = static_cast<float>(u * u + v * v + variance);
      level.relative_height.At(row, column) =
          height_deviation_m_ > 0
              ? static_cast<float>((0.25 * (a + b + c + d) - mean) / height_deviation_m_)
              : 0;
    }
  }
  levels_.push_back(std::move(level));
  while (levels_.back().slope_u.columns_px > 1 || levels_.back().slope_u.rows_px > 1) {
    const Level& fine = levels_.back();
    squares = Halved(squares);
    Level coarse;
    coarse.slope_u = Halved(fine.slope_u);
    coarse.slope_v = Halved(fine.slope_v);
    coarse.relative_height = Halved(fine.relative_height);
    coarse.slope_variance = Image<float>(squares.columns_px, squares.rows_px);
    for (size_t i = 0; i < squares.values.size(); ++i) {
      const float u = coarse.slope_u.values[i];
      const float v = coarse.slope_v.values[i];
      coarse.slope_variance.values[i] = std::max(0.0F, squares.values[i] - u * u - v * v);
    }
    levels_.push_back(std::move(coarse));
  }
}

HeightField::Patch HeightField::AtLevel(size_t index, double column, double row) const {
  const Level& level = levels_[index];
  const double scale = std::ldexp(1.0, -static_cast<int>(index));
  const Neighbours columns((column + 0.5) * scale - 0.5, level.slope_u.columns_px);
  const Neighbours rows((row + 0.5) * scale - 0.5, level.slope_u.rows_px);
  Patch patch;
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) {
      const float weight = rows.weight[i] * columns.weight[j];
      const int r = rows.index[i];
      const int c = columns.index[j];
      patch.slope_u += weight * columns.flip[j] * level.slope_u.At(r, c);
      patch.slope_v += weight * rows.flip[i] * level.slope_v.At(r, c);
      patch.relative_height += weight * level.relative_height.At(r, c);
      patch.lost_slope_variance += weight * level.slope_variance.At(r, c);
    }
  }
  return patch;
}

HeightField::Patch HeightField::At(double u_m, double v_m, double footprint_m) const {
  // Places in cells; the first one's centre is half a pitch from the first sample.
  double column = u_m / sample_pitch_m_ - 0.5;
  double row = v_m / sample_pitch_m_ - 0.5;
  const float flip_u = Mirror(levels_[0].slope_u.columns_px, column) ? -1.0F : 1.0F;
  const float flip_v = Mirror(levels_[0].slope_u.rows_px, row) ? -1.0F : 1.0F;
  const double level = std::clamp(std::log2(std::max(footprint_m / sample_pitch_m_, 1.0)), 0.0,
                                  static_cast<double>(levels_.size() - 1));
  const size_t fine = std::min(static_cast<size_t>(level), levels_.size() - 1);
  const float share = static_cast<float>(level - static_cast<double>(fine));
  Patch patch = AtLevel(fine, column, row);
  if (share > 0 && fine + 1 < levels_.size()) {
    const Patch coarse = AtLevel(fine + 1, column, row);
    patch.slope_u += share * (coarse.slope_u - patch.slope_u);
    patch.slope_v += share * (coarse.slope_v - patch.slope_v);
    patch.relative_height += share * (coarse.relative_height - patch.relative_height);
    patch.lost_slope_variance += share * (coarse.lost_slope_variance - patch.lost_slope_variance);
  }
  patch.slope_u *= flip_u;
  patch.slope_v *= flip_v;
  return patch;
}

absl::StatusOr<HeightField> ReadHeightField(const std::string& path, double sample_pitch_m,
                                            double height_unit_m, const std::string& context) {
  if (!std::filesystem::exists(path)) {
    return absl::NotFoundError(absl::StrCat(context, ": there is no file ", path));
  }
  const std::string lower = absl::AsciiStrToLower(path);
  const bool is_image = absl::EndsWith(lower, ".png") || absl::EndsWith(lower, ".tif") ||
                        absl::EndsWith(lower, ".tiff");
  SIGHTLINE_ASSIGN_OR_RETURN(Image<float> heights, is_image ? ReadHeightImage(path, context)
                                                            : ReadHeightText(path, context));
  if (heights.columns_px < 2 || heights.rows_px < 2) {
    return absl::InvalidArgumentError(absl::StrCat(context, ": ", path, " has ", heights.rows_px,
                                                   " x ", heights.columns_px,
                                                   " heights, must have at least 2 x 2"));
  }
  for (float& height : heights.values) {
    height = static_cast<float>(height * height_unit_m);
  }
  return HeightField(std::move(heights), sample_pitch_m);
}

}  // namespace sightline
