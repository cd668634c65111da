// SPDX-License-Identifier: Apache-2.0
#include "planner_client/calibration/calibrate_scanner.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/image/read_raw_image.h"
#include "core/scanner_calibration/repeated_views.h"
#include "core/statistics/order_statistics.h"
#include "core/status/status_macros.h"
#include "planner_client/calibration/target_corners.h"

namespace sightline {
namespace {

constexpr double kCornerOutlier = 3, kLineOutlier = 4, kPoseOutlier = 5;
constexpr double kWrongPoses_m = 0.02;
// A scale of the squares is reported if it differs from 1 by this many standard errors and by this
// fraction.
constexpr double kScaleSigmas = 3, kLeastScale = 0.002;
// chi^2 of three terms that chance exceeds once in a thousand sets.
constexpr double kBentChiSquare = 16.27;
// A bent target is accepted if its prediction error of left-out frames is below this fraction.
constexpr double kBetterPrediction = 0.9;
// If the line is off the target by this factor with a reference plane, that is of another set-up.
constexpr double kOtherReference = 5;
// Light is measured beyond this distance from the line; closer pixels belong to the line itself.
constexpr double kBesideLine_m = 0.002;
// A principal point farther from the image's middle than this fraction of its size is unusual.
constexpr double kOffCentre = 0.1;

// Frames in use, each with its number in the result.
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

double SaturationDn(const CalibrationSet& set, int file_bits) {
  return set.saturation_dn.value_or(std::ldexp(1.0, file_bits) - 1);
}

CameraPrior EstimatedCamera(const FoundTargets& found) {
  constexpr double kOpen = std::numeric_limits<double>::infinity();
  return {.camera = found.camera,
          .standard_deviation = {kOpen, kOpen, kOpen, kOpen, 1, 1, 1, 1, 0}};
}

// Root mean square of the corners' residuals with this camera [px].
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

// A principal point far from the middle of the images suggests images of another size. Empty if it
// is near.
std::string OtherImageSize(const TargetCamera& camera, const FoundTargets& found) {
  const double x = camera.cx / found.columns_px - 0.5, y = camera.cy / found.rows_px - 0.5;
  if (std::max(std::abs(x), std::abs(y)) < kOffCentre) return "";
  return absl::StrFormat(
      " Its principal point (%.0f, %.0f) is the middle of images of about %.0f x %.0f px, these "
      "have %d x %d px: it seems to be of another camera, or of other settings of this one.",
      camera.cx, camera.cy, 2 * camera.cx, 2 * camera.cy, found.columns_px, found.rows_px);
}

CameraPrior ChooseCamera(const CalibrationSet& set, const FoundTargets& found,
                         std::vector<std::string>* warnings) {
  if (!set.camera) return EstimatedCamera(found);
  const double given_px = CornerRms(set, found, set.camera->camera);
  if (given_px <= 1 || given_px <= 2 * found.rms_px) return *set.camera;
  warnings->push_back(absl::StrFormat(
      "The given camera does not fit the frames: corners are off %.2f px (rms) with it and %.2f px "
      "with one estimated from the corners (focal length %.0f instead of %.0f px). The estimated "
      "one is the start of the adjustment.%s",
      given_px, found.rms_px, found.camera.fx, set.camera->camera.fx,
      OtherImageSize(set.camera->camera, found)));
  return EstimatedCamera(found);
}

void LeaveOutRepeated(const std::vector<CalibrationFrameResult>& frames, FoundTargets* found) {
  std::vector<std::vector<Eigen::Vector2d>> corners_px;
  for (const FoundTargets::Frame& frame : found->frames) {
    corners_px.push_back(frame.because.empty() ? frame.corners_px : std::vector<Eigen::Vector2d>());
  }
  const auto repeated = FindRepeatedViews(corners_px);
  for (size_t i = 0; i < repeated.size(); ++i) {
    if (!repeated[i]) continue;
    found->frames[i].because = absl::StrFormat(
        "it shows the target in the same place as %s (corners %.2f px apart): a view counts once",
        frames[repeated[i]->of].name, repeated[i]->corners_rms_px);
  }
}

absl::StatusOr<UsedFrames> FindLines(const CalibrationSet& set, const FoundTargets& found,
                                     const CameraPrior& camera, CalibrationResult* result) {
  UsedFrames used;
  for (size_t i = 0; i < set.frames.size(); ++i) {
    CalibrationFrameResult& frame = result->frames[i];
    frame.because = found.frames[i].because;
    if (!frame.because.empty()) continue;
    SIGHTLINE_ASSIGN_OR_RETURN(const auto image, ReadRawImageFile(set.frames[i].image));
    auto line = FindLineInFrame(image.raw_dn, SaturationDn(set, image.file_bits), camera.camera);
    if (!line.ok()) {
      frame.because = std::string(line.status().message());
      continue;
    }
    used.frames.push_back({frame.name, found.frames[i].corners_px, found.frames[i].pose, *line});
    used.numbers.push_back(i);
  }
  return used;
}

// Leaves out the frame with the largest corner residuals, if it is an outlier.
bool RemoveWorstCorners(const CalibrationSet& set, UsedFrames* used, CalibrationResult* result) {
  std::vector<double> rms;
  for (size_t i = 0; i < used->frames.size(); ++i) {
    const auto pose = PoseOfTarget(set.board, used->frames[i], result->rig.shared, 1);
    rms.push_back(pose.ok() ? pose->rms_px : 1e3);
    result->frames[used->numbers[i]].corner_rms_px = rms.back();
  }
  const auto worst = static_cast<size_t>(std::max_element(rms.begin(), rms.end()) - rms.begin());
  if (rms[worst] < kCornerOutlier * UpperMedian(rms)) return false;
  result->frames[used->numbers[worst]].because = absl::StrFormat(
      "its corners do not fit the board: %.2f px off (rms), in the median frame %.2f px",
      rms[worst], UpperMedian(rms));
  used->Remove(worst);
  return true;
}

absl::StatusOr<bool> RemoveWorstLine(const CalibrationSet& set, const CameraPrior& camera,
                                     TargetShape shape, UsedFrames* used,
                                     CalibrationResult* result) {
  std::vector<double> rms;
  for (size_t i = 0; i < used->frames.size(); ++i) {
    SIGHTLINE_ASSIGN_OR_RETURN(const auto left_out,
                               PredictLeftOut(set.board, used->frames, i, camera, shape));
    result->frames[used->numbers[i]].left_out = left_out;
    rms.push_back(left_out.rms_m);
  }
  const auto worst = static_cast<size_t>(std::max_element(rms.begin(), rms.end()) - rms.begin());
  if (rms[worst] < kLineOutlier * UpperMedian(rms)) return false;
  result->frames[used->numbers[worst]].because = absl::StrFormat(
      "its line does not lie on the laser plane of the other frames: %.2f mm off (rms), the median "
      "frame %.2f mm",
      1e3 * rms[worst], 1e3 * UpperMedian(rms));
  used->Remove(worst);
  return true;
}

absl::Status FitRig(const CalibrationSet& set, const CameraPrior& camera, TargetShape shape,
                    UsedFrames* used, CalibrationResult* result) {
  for (;;) {
    SIGHTLINE_RETURN_IF_ERROR(CheckEnough(set, *used, *result));
    auto rig = AdjustRig(set.board, used->frames, camera, shape);
    if (!rig.ok()) {
      return absl::InvalidArgumentError(
          absl::StrCat(set.file, ": frames: ", rig.status().message()));
    }
    result->rig = *std::move(rig);
    if (RemoveWorstCorners(set, used, result)) continue;
    SIGHTLINE_ASSIGN_OR_RETURN(const auto removed,
                               RemoveWorstLine(set, camera, shape, used, result));
    if (!removed) return absl::OkStatus();
  }
}

// Root mean square of the distances of all points in frames that were left out [m].
double LeftOutRms(const UsedFrames& used, const CalibrationResult& result) {
  double sum = 0, count = 0;
  for (const size_t number : used.numbers) {
    for (const double distance : result.frames[number].left_out.distance_m) {
      sum += distance * distance;
      count += 1;
    }
  }
  return std::sqrt(sum / std::max(1.0, count));
}

TargetBend BendOf(const TargetBoard& board, const AdjustedRig& rig) {
  const Eigen::Vector3d terms = rig.shared.segment<3>(kBendXx);
  const Eigen::Matrix3d covariance = rig.covariance.block<3, 3>(kBendXx, kBendXx);
  TargetBend bend{.chi_square = terms.dot(covariance.ldlt().solve(terms))};
  for (int i = 0; i < board.corner_count(); ++i) {
    const Eigen::Vector2d at = board.Corner(i);
    const double height =
        terms.dot(Eigen::Vector3d(at.x() * at.x(), at.x() * at.y(), at.y() * at.y()));
    bend.largest_m = std::max(bend.largest_m, std::abs(height));
  }
  return bend;
}

std::string BendText(const CalibrationResult& result) {
  const std::string off = absl::StrFormat(
      "The board is bent: its corners are up to %.2f mm off a plane (chi^2 %.0f of 3 terms). ",
      1e3 * result.bend->largest_m, result.bend->chi_square);
  const double flat_mm = 1e3 * result.shape_trials.front().left_out_rms_m;
  double least_mm = flat_mm;
  for (const ShapeTrial& trial : result.shape_trials) {
    least_mm = std::min(least_mm, 1e3 * trial.left_out_rms_m);
  }
  const std::string gain = absl::StrFormat(
      "Frames that are left out are then predicted within %.2f instead of %.2f mm (rms)", least_mm,
      flat_mm);
  switch (result.shape) {
    case TargetShape::kBentBoard:
      return absl::StrCat(off, gain, ", with the line on a flat plate under the board.");
    case TargetShape::kBent:
      return absl::StrCat(off, gain, ", with the line on the bent surface.");
    case TargetShape::kFlat:
      break;
  }
  return absl::StrCat(off,
                      "It is taken as flat, since a bent one does not predict the line better. "
                      "Camera and laser plane may have errors that no ratio shows.");
}

// Fits a flat target and, if it seems bent, a bent board with the line on a flat plate and a bent
// plate. Keeps the shape that best predicts left-out frames: corners do not show which surface
// carries the line.
absl::Status FitShape(const CalibrationSet& set, const CameraPrior& camera, UsedFrames* used,
                      CalibrationResult* result) {
  const UsedFrames all = *used;
  const CalibrationResult nothing_fitted = *result;
  SIGHTLINE_RETURN_IF_ERROR(FitRig(set, camera, TargetShape::kFlat, used, result));
  std::vector<ShapeTrial> trials = {
      {TargetShape::kFlat, LeftOutRms(*used, *result), result->rig.corner_sd_px}};
  const double enough = kBetterPrediction * trials.front().left_out_rms_m;
  std::optional<TargetBend> bend;
  if (const auto rig = AdjustRig(set.board, used->frames, camera, TargetShape::kBentBoard);
      rig.ok()) {
    bend = BendOf(set.board, *rig);
  }
  const bool bent = bend && bend->chi_square > kBentChiSquare;
  double least = enough;
  for (const TargetShape shape : {TargetShape::kBentBoard, TargetShape::kBent}) {
    if (!bent) break;
    UsedFrames kept = all;
    CalibrationResult fitted = nothing_fitted;
    if (!FitRig(set, camera, shape, &kept, &fitted).ok()) continue;
    const double rms_m = LeftOutRms(kept, fitted);
    trials.push_back({shape, rms_m, fitted.rig.corner_sd_px});
    if (kept.frames.size() < used->frames.size() || !(rms_m < least)) continue;
    least = rms_m;
    bend = BendOf(set.board, fitted.rig);
    *used = std::move(kept);
    *result = std::move(fitted);
    result->shape = shape;
  }
  result->bend = bend;
  result->shape_trials = std::move(trials);
  if (bent) result->warnings.push_back(BendText(*result));
  return absl::OkStatus();
}

// Compares the length of the squares with the robot's movements.
void CheckScale(const CalibrationSet& set, const std::vector<Eigen::Isometry3d>& flange,
                const std::vector<Eigen::Isometry3d>& target, CalibrationResult* result) {
  const auto scale = ScaleByRobot(flange, target);
  if (!scale.ok()) return;
  result->robot_scale = *scale;
  const double off = std::abs(scale->value - 1);
  if (off < kScaleSigmas * scale->standard_error || off < kLeastScale) return;
  result->warnings.push_back(absl::StrFormat(
      "By the robot's movements the squares are %.3f mm (standard error %.3f mm), not %.3f mm as "
      "checkerboard.square_m states. If the robot is right, all distances are wrong by %+.1f %%.",
      1e3 * set.board.square_m * scale->value, 1e3 * set.board.square_m * scale->standard_error,
      1e3 * set.board.square_m, 100 * (1 / scale->value - 1)));
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
    const bool outlier = off[worst] > kPoseOutlier * UpperMedian(off) && off[worst] > 1e-3;
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
    CheckScale(set, flange, target, result);
    return absl::OkStatus();
  }
}

absl::StatusOr<FrameLight> MeasureLight(const CalibrationSet& set, const UsedFrames& used,
                                        const CalibrationResult& result) {
  FrameLightSums sums;
  for (size_t i = 0; i < used.frames.size(); ++i) {
    SIGHTLINE_ASSIGN_OR_RETURN(const auto image,
                               ReadRawImageFile(set.frames[used.numbers[i]].image));
    const double saturation_dn = SaturationDn(set, image.file_bits);
    const LineInFrame& line = used.frames[i].line;
    sums.Add(image.raw_dn, saturation_dn, line,
             MeasureTiles(image.raw_dn, saturation_dn, set.board, result.rig.shared,
                          result.rig.poses[i], line, kBesideLine_m));
  }
  return sums.Result();
}

// Root mean square height of the line's points over the target with another laser plane [m].
double LineRmsWithPlane(const UsedFrames& used, const CalibrationResult& result,
                        const PlaneInCamera& plane) {
  Eigen::VectorXd shared = result.rig.shared;
  shared.segment<3>(kPlaneX) = plane.normal / plane.distance_m;
  double sum = 0, count = 0;
  for (size_t i = 0; i < used.frames.size(); ++i) {
    for (const LineSample& sample : used.frames[i].line.samples) {
      const Eigen::Vector3d point = PointOnPlane(shared, sample.image_px);
      sum += std::pow(HeightOverTarget(result.shape, shared, result.rig.poses[i], point), 2);
      count += 1;
    }
  }
  return std::sqrt(sum / std::max(1.0, count));
}

void CompareWithReference(const CalibrationSet& set, const UsedFrames& used,
                          CalibrationResult* result) {
  if (!set.reference_plane) return;
  const Eigen::Vector3d plane = result->rig.shared.segment<3>(kPlaneX);
  const double cosine = plane.normalized().dot(set.reference_plane->normal);
  result->reference = {.angle_rad = std::acos(std::min(1.0, std::abs(cosine))),
                       .distance_m = 1 / plane.norm(),
                       .reference_distance_m = set.reference_plane->distance_m,
                       .line_rms_m = LineRmsWithPlane(used, *result, *set.reference_plane)};
  const double own_m = LeftOutRms(used, *result);
  if (result->reference->line_rms_m < kOtherReference * own_m) return;
  result->warnings.push_back(absl::StrFormat(
      "The reference laser plane does not fit the frames: with it the line is %.1f mm off the "
      "target (rms), with the plane of the other frames %.2f mm. It seems to be of another set-up.",
      1e3 * result->reference->line_rms_m, 1e3 * own_m));
}

}  // namespace

absl::StatusOr<CalibrationResult> CalibrateScanner(const CalibrationSet& set,
                                                   const CalibrationProgress& progress) {
  std::vector<std::string> images;
  CalibrationResult result;
  result.name = set.name;
  result.board = set.board;
  for (const CalibrationSetFrame& frame : set.frames) {
    images.push_back(frame.image);
    result.frames.emplace_back().name = frame.name;
  }
  progress(0, absl::StrCat("looks for the target in ", images.size(), " frames"));
  SIGHTLINE_ASSIGN_OR_RETURN(auto found, FindTargets(images, set.board));
  LeaveOutRepeated(result.frames, &found);
  result.columns_px = found.columns_px;
  result.rows_px = found.rows_px;
  const CameraPrior camera = ChooseCamera(set, found, &result.warnings);
  progress(0.3, "looks for the lines");
  SIGHTLINE_ASSIGN_OR_RETURN(auto used, FindLines(set, found, camera, &result));
  progress(0.4, "adjusts camera and laser plane, each frame left out once");
  SIGHTLINE_RETURN_IF_ERROR(FitShape(set, camera, &used, &result));
  SIGHTLINE_RETURN_IF_ERROR(FitHandEye(set, used, &result));
  std::vector<LeftOutFrame> left_out;
  for (size_t i = 0; i < used.frames.size(); ++i) {
    CalibrationFrameResult& frame = result.frames[used.numbers[i]];
    frame.used = true;
    left_out.push_back(frame.left_out);
    const LineInFrame& line = used.frames[i].line;
    const auto share = static_cast<double>(used.frames.size());
    result.crossing_sd_px += line.crossing_sd_px * line.crossing_sd_px / share;
    result.clipped_fraction += line.clipped_fraction / share;
  }
  result.crossing_sd_px = std::sqrt(result.crossing_sd_px);
  result.ratio = RealOverPredicted(left_out);
  SIGHTLINE_ASSIGN_OR_RETURN(result.planning,
                             DescribeForPlanning(result.rig, result.columns_px, result.rows_px));
  CompareWithReference(set, used, &result);
  progress(0.9, "measures the light beside the lines");
  SIGHTLINE_ASSIGN_OR_RETURN(result.light, MeasureLight(set, used, result));
  if (result.clipped_fraction > 0.5) {
    result.warnings.push_back(absl::StrFormat(
        "The line is clipped in %.0f %% of the rows or columns: its centre then depends on the "
        "light beside it. Record with a shorter exposure.",
        100 * result.clipped_fraction));
  }
  return result;
}

}  // namespace sightline
