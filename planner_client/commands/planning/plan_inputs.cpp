// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/planning/plan_inputs.h"

#include <filesystem>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"
#include "core/text/number_text.h"
#include "planner_client/commands/part_assets.h"
#include "planning/plan_file/plan_file.h"

namespace sightline {

absl::Status ReadGivenScans(PlanOptions& options, PlannerRequest& request) {
  if (!options.keep.empty()) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto kept, ReadPlanScans(options.keep, &options.session.plans));
    request.locked = std::move(kept.all);
  }
  if (options.resume) {
    const std::string path = options.output.folder + "/plan.json";
    SIGHTLINE_ASSIGN_OR_RETURN(auto earlier, ReadPlanScans(path, &options.session.plans));
    for (size_t i = 0; i < earlier.all.size(); ++i) {
      (earlier.locked[i] ? request.locked : request.starting).push_back(earlier.all[i]);
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<EarlierPlan> ReadMeasuredScans(PlanOptions& options, PlannerRequest& request) {
  if (options.measured.files.empty()) return EarlierPlan{};
  if (!options.resume) {
    return absl::InvalidArgumentError(
        "--measured: needs --resume, since the points are of scans of the plan.json in --out");
  }
  if (options.optics) {
    return absl::InvalidArgumentError("--optics and --measured exclude each other");
  }
  return LockMeasuredScans(options.measured, options.output.folder, &request);
}

absl::Status CheckOptics(const PlanOptions& options) {
  if (!options.optics) return absl::OkStatus();
  if (!options.checkpoint.empty()) {
    return absl::InvalidArgumentError(
        "--optics and --checkpoint exclude each other: what the render worker answers is not kept");
  }
  if (options.pareto.front) {
    return absl::InvalidArgumentError(
        "--optics and --pareto exclude each other: pick a plan, then `sightline optics --plan`");
  }
  v1::Inspection message;
  const std::string& file = options.session.inspection_file;
  SIGHTLINE_RETURN_IF_ERROR(ReadStrictJsonFile(file, &message));
  return CheckImagingInspection(message, file).status();
}

absl::StatusOr<std::optional<SearchQuestion>> QuestionOf(const PlanOptions& options) {
  if (options.checkpoint.empty()) return std::nullopt;
  SIGHTLINE_ASSIGN_OR_RETURN(auto files, FilesOfInspection(options.session.inspection_file));
  for (const std::string& file : options.measured.files) {
    // The name may say which scan has measured the points.
    files.push_back(
        {absl::StrCat("--measured ", std::filesystem::path(file).filename().string()), file});
  }
  if (!options.measured.pose_file.empty()) files.push_back({"--pose", options.measured.pose_file});
  SIGHTLINE_ASSIGN_OR_RETURN(auto contents, FileContents::Of(std::move(files)));
  const AsMeasuredOptions& m = options.measured;
  return SearchQuestion{
      std::move(contents),
      m.files.empty()
          ? ""
          : absl::StrFormat("pose prior %s mm, %s deg; tolerated distance %s mm; unit %s",
                            NumberText(m.pose_prior_mm), NumberText(m.pose_prior_deg),
                            NumberText(m.tolerated_distance_mm), m.unit)};
}

}  // namespace sightline
