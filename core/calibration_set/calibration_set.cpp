// SPDX-License-Identifier: Apache-2.0
#include "core/calibration_set/calibration_set.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/calibration_set/number_fields.h"
#include "core/field_limits/field_checks.h"
#include "core/field_limits/imaging_limits.h"
#include "core/file/read_file.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMostTextBytes = size_t{1} << 20;
constexpr size_t kMostFrames = 1000;

absl::Status Wrong(const std::string& file, absl::string_view field, absl::string_view reason) {
  return absl::InvalidArgumentError(absl::StrCat(file, ": ", field, " ", reason));
}

// The numbers of a named field; `count`: how many there must be, one of two.
absl::StatusOr<std::vector<double>> Numbers(const fs::path& folder, const v1::FileField& from,
                                            const std::string& set_file, const std::string& field,
                                            size_t count, size_t or_count) {
  if (from.file().empty()) return Wrong(set_file, field + ".file", "is missing");
  if (from.field().empty()) return Wrong(set_file, field + ".field", "is missing");
  const std::string path = (folder / from.file()).string();
  SIGHTLINE_ASSIGN_OR_RETURN(const auto text, ReadRegularFile(path, kMostTextBytes));
  SIGHTLINE_ASSIGN_OR_RETURN(auto numbers, NumbersOfField(text, from.field(), path));
  if (numbers.size() != count && numbers.size() != or_count) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": ", from.field(), " has ", numbers.size(), " numbers, not ", count));
  }
  return numbers;
}

absl::StatusOr<CameraPrior> ReadCamera(const fs::path& folder, const v1::CalibrationCamera& from,
                                       const std::string& file) {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto matrix,
                             Numbers(folder, from.matrix(), file, "camera.matrix", 9, 9));
  const std::vector<double>& m = matrix;
  if (!(m[0] > 0) || !(m[4] > 0) || m[8] != 1 || m[3] != 0 || m[6] != 0 || m[7] != 0) {
    return Wrong(file, "camera.matrix", "is no camera matrix: fx 0 cx, 0 fy cy, 0 0 1");
  }
  CameraPrior prior;
  prior.camera = {.fx = m[0], .fy = m[4], .cx = m[2], .cy = m[5], .distortion = {}};
  if (from.has_distortion()) {
    SIGHTLINE_ASSIGN_OR_RETURN(const auto terms,
                               Numbers(folder, from.distortion(), file, "camera.distortion", 5, 4));
    std::copy(terms.begin(), terms.end(), prior.camera.distortion.begin());
  }
  const double relative = from.has_focal_length_relative() ? from.focal_length_relative() : 0.01;
  const double centre = from.has_principal_point_px() ? from.principal_point_px() : 10;
  if (!(relative >= 0) || !(centre >= 0)) {
    return Wrong(file, "camera", "has a negative standard deviation");
  }
  prior.standard_deviation = {relative * m[0], relative * m[4], centre, centre, 0, 0, 0, 0, 0};
  return prior;
}

absl::StatusOr<Eigen::Isometry3d> ReadPose(const std::string& path,
                                           v1::FramePattern::PoseLayout layout) {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto text, ReadRegularFile(path, kMostTextBytes));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto numbers, NumbersOfTuple(text, path));
  const std::vector<double>& n = numbers;
  if (n.size() != 7) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": has ", n.size(), " numbers; a pose has 7"));
  }
  const bool w_first = layout == v1::FramePattern::POSE_LAYOUT_POSITION_WXYZ;
  const Eigen::Quaterniond turn = w_first ? Eigen::Quaterniond(n[3], n[4], n[5], n[6])
                                          : Eigen::Quaterniond(n[6], n[3], n[4], n[5]);
  if (std::abs(turn.norm() - 1) > 1e-3) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": the quaternion has length ", turn.norm(), ", not 1"));
  }
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = turn.normalized().toRotationMatrix();
  pose.translation() << n[0], n[1], n[2];
  return pose;
}

// Sets `star` to the text in the place of the * of a pattern. False: the name does not fit it.
bool StarOf(const std::string& pattern, const std::string& name, std::string* star) {
  const size_t at = pattern.find('*');
  const std::string before = pattern.substr(0, at), after = pattern.substr(at + 1);
  if (name.size() < before.size() + after.size()) return false;
  if (!absl::StartsWith(name, before) || !absl::EndsWith(name, after)) return false;
  *star = name.substr(before.size(), name.size() - before.size() - after.size());
  return true;
}

bool IsPattern(const std::string& text) {
  return std::count(text.begin(), text.end(), '*') == 1 && !absl::StrContains(text, "/");
}

absl::Status ReadFrames(const fs::path& folder, const v1::FramePattern& from, CalibrationSet* set) {
  if (!IsPattern(from.images())) {
    return Wrong(set->file, "frames.images",
                 "must be the name of a file with one *, such as \"frame*.png\"");
  }
  const bool with_poses = !from.poses().empty();
  if (with_poses && !IsPattern(from.poses())) {
    return Wrong(set->file, "frames.poses",
                 "must be the name of a file with one *, such as \"pose*.txt\"");
  }
  if (with_poses && from.pose_layout() == v1::FramePattern::POSE_LAYOUT_UNSPECIFIED) {
    return Wrong(set->file, "frames.pose_layout",
                 "is missing: POSE_LAYOUT_POSITION_XYZW or POSE_LAYOUT_POSITION_WXYZ");
  }
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    std::string star;
    CalibrationSetFrame frame;
    frame.name = entry->path().filename().string();
    if (!StarOf(from.images(), frame.name, &star)) continue;
    frame.image = entry->path().string();
    if (with_poses) {
      std::string pose_file = from.poses();
      pose_file.replace(pose_file.find('*'), 1, star);
      const auto pose = ReadPose((folder / pose_file).string(), from.pose_layout());
      if (!pose.ok()) {
        return absl::Status(pose.status().code(),
                            absl::StrCat(pose.status().message(), "; the pose of ", frame.name));
      }
      frame.flange_in_base = *pose;
    }
    set->frames.push_back(std::move(frame));
    if (set->frames.size() > kMostFrames) {
      return Wrong(set->file, "frames.images", "fits more than 1000 files");
    }
  }
  std::sort(set->frames.begin(), set->frames.end(),
            [](const auto& a, const auto& b) { return a.name < b.name; });
  if (set->frames.size() < kFewestCalibrationFrames) {
    return Wrong(set->file, "frames.images",
                 absl::StrCat("fits ", set->frames.size(),
                              " files; a calibration that is checked by leaving frames out needs "
                              "at least ",
                              kFewestCalibrationFrames));
  }
  return absl::OkStatus();
}

// Zero stands for a value that is not assumed.
absl::Status CheckAssumed(const v1::AssumedDevices& assumed, const std::string& file) {
  const Checker check(file);
  if (assumed.pixel_pitch_m() != 0) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range("assumed.pixel_pitch_m", assumed.pixel_pitch_m(), kPixelPitch));
  }
  if (assumed.f_number() != 0) {
    SIGHTLINE_RETURN_IF_ERROR(check.Range("assumed.f_number", assumed.f_number(), kLensFNumber));
  }
  if (assumed.wavelength_m() != 0) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range("assumed.wavelength_m", assumed.wavelength_m(), kLaserWavelength));
  }
  const double sensor_pitch_m = assumed.sensor().pixel_pitch_m();
  if (sensor_pitch_m != 0 && assumed.pixel_pitch_m() != 0 &&
      std::abs(sensor_pitch_m / assumed.pixel_pitch_m() - 1) > 1e-6) {
    return Wrong(file, "assumed.pixel_pitch_m",
                 absl::StrCat("is ", assumed.pixel_pitch_m(), " m, but assumed.sensor has ",
                              sensor_pitch_m, " m"));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<CalibrationSet> ReadCalibrationSet(const std::string& folder_name) {
  const fs::path folder = folder_name;
  CalibrationSet set;
  set.file = (folder / "calibration_set.json").string();
  v1::CalibrationSet message;
  SIGHTLINE_RETURN_IF_ERROR(ReadStrictJsonFile(set.file, &message));
  if (message.format() != "laser-line-calibration") {
    return Wrong(set.file, "format", "must be \"laser-line-calibration\"");
  }
  if (message.format_version() != 1) return Wrong(set.file, "format_version", "must be 1");
  set.name = message.name();
  const v1::Checkerboard& board = message.checkerboard();
  if (board.inner_corners_x() < 3 || board.inner_corners_x() > 100 || board.inner_corners_y() < 3 ||
      board.inner_corners_y() > 100) {
    return Wrong(set.file, "checkerboard",
                 "needs inner_corners_x and inner_corners_y, both in [3, 100]");
  }
  if (!(board.square_m() > 0) || !(board.square_m() < 10)) {
    return Wrong(set.file, "checkerboard.square_m", "is missing or not in (0, 10)");
  }
  set.board = {board.inner_corners_x(), board.inner_corners_y(), board.square_m()};
  if (message.has_camera()) {
    SIGHTLINE_ASSIGN_OR_RETURN(set.camera, ReadCamera(folder, message.camera(), set.file));
  }
  if (message.frames().has_saturation_dn()) {
    set.saturation_dn = message.frames().saturation_dn();
    if (!(*set.saturation_dn > 0)) return Wrong(set.file, "frames.saturation_dn", "must be > 0");
  }
  if (message.has_reference_laser_plane()) {
    const v1::ReferencePlane& from = message.reference_laser_plane();
    SIGHTLINE_ASSIGN_OR_RETURN(
        const auto rotation,
        Numbers(folder, from.rotation(), set.file, "reference_laser_plane.rotation", 9, 9));
    SIGHTLINE_ASSIGN_OR_RETURN(const auto origin, Numbers(folder, from.origin_m(), set.file,
                                                          "reference_laser_plane.origin_m", 3, 3));
    Eigen::Vector3d normal(rotation[2], rotation[5], rotation[8]);
    normal.normalize();
    double distance = normal.dot(Eigen::Vector3d(origin[0], origin[1], origin[2]));
    if (distance < 0) normal = -normal, distance = -distance;
    set.reference_plane = {normal, distance};
  }
  SIGHTLINE_RETURN_IF_ERROR(CheckAssumed(message.assumed(), set.file));
  set.assumed = message.assumed();
  SIGHTLINE_RETURN_IF_ERROR(ReadFrames(folder, message.frames(), &set));
  return set;
}

}  // namespace sightline
