// SPDX-License-Identifier: Apache-2.0
#include "planner_client/calibration/recorded_lines.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "absl/status/status.h"
#include "absl/strings/str_format.h"
#include "core/image/read_raw_image.h"
#include "core/image/write_raw_png.h"
#include "core/recordings/posed_plates.h"
#include "core/statistics/order_statistics.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

constexpr int kReachPx = 60, kPiecePx = 128, kShortestPx = 64;
// Closer pixels belong to the line's clipped core and halo.
constexpr int kBesidePx = 30;
constexpr double kUnusual = 2;  // brightness of a side over that of the frame's median, or inverse
// Fraction of a square by which dark squares are enlarged, for blur and errors of the corners.
constexpr double kBorder = 0.15;
constexpr int kLinePositionLeast_px = 1;

// One frame: image, pose and the line in it, predicted from laser plane and pose.
struct Frame {
  const Image<uint16_t>& image;
  double saturation_dn;
  const TargetBoard& board;
  const PosedPlates& posed;
  Eigen::Isometry3d plate_in_camera;
  bool along_columns = false;
  std::vector<std::optional<double>> across_px = {};  // of every row or column of the image
  bool odd_squares_are_dark = false;

  int length() const { return along_columns ? image.rows_px : image.columns_px; }
  int width() const { return along_columns ? image.columns_px : image.rows_px; }
  double At(int along, int across) const {
    return along_columns ? image.At(along, across) : image.At(across, along);
  }
  Eigen::Vector2d Pixel(double along, double across) const {
    return along_columns ? Eigen::Vector2d(across, along) : Eigen::Vector2d(along, across);
  }
};

// The position on the board that a pixel shows.
Eigen::Vector2d OnBoard(const Frame& frame, const Eigen::Vector2d& pixel) {
  const Eigen::Vector3d ray = frame.posed.camera.Ray(pixel);
  const Eigen::Vector3d normal = frame.plate_in_camera.linear().col(2);
  const double scale = normal.dot(frame.plate_in_camera.translation()) / normal.dot(ray);
  return (frame.plate_in_camera.inverse() * (scale * ray)).head<2>();
}

// Column and row of the square, 0 right of the first inner corners, -1 left of them; and the
// position within it as fractions of a square.
struct Square {
  int x, y;
  double in_x, in_y;
};

Square SquareOf(const TargetBoard& board, const Eigen::Vector2d& on_board) {
  const Eigen::Vector2d place =
      on_board / board.square_m +
      0.5 * Eigen::Vector2d(board.inner_corners_x - 1, board.inner_corners_y - 1);
  const double x = std::floor(place.x()), y = std::floor(place.y());
  return {static_cast<int>(x), static_cast<int>(y), place.x() - x, place.y() - y};
}

bool IsDark(const Frame& frame, int x, int y) {
  const TargetBoard& board = frame.board;
  const bool printed = x >= -1 && y >= -1 && x < board.inner_corners_x && y < board.inner_corners_y;
  return printed && ((x + y) % 2 != 0) == frame.odd_squares_are_dark;
}

// True if a pixel shows a dark square or a place close to one.
bool NearDarkSquare(const Frame& frame, double along, double across) {
  const Square square = SquareOf(frame.board, OnBoard(frame, frame.Pixel(along, across)));
  const int left = square.in_x < kBorder ? -1 : 0, right = square.in_x > 1 - kBorder ? 1 : 0;
  const int above = square.in_y < kBorder ? -1 : 0, below = square.in_y > 1 - kBorder ? 1 : 0;
  for (int dx = left; dx <= right; ++dx) {
    for (int dy = above; dy <= below; ++dy) {
      if (IsDark(frame, square.x + dx, square.y + dy)) return true;
    }
  }
  return false;
}

// True if the squares of odd parity are darker, by the middles of the inner squares.
bool OddIsDark(const Frame& frame) {
  double sum[2] = {0, 0}, count[2] = {0, 0};
  const TargetBoard& board = frame.board;
  for (int y = 0; y + 1 < board.inner_corners_y; ++y) {
    for (int x = 0; x + 1 < board.inner_corners_x; ++x) {
      const Eigen::Vector2d middle = board.Corner(y * board.inner_corners_x + x) +
                                     Eigen::Vector2d::Constant(0.5 * board.square_m);
      const Eigen::Vector2d pixel = frame.posed.camera.Project(
          frame.plate_in_camera * Eigen::Vector3d(middle.x(), middle.y(), 0));
      const auto column = static_cast<int>(std::lround(pixel.x()));
      const auto row = static_cast<int>(std::lround(pixel.y()));
      if (column < 0 || row < 0 || column >= frame.image.columns_px || row >= frame.image.rows_px) {
        continue;
      }
      const int odd = (x + y) % 2;
      sum[odd] += std::min<double>(frame.image.At(row, column), frame.saturation_dn);
      count[odd] += 1;
    }
  }
  return sum[1] * count[0] < sum[0] * count[1];
}

// Mean of a side of the line in one row or column, from kBesidePx to kReachPx; `side`: -1 or 1.
double SideMean(const Frame& frame, int along, int centre, int side) {
  double sum = 0;
  for (int k = kBesidePx; k <= kReachPx; ++k) sum += frame.At(along, centre + side * k);
  return sum / (kReachPx - kBesidePx + 1);
}

// Rows or columns in which everything up to kReachPx from the line is the light plate.
std::vector<bool> UsableOf(const Frame& frame) {
  std::vector<bool> usable(static_cast<size_t>(frame.length()), false);
  std::vector<double> sides[2];
  for (int along = 0; along < frame.length(); ++along) {
    const auto& across = frame.across_px[static_cast<size_t>(along)];
    if (!across) continue;
    const int centre = static_cast<int>(std::lround(*across));
    if (centre - kReachPx < 0 || centre + kReachPx >= frame.width()) continue;
    bool light = true;
    for (int k = -kReachPx; k <= kReachPx && light; k += 4) {
      light = !NearDarkSquare(frame, along, centre + k);
    }
    for (int k = kBesidePx; k <= kReachPx && light; ++k) {
      light = frame.At(along, centre - k) < frame.saturation_dn &&
              frame.At(along, centre + k) < frame.saturation_dn;
    }
    usable[static_cast<size_t>(along)] = light;
    if (!light) continue;
    for (const int s : {0, 1}) sides[s].push_back(SideMean(frame, along, centre, 2 * s - 1));
  }
  if (sides[0].empty()) return usable;
  const double usual[2] = {UpperMedian(sides[0]), UpperMedian(sides[1])};
  for (int along = 0; along < frame.length(); ++along) {
    if (!usable[static_cast<size_t>(along)]) continue;
    const int centre = static_cast<int>(std::lround(*frame.across_px[static_cast<size_t>(along)]));
    for (const int s : {0, 1}) {
      const double mean = SideMean(frame, along, centre, 2 * s - 1);
      if (mean > kUnusual * usual[s] || mean < usual[s] / kUnusual) {
        usable[static_cast<size_t>(along)] = false;
      }
    }
  }
  return usable;
}

// Distance of the line's centre from its predicted position in a crop: centroid of the mean profile
// above half of its height.
double OffPlace(const Frame& frame, int first, int last) {
  std::vector<double> profile(2 * kReachPx + 1, 0);
  double predicted = 0;
  for (int along = first; along < last; ++along) {
    const double across = *frame.across_px[static_cast<size_t>(along)];
    const int centre = static_cast<int>(std::lround(across));
    predicted += (across - centre) / (last - first);
    for (int k = -kReachPx; k <= kReachPx; ++k) {
      profile[static_cast<size_t>(k + kReachPx)] += frame.At(along, centre + k);
    }
  }
  const auto [least, most] = std::minmax_element(profile.begin(), profile.end());
  const double half = 0.5 * (*least + *most);
  double sum = 0, count = 0;
  for (size_t i = 0; i < profile.size(); ++i) {
    if (profile[i] < half) continue;
    sum += static_cast<double>(i) - kReachPx;
    count += 1;
  }
  return sum / count - predicted;
}

void SetVector(const Eigen::Vector3d& from, v1::Vector3* to) {
  to->set_x(from.x());
  to->set_y(from.y());
  to->set_z(from.z());
}

PosedPlates PosedPlatesOf(const CalibrationResult& result) {
  PosedPlates posed;
  posed.camera = CameraOf(result.rig.shared);
  // The format has one focal length; both differ by less than the uncertainty of poses.
  posed.camera.fx = posed.camera.fy = result.planning.focal_length_px;
  const Eigen::Vector3d plane = result.rig.shared.segment<3>(kPlaneX);
  posed.sheet = {plane.normalized(), 1 / plane.norm(), std::nullopt};
  return posed;
}

// The part of the description that all recordings share.
v1::Recordings DescriptionOf(const CalibrationSet& set, const CalibrationResult& result,
                             const PosedPlates& posed, int bits) {
  v1::Recordings message;
  message.set_format("laser-line-recordings");
  message.set_format_version(3);
  message.set_set(result.name);
  v1::Sensor* camera = message.mutable_camera();
  camera->set_sensor_type("mono");
  camera->set_sensor_columns_px(result.columns_px);
  camera->set_sensor_rows_px(result.rows_px);
  camera->set_bit_depth_bit(bits);
  if (set.assumed.pixel_pitch_m() > 0) camera->set_pixel_pitch_m(set.assumed.pixel_pitch_m());
  message.mutable_laser()->set_wavelength_m(set.assumed.wavelength_m());
  v1::Recordings::PixelCamera* pixel = message.mutable_pixel_camera();
  pixel->set_focal_length_px(posed.camera.fx);
  pixel->set_principal_point_column_px(posed.camera.cx);
  pixel->set_principal_point_row_px(posed.camera.cy);
  const auto& [k1, k2, p1, p2, k3] = posed.camera.distortion;
  v1::Lens::Distortion* distortion = pixel->mutable_distortion();
  distortion->set_k1(k1);
  distortion->set_k2(k2);
  distortion->set_p1(p1);
  distortion->set_p2(p2);
  distortion->set_k3(k3);
  SetVector(posed.sheet.normal, message.mutable_laser_plane()->mutable_normal());
  message.mutable_laser_plane()->set_offset_m(posed.sheet.offset_m);
  return message;
}

// Adds the pieces of a run of usable rows or columns.
absl::Status AddPieces(const Frame& frame, const std::string& name, int position, int first,
                       int last, std::vector<double>* off_px, RecordedLines* lines) {
  const int count = (last - first + kPiecePx - 1) / kPiecePx;
  for (int k = 0; k < count; ++k) {
    const int from = first + k * (last - first) / count,
              to = first + (k + 1) * (last - first) / count;
    if (to - from < kShortestPx) continue;
    int low = frame.width(), high = 0;
    for (int along = from; along < to; ++along) {
      const auto centre =
          static_cast<int>(std::lround(*frame.across_px[static_cast<size_t>(along)]));
      low = std::min(low, centre - kReachPx);
      high = std::max(high, centre + kReachPx + 1);
    }
    off_px->push_back(OffPlace(frame, from, to));
    const bool down = frame.along_columns;
    const int column = down ? low : from, row = down ? from : low;
    Image<uint16_t> cut(down ? high - low : to - from, down ? to - from : high - low);
    for (int i = 0; i < cut.rows_px; ++i) {
      for (int j = 0; j < cut.columns_px; ++j) {
        cut.At(i, j) = frame.image.At(row + i, column + j);
      }
    }
    const int bits = lines->recordings.camera().bit_depth_bit() <= 8 ? 8 : 16;
    SIGHTLINE_ASSIGN_OR_RETURN(auto png, EncodeRawPng(cut, bits));
    v1::Recording* recording = lines->recordings.add_recordings();
    recording->set_file(absl::StrFormat("images/%s_%04d.png", name, from));
    recording->set_kind("laser");
    recording->set_series(name);
    recording->set_plate_position_id(position);
    recording->set_roi_column_px(column - frame.image.columns_px / 2);
    recording->set_roi_row_px(row - frame.image.rows_px / 2);
    recording->set_roi_columns_px(cut.columns_px);
    recording->set_roi_rows_px(cut.rows_px);
    v1::Recording::PlatePose* pose = recording->mutable_plate_pose();
    for (int i = 0; i < 9; ++i) pose->add_rotation(frame.plate_in_camera.linear()(i / 3, i % 3));
    SetVector(frame.plate_in_camera.translation(), pose->mutable_translation_m());
    lines->images.emplace_back(recording->file(), std::move(png));
    lines->left_out_px -= to - from;
  }
  return absl::OkStatus();
}

std::string StemOf(const std::string& name) { return name.substr(0, name.rfind('.')); }

}  // namespace

absl::StatusOr<RecordedLines> RecordedLinesOf(const CalibrationSet& set,
                                              const CalibrationResult& result) {
  if (!(set.assumed.wavelength_m() > 0)) {
    return absl::InvalidArgumentError(set.file + ": assumed.wavelength_m is missing");
  }
  const PosedPlates posed = PosedPlatesOf(result);
  Sensor sensor;
  sensor.columns_px = result.columns_px;
  sensor.rows_px = result.rows_px;
  RecordedLines lines;
  std::vector<double> off_px;
  size_t used = 0;
  for (size_t i = 0; i < result.frames.size(); ++i) {
    if (!result.frames[i].used) continue;
    const Eigen::Isometry3d pose = MotionOf(result.rig.poses[used++]);
    SIGHTLINE_ASSIGN_OR_RETURN(const auto image, ReadRawImageFile(set.frames[i].image));
    if (lines.images.empty() && lines.recordings.format().empty()) {
      lines.recordings = DescriptionOf(set, result, posed, image.file_bits);
    }
    const double saturation_dn = set.saturation_dn.value_or(std::ldexp(1.0, image.file_bits) - 1);
    Frame frame{image.raw_dn, saturation_dn, set.board, posed, pose};
    RecordedImage whole;
    whole.plate_in_camera = pose;
    whole.roi_column_px = -(sensor.columns_px / 2);
    whole.roi_row_px = -(sensor.rows_px / 2);
    whole.roi_columns_px = sensor.columns_px;
    whole.roi_rows_px = sensor.rows_px;
    const auto line = FindLineInRegion(posed, sensor, whole);
    if (!line.ok()) continue;
    frame.along_columns = line->along_columns;
    frame.across_px.resize(static_cast<size_t>(frame.length()));
    for (int along = line->first_px; along < line->last_px; ++along) {
      const auto place =
          PlaceOfLine(posed.camera, line->line, line->along_columns, along, line->start_m);
      if (!place) continue;
      frame.across_px[static_cast<size_t>(along)] =
          line->along_columns ? place->image_px.x() : place->image_px.y();
    }
    frame.odd_squares_are_dark = OddIsDark(frame);
    const std::vector<bool> usable = UsableOf(frame);
    lines.line_px += line->last_px - line->first_px;
    lines.left_out_px += line->last_px - line->first_px;
    for (auto begin = usable.begin(); begin != usable.end();) {
      begin = std::find(begin, usable.end(), true);
      const auto end = std::find(begin, usable.end(), false);
      SIGHTLINE_RETURN_IF_ERROR(AddPieces(frame, StemOf(result.frames[i].name), static_cast<int>(i),
                                          static_cast<int>(begin - usable.begin()),
                                          static_cast<int>(end - usable.begin()), &off_px, &lines));
      begin = end;
    }
  }
  if (lines.images.empty()) {
    return absl::InvalidArgumentError(set.file +
                                      ": no frame shows the light plate alone beside its line");
  }
  double square = 0;
  for (const double off : off_px) square += off * off / static_cast<double>(off_px.size());
  lines.recordings.mutable_uncertainty()->set_line_position_each_px(
      std::max<double>(kLinePositionLeast_px, std::sqrt(square)));
  return lines;
}

}  // namespace sightline
