// SPDX-License-Identifier: Apache-2.0
#include "report/plan/sections/report_data.h"

#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace sightline {

absl::Status CheckReportData(const ReportData& data) {
  const auto mismatch = [](absl::string_view field, size_t size, size_t expected,
                           absl::string_view what) {
    return absl::InvalidArgumentError(
        absl::StrFormat("report: %s has size %d, must be %d (%s)", field, size, expected, what));
  };
  const size_t targets = data.targets.size();
  if (targets == 0)
    return absl::InvalidArgumentError("report: targets is empty, must hold at least one");
  if (data.mesh.triangles.empty()) {
    return absl::InvalidArgumentError("report: mesh.triangles is empty, must hold at least one");
  }
  if (data.targets.normals.size() != targets) {
    return mismatch("targets.normals", data.targets.normals.size(), targets, "number of targets");
  }
  if (!data.targets.regions.empty() && data.targets.regions.size() != targets) {
    return mismatch("targets.regions", data.targets.regions.size(), targets, "number of targets");
  }
  if (data.measurable.size() != targets) {
    return mismatch("measurable", data.measurable.size(), targets, "number of targets");
  }
  if (!data.reasons.empty() && data.reasons.size() != targets) {
    return mismatch("reasons", data.reasons.size(), targets, "number of targets");
  }
  const auto faces = static_cast<size_t>(data.plan.resting_faces_size());
  if (!data.face_pictures_png.empty() && data.face_pictures_png.size() != faces) {
    return mismatch("face_pictures_png", data.face_pictures_png.size(), faces,
                    "number of resting faces of the plan");
  }
  const auto scans = static_cast<size_t>(data.plan.scans_size());
  if (data.scans.size() != scans)
    return mismatch("scans", data.scans.size(), scans, "number of scans of the plan");
  if (data.robot && data.robot->scans.size() != scans) {
    return mismatch("robot.scans", data.robot->scans.size(), scans, "number of scans of the plan");
  }
  for (size_t i = 0; i < scans; ++i) {
    if (data.scans[i].covered.size() != targets) {
      return mismatch(absl::StrCat("scans[", i, "].covered"), data.scans[i].covered.size(), targets,
                      "number of targets");
    }
    const v1::PlannedScan& scan = data.plan.scans(static_cast<int>(i));
    const std::pair<absl::string_view, const v1::Pose*> poses[] = {
        {"camera_pose", &scan.camera_pose()},
        {"laser_pose", &scan.laser_pose()},
        {"part_pose", &scan.part_pose()}};
    for (const auto& [name, pose] : poses) {
      if (pose->matrix_size() != 16) {
        return mismatch(absl::StrCat("plan.scans[", i, "].", name, ".matrix"), pose->matrix_size(),
                        16, "4 x 4 numbers");
      }
    }
  }
  if (!data.depth_per_pixel_m.empty() && data.depth_per_pixel_m.size() != targets) {
    return mismatch("depth_per_pixel_m", data.depth_per_pixel_m.size(), targets,
                    "number of targets");
  }
  if (data.uncertainty.has_value()) {
    return CheckTargetUncertainties(*data.uncertainty, targets, scans,
                                    static_cast<size_t>(data.plan.uncertainty().features_size()),
                                    "report: uncertainty");
  }
  return absl::OkStatus();
}

}  // namespace sightline
