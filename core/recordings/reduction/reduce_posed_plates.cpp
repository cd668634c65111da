// SPDX-License-Identifier: Apache-2.0
#include "core/recordings/reduction/reduce_posed_plates.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/recordings/posed_plates.h"
#include "core/statistics/order_statistics.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

// Rows that a segment needs on either side of its line: fewer show no background.
constexpr int kLeastReachPx = 12;
constexpr int kShortestSegmentPx = 16;
constexpr double kFocalLengthTolerance = 0.1;

// A region of interest in pixels of the sensor, along and across the line.
struct Region {
  int along = 0, across = 0, along_px = 0, across_px = 0;
};

Region RegionOf(const RecordedImage& image, const Sensor& sensor, bool along_columns) {
  const int column = sensor.columns_px / 2 + image.roi_column_px;
  const int row = sensor.rows_px / 2 + image.roi_row_px;
  return along_columns ? Region{row, column, image.roi_rows_px, image.roi_columns_px}
                       : Region{column, row, image.roi_columns_px, image.roi_rows_px};
}

// One segment: its columns, and in each the row of the line, in pixels of the sensor.
struct Segment {
  int first_px = 0;
  std::vector<double> across_px;
  Eigen::Vector3d middle_m;
};

// The segments of a line, all of about the same length.
std::vector<Segment> SegmentsOf(const TargetCamera& camera, const LineInRegion& line) {
  const int length = line.last_px - line.first_px;
  const int count = (length + kSegmentPx - 1) / kSegmentPx;
  std::vector<Segment> segments;
  for (int k = 0; k < count; ++k) {
    // Even numbers of columns, as column samples have them.
    const int first = line.first_px + k * length / count / 2 * 2;
    const int last = k + 1 == count ? line.first_px + length / 2 * 2
                                    : line.first_px + (k + 1) * length / count / 2 * 2;
    if (last - first < kShortestSegmentPx) continue;
    Segment segment{first, {}, line.start_m};
    bool complete = true;
    for (int along = first; along < last && complete; ++along) {
      const auto place = PlaceOfLine(camera, line.line, line.along_columns, along, line.start_m);
      complete = place.has_value();
      if (!complete) break;
      segment.across_px.push_back(line.along_columns ? place->image_px.x() : place->image_px.y());
    }
    const auto middle =
        PlaceOfLine(camera, line.line, line.along_columns, 0.5 * (first + last - 1), line.start_m);
    if (!complete || !middle) continue;
    segment.middle_m = middle->point_m;
    segments.push_back(std::move(segment));
  }
  return segments;
}

// The image of a segment: rows `above` to `below` about the line, every column shifted by `shift`.
Image<uint16_t> CutOut(const Image<uint16_t>& image, const Region& region, bool along_columns,
                       const Segment& segment, const std::vector<int>& centre, int above,
                       int below) {
  Image<uint16_t> cut(static_cast<int>(segment.across_px.size()), above + below + 1);
  for (int column = 0; column < cut.columns_px; ++column) {
    const int along = segment.first_px + column - region.along;
    const int first = centre[static_cast<size_t>(column)] - above - region.across;
    for (int row = 0; row < cut.rows_px; ++row) {
      cut.At(row, column) =
          along_columns ? image.At(along, first + row) : image.At(first + row, along);
    }
  }
  return cut;
}

Image<uint16_t> Transposed(const Image<uint16_t>& image) {
  Image<uint16_t> turned(image.rows_px, image.columns_px);
  for (int row = 0; row < image.rows_px; ++row) {
    for (int column = 0; column < image.columns_px; ++column) {
      turned.At(column, row) = image.At(row, column);
    }
  }
  return turned;
}

class Reduction {
 public:
  Reduction(const RecordingSet& posed, const std::vector<Image<uint16_t>>& raw_dn)
      : posed_(posed), raw_(raw_dn) {}

  absl::StatusOr<ReducedPlates> Run() {
    SIGHTLINE_RETURN_IF_ERROR(FindLines());
    SIGHTLINE_RETURN_IF_ERROR(CheckFocalLength());
    result_.set = posed_;
    result_.set.format_version = 1;
    result_.set.recordings.clear();
    result_.set.posed->transposed = along_columns_;
    if (along_columns_) std::swap(result_.set.camera.columns_px, result_.set.camera.rows_px);
    for (size_t i = 0; i < posed_.recordings.size(); ++i) {
      if (posed_.recordings[i].kind == RecordingKind::kLaser) {
        AddSegments(i);
      } else {
        AddWhole(i);
      }
    }
    const auto lit = [](const RecordedImage& r) { return r.kind == RecordingKind::kLaser; };
    if (std::none_of(result_.set.recordings.begin(), result_.set.recordings.end(), lit)) {
      return absl::InvalidArgumentError(
          absl::StrCat("recordings: no segment of a line can be used: ", result_.remarks.front()));
    }
    if (along_columns_) {
      result_.remarks.emplace_back(
          "the lines run along the columns of the sensor: columns and rows of all images of the "
          "diagnosis are exchanged");
    }
    return std::move(result_);
  }

 private:
  const TargetCamera& camera() const { return posed_.posed->camera; }

  absl::Status FindLines() {
    std::optional<size_t> first;
    std::vector<double> depths_m;
    for (size_t i = 0; i < posed_.recordings.size(); ++i) {
      const RecordedImage& image = posed_.recordings[i];
      lines_.emplace_back();
      if (image.kind != RecordingKind::kLaser) continue;
      auto line = FindLineInRegion(*posed_.posed, posed_.camera, image);
      if (!line.ok()) {
        return absl::InvalidArgumentError(
            absl::StrCat("recordings[", i, "].plate_pose: ", line.status().message()));
      }
      if (first && line->along_columns != along_columns_) {
        return absl::InvalidArgumentError(
            absl::StrCat("recordings[", i, "].plate_pose: the line runs along the ",
                         line->along_columns ? "columns" : "rows", ", that of recordings[", *first,
                         "] along the ", along_columns_ ? "columns" : "rows", ": divide the set"));
      }
      if (!first) first = i;
      along_columns_ = line->along_columns;
      depths_m.push_back(line->start_m.z());
      lines_.back() = *std::move(line);
    }
    if (!first) {
      return absl::InvalidArgumentError("recordings: none has kind \"laser\"");
    }
    depth_m_ = UpperMedian(std::move(depths_m));
    return absl::OkStatus();
  }

  absl::Status CheckFocalLength() const {
    for (size_t i = 0; i < posed_.recordings.size(); ++i) {
      const double image_m =
          1 / (1 / posed_.focal_length_m - 1 / posed_.recordings[i].focus_distance_m);
      const double px = image_m / posed_.camera.pixel_pitch_m;
      if (std::abs(px / camera().fx - 1) < kFocalLengthTolerance) continue;
      return absl::InvalidArgumentError(absl::StrFormat(
          "recordings[%d].focus_distance_m, lens.focal_length_m and camera.pixel_pitch_m make a "
          "focal length of %.5g px, pixel_camera.focal_length_px is %.5g: they must agree within "
          "%.0f %%",
          i, px, camera().fx, 100 * kFocalLengthTolerance));
    }
    return absl::OkStatus();
  }

  void LeaveOut(const RecordedImage& image, const Segment& segment, const std::string& why) {
    result_.remarks.push_back(absl::StrCat(PartName(image, segment), ": left out: ", why));
  }

  std::string PartName(const RecordedImage& image, const Segment& segment) const {
    return absl::StrCat(image.file, ", ", along_columns_ ? "rows " : "columns ", segment.first_px,
                        " to ", segment.first_px + static_cast<int>(segment.across_px.size()) - 1);
  }

  void AddSegments(size_t i) {
    const RecordedImage& image = posed_.recordings[i];
    const LineInRegion& line = *lines_[i];
    const Region region = RegionOf(image, posed_.camera, along_columns_);
    const std::vector<Segment> segments = SegmentsOf(camera(), line);
    for (size_t k = 0; k < segments.size(); ++k) {
      const Segment& segment = segments[k];
      auto view =
          ViewOfLine(camera(), posed_.posed->sheet, line.line, along_columns_, segment.middle_m);
      if (!view.ok()) {
        LeaveOut(image, segment, std::string(view.status().message()));
        continue;
      }
      // Whole rows, so that no pixel is interpolated.
      std::vector<int> centre;
      double offset = 0, square = 0;
      int lowest = region.across + region.across_px, highest = -1;
      for (const double across : segment.across_px) {
        centre.push_back(static_cast<int>(std::lround(across)));
        const double off = across - centre.back();
        offset += off / static_cast<double>(segment.across_px.size());
        square += off * off / static_cast<double>(segment.across_px.size());
        lowest = std::min(lowest, centre.back());
        highest = std::max(highest, centre.back());
      }
      view->row_variance_px2 = square - offset * offset;
      const int above = std::min(kSegmentReachPx, lowest - region.across);
      const int below = std::min(kSegmentReachPx, region.across + region.across_px - 1 - highest);
      if (std::min(above, below) < kLeastReachPx) {
        LeaveOut(image, segment, "the line is too near the edge of the region of interest");
        continue;
      }
      // Row of the line in the middle column, as if all columns were shifted alike.
      const double line_px = centre[centre.size() / 2] + offset;
      RecordedImage reduced = Common(image, segment.middle_m.z());
      reduced.file = PartName(image, segment);
      const auto [position, is_new] = positions_.try_emplace(
          std::pair(*image.plate_position_id, segment.first_px), positions_.size());
      reduced.plate_position_id = static_cast<int>(position->second);
      reduced.view = *view;
      const auto& origin = posed_.posed->sheet.origin_m;
      // Light from far away does not spread: all recordings have the same distance.
      reduced.laser_distance_m = origin ? (segment.middle_m - *origin).norm() : depth_m_;
      const double along_centre = along_columns_ ? camera().cy : camera().cx;
      const double across_centre = along_columns_ ? camera().cx : camera().cy;
      const int across_origin = static_cast<int>(std::lround(across_centre));
      reduced.roi_column_px = segment.first_px - static_cast<int>(std::lround(along_centre));
      reduced.roi_row_px = centre[centre.size() / 2] - above - across_origin;
      reduced.roi_columns_px = static_cast<int>(segment.across_px.size());
      reduced.roi_rows_px = above + below + 1;
      const double image_m = 1 / (1 / posed_.focal_length_m - 1 / image.focus_distance_m);
      reduced.line_offset_m = (line_px - across_origin) * posed_.camera.pixel_pitch_m *
                              reduced.camera_distance_m / image_m;
      const int columns = static_cast<int>(segment.across_px.size());
      const int across_first = lowest - above, across_count = highest - lowest + above + below + 1;
      reduced.part_of_image =
          along_columns_
              ? ImagePart{image.file, across_first - posed_.camera.columns_px / 2,
                          segment.first_px - posed_.camera.rows_px / 2, across_count, columns}
              : ImagePart{image.file, segment.first_px - posed_.camera.columns_px / 2,
                          across_first - posed_.camera.rows_px / 2, columns, across_count};
      Add(std::move(reduced), i, [&](const Image<uint16_t>& raw) {
        return CutOut(raw, region, along_columns_, segment, centre, above, below);
      });
    }
  }

  void AddWhole(size_t i) {
    const RecordedImage& image = posed_.recordings[i];
    RecordedImage reduced = Common(image, depth_m_);
    reduced.laser_distance_m = depth_m_;
    reduced.part_of_image = ImagePart{image.file, image.roi_column_px, image.roi_row_px,
                                      image.roi_columns_px, image.roi_rows_px};
    if (along_columns_) {
      std::swap(reduced.roi_column_px, reduced.roi_row_px);
      std::swap(reduced.roi_columns_px, reduced.roi_rows_px);
    }
    if (image.kind == RecordingKind::kAmbient) {
      const auto [position, is_new] = positions_.try_emplace(
          std::pair(image.plate_position_id.value_or(-1), -1), positions_.size());
      reduced.plate_position_id = static_cast<int>(position->second);
    }
    Add(std::move(reduced), i,
        [&](const Image<uint16_t>& raw) { return along_columns_ ? Transposed(raw) : raw; });
  }

  RecordedImage Common(const RecordedImage& image, double depth_m) const {
    RecordedImage reduced = image;
    reduced.plate_position_id.reset();
    reduced.camera_distance_m = depth_m;
    return reduced;
  }

  template <typename Cut>
  void Add(RecordedImage reduced, size_t i, const Cut& cut) {
    // Repeats of a recording are repeats of its segments.
    if (reduced.view) {
      const auto [group, is_new] = groups_.try_emplace(
          std::pair(reduced.repeat_group, *reduced.plate_position_id), groups_.size());
      reduced.repeat_group = static_cast<int>(group->second);
    } else {
      const auto [group, is_new] =
          groups_.try_emplace(std::pair(reduced.repeat_group, -1), groups_.size());
      reduced.repeat_group = static_cast<int>(group->second);
    }
    result_.set.recordings.push_back(std::move(reduced));
    if (raw_.empty()) return;
    result_.raw_dn.push_back(raw_[i].empty() ? Image<uint16_t>() : cut(raw_[i]));
  }

  const RecordingSet& posed_;
  const std::vector<Image<uint16_t>>& raw_;
  std::vector<std::optional<LineInRegion>> lines_;
  bool along_columns_ = false;
  double depth_m_ = 0;
  std::map<std::pair<int, int>, size_t> positions_, groups_;
  ReducedPlates result_;
};

}  // namespace

absl::StatusOr<ReducedPlates> ReducePosedPlates(const RecordingSet& posed,
                                                const std::vector<Image<uint16_t>>& raw_dn) {
  return Reduction(posed, raw_dn).Run();
}

}  // namespace sightline
