// SPDX-License-Identifier: Apache-2.0
#include "planner_client/calibration/calibrate_scanner.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/image/read_raw_image.h"
#include "planner_client/calibration/target_corners.h"

namespace sightline {
namespace {

constexpr double kCornerOutlier = 3, kLineOutlier = 4, kPoseOutlier = 5;
constexpr double kWrongPoses_m = 0.02;

double Median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<int64_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

// Frames still in use, each with its number in the result.
struct UsedFrames {
  std::vector<CalibrationFrame> frames;
  std::vector<size_t> numbers;

  void Remove(size_t i) {
    frames.erase(frames.begin() + static_cast<int64_t>(i));
    numbers.erase(numbers.begin() + static_cast<int64_t>(i));
  }
};

absl::Status CheckEnough(const CalibrationSet& set, const UsedFrames& used,
                         const CalibrationResult& result) {
  if (used.frames.size() >= kFewestCalibrationFrames) return absl::OkStatus();
  std::string message =
      absl::StrCat(set.file, ": frames: only ", used.frames.size(), " of ", set.frames.size(),
                   " can be used, at least ", kFewestCalibrationFrames, " are needed");
  for (const CalibrationFrameResult& frame : result.frames) {
    if (!frame.because.empty()) absl::StrAppend(&message, "\n  ", frame.name, ": ", frame.because);
  }
  return absl::InvalidArgumentError(message);
}

CameraPrior EstimatedCamera(const FoundTargets& found) {
  constexpr double kOpen = std::numeric_limits<double>::infinity();
  return {.camera = found.camera,
          .standard_deviation = {kOpen, kOpen, kOpen, kOpen, 1, 1, 1, 1, 0}};
}

// Root mean square of all corners about their projections with this camera [px].
double CornerRms(const CalibrationSet& set, const FoundTargets& found, const TargetCamera& camera) {
  Eigen::VectorXd shared = Eigen::VectorXd::Zero(kSharedParameters);
  shared.head<9>() << camera.fx, camera.fy, camera.cx, camera.cy, camera.distortion[0],
      camera.distortion[1], camera.distortion[2], camera.distortion[3], camera.distortion[4];
  double sum = 0, count = 0;
  for (const FoundTargets::Frame& frame : found.frames) {
    if (frame.corners_px.empty()) continue;
    CalibrationFrame seen;
    seen.corners_px = frame.corners_px;
    seen.pose = frame.pose;
    const auto pose = PoseOfTarget(set.board, seen, shared, 1);
    sum += pose.ok() ? pose->rms_px * pose->rms_px : 1e4;
    count += 1;
  }
  return std::sqrt(sum / std::max(1.0, count));
}

CameraPrior ChooseCamera(const CalibrationSet& set, const FoundTargets& found,
                         std::vector<std::string>* warnings) {
  if (!set.camera) return EstimatedCamera(found);
  const double given_px = CornerRms(set, found, set.camera->camera);
  if (given_px <= 1 || given_px <= 2 * found.rms_px) return *set.camera;
  warnings->push_back(absl::StrFormat(
      "The given camera does not fit the frames: corners are off %.2f px (rms) with it and %.2f px "
      "with one estimated from the frames (focal length %.0f instead of %.0f px). The estimated "
      "one is used.",
      given_px, found.rms_px, found.camera.fx, set.camera->camera.fx));
  return EstimatedCamera(found);
}

absl::StatusOr<UsedFrames> FindLines(const CalibrationSet& set, const FoundTargets& found,
                                     const CameraPrior& camera, CalibrationResult* result) {
  UsedFrames used;
  for (size_t i = 0; i < set.frames.size(); ++i) {
    CalibrationFrameResult& frame = result->frames[i];
    frame.because = found.frames[i].because;
    if (!frame.because.empty()) continue;
    const auto image = ReadRawImageFile(set.frames[i].image);
    if (!image.ok()) return image.status();
    const double full = std::ldexp(1.0, image->file_bits) - 1;
    auto line = FindLineInFrame(image->raw_dn, set.saturation_dn.value_or(full), camera.camera);
    if (!line.ok()) {
      frame.because = std::string(line.status().message());
      continue;
    }
    used.frames.push_back({frame.name, found.frames[i].corners_px, found.frames[i].pose, *line});
    used.numbers.push_back(i);
  }
  return used;
}

// Leaves out the frame whose corners are off farthest, if it is an outlier.
bool RemoveWorstCorners(const CalibrationSet& set, UsedFrames* used, CalibrationResult* result) {
  std::vector<double> rms;
  for (size_t i = 0; i < used->frames.size(); ++i) {
    const auto pose = PoseOfTarget(set.board, used->frames[i], result->rig.shared, 1);
    rms.push_back(pose.ok() ? pose->rms_px : 1e3);
    result->frames[used->numbers[i]].corner_rms_px = rms.back();
  }
  const auto worst = static_cast<size_t>(std::max_element(rms.begin(), rms.end()) - rms.begin());
  if (rms[worst] < kCornerOutlier * Median(rms)) return false;
  result->frames[used->numbers[worst]].because = absl::StrFormat(
      "its corners do not fit the board: %.2f px off (rms), in the median frame %.2f px",
      rms[worst], Median(rms));
  used->Remove(worst);
  return true;
}

absl::StatusOr<bool> RemoveWorstLine(const CalibrationSet& set, const CameraPrior& camera,
                                     UsedFrames* used, CalibrationResult* result) {
  std::vector<double> rms;
  for (size_t i = 0; i < used->frames.size(); ++i) {
    const auto left_out = PredictLeftOut(set.board, used->frames, i, camera, false);
    if (!left_out.ok()) return left_out.status();
    result->frames[used->numbers[i]].left_out = *left_out;
    rms.push_back(left_out->rms_m);
  }
  const auto worst = static_cast<size_t>(std::max_element(rms.begin(), rms.end()) - rms.begin());
  if (rms[worst] < kLineOutlier * Median(rms)) return false;
  result->frames[used->numbers[worst]].because = absl::StrFormat(
      "its line does not lie on the laser plane of the other frames: %.2f mm off (rms), the median "
      "frame %.2f mm",
      1e3 * rms[worst], 1e3 * Median(rms));
  used->Remove(worst);
  return true;
}

absl::Status FitRig(const CalibrationSet& set, const CameraPrior& camera, UsedFrames* used,
                    CalibrationResult* result) {
  for (;;) {
    if (absl::Status s = CheckEnough(set, *used, *result); !s.ok()) return s;
    auto rig = AdjustRig(set.board, used->frames, camera, false);
    if (!rig.ok()) {
      return absl::InvalidArgumentError(
          absl::StrCat(set.file, ": frames: ", rig.status().message()));
    }
    result->rig = *std::move(rig);
    if (RemoveWorstCorners(set, used, result)) continue;
    const auto removed = RemoveWorstLine(set, camera, used, result);
    if (!removed.ok()) return removed.status();
    if (!*removed) return absl::OkStatus();
  }
}

absl::Status FitHandEye(const CalibrationSet& set, const UsedFrames& used,
                        CalibrationResult* result) {
  if (!set.frames.front().flange_in_base) return absl::OkStatus();
  std::vector<Eigen::Isometry3d> flange, target;
  std::vector<std::string> names;
  std::vector<size_t> numbers;
  for (size_t i = 0; i < used.frames.size(); ++i) {
    flange.push_back(*set.frames[used.numbers[i]].flange_in_base);
    target.push_back(MotionOf(result->rig.poses[i]));
    names.push_back(used.frames[i].name);
    numbers.push_back(used.numbers[i]);
  }
  for (;;) {
    auto found = FindHandEye(flange, target);
    if (!found.ok()) {
      return absl::InvalidArgumentError(
          absl::StrCat(set.file, ": frames.poses: ", found.status().message()));
    }
    const std::vector<double>& off = found->position_m;
    const auto worst = static_cast<size_t>(std::max_element(off.begin(), off.end()) - off.begin());
    const bool outlier = off[worst] > kPoseOutlier * Median(off) && off[worst] > 1e-3;
    if (outlier || found->closure_m > kWrongPoses_m) {
      const std::string why = WhyPosesDoNotFit(flange, target, names, found->closure_m);
      if (!why.empty() || !outlier || flange.size() <= kFewestCalibrationFrames) {
        return absl::InvalidArgumentError(absl::StrFormat(
            "%s: frames.poses: the poses do not fit the frames, the target would move %.1f mm "
            "(rms)%s%s",
            set.file, 1e3 * found->closure_m, why.empty() ? "" : "; ", why));
      }
      result->warnings.push_back(absl::StrFormat(
          "The pose of %s does not fit the others, the target would be %.1f mm off; it is left out "
          "of the hand-eye transformation.",
          names[worst], 1e3 * off[worst]));
      const auto at = static_cast<int64_t>(worst);
      flange.erase(flange.begin() + at);
      target.erase(target.begin() + at);
      names.erase(names.begin() + at);
      numbers.erase(numbers.begin() + at);
      continue;
    }
    for (size_t i = 0; i < numbers.size(); ++i) {
      result->frames[numbers[i]].hand_eye_position_m = off[i];
    }
    result->hand_eye = *std::move(found);
    return absl::OkStatus();
  }
}

void CompareWithReference(const CalibrationSet& set, CalibrationResult* result) {
  if (!set.reference_plane) return;
  const Eigen::Vector3d plane = result->rig.shared.segment<3>(kPlaneX);
  const double cosine = plane.normalized().dot(set.reference_plane->normal);
  result->reference = {.angle_rad = std::acos(std::min(1.0, std::abs(cosine))),
                       .distance_m = 1 / plane.norm(),
                       .reference_distance_m = set.reference_plane->distance_m};
}

}  // namespace

absl::StatusOr<CalibrationResult> CalibrateScanner(const CalibrationSet& set) {
  std::vector<std::string> images;
  CalibrationResult result;
  result.name = set.name;
  result.board = set.board;
  for (const CalibrationSetFrame& frame : set.frames) {
    images.push_back(frame.image);
    result.frames.emplace_back().name = frame.name;
  }
  const auto found = FindTargets(images, set.board);
  if (!found.ok()) return found.status();
  result.columns_px = found->columns_px;
  result.rows_px = found->rows_px;
  const CameraPrior camera = ChooseCamera(set, *found, &result.warnings);
  auto used = FindLines(set, *found, camera, &result);
  if (!used.ok()) return used.status();
  if (absl::Status s = FitRig(set, camera, &*used, &result); !s.ok()) return s;
  if (absl::Status s = FitHandEye(set, *used, &result); !s.ok()) return s;
  std::vector<LeftOutFrame> left_out;
  for (size_t i = 0; i < used->frames.size(); ++i) {
    CalibrationFrameResult& frame = result.frames[used->numbers[i]];
    frame.used = true;
    left_out.push_back(frame.left_out);
    const LineInFrame& line = used->frames[i].line;
    const auto share = static_cast<double>(used->frames.size());
    result.crossing_sd_px += line.crossing_sd_px * line.crossing_sd_px / share;
    result.clipped_fraction += line.clipped_fraction / share;
  }
  result.crossing_sd_px = std::sqrt(result.crossing_sd_px);
  result.ratio = RealOverPredicted(left_out);
  const auto planning = DescribeForPlanning(result.rig, result.columns_px, result.rows_px);
  if (!planning.ok()) return planning.status();
  result.planning = *planning;
  CompareWithReference(set, &result);
  if (result.clipped_fraction > 0.5) {
    result.warnings.push_back(absl::StrFormat(
        "The line is clipped in %.0f %% of the rows or columns: its centre then depends on the "
        "light beside it. Record with a shorter exposure.",
        100 * result.clipped_fraction));
  }
  return result;
}

}  // namespace sightline
