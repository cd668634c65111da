// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/calibration_set/calibration_set.h"
#include "core/file/atomic_write.h"
#include "core/json/strict_json.h"
#include "core/recordings/recordings.h"
#include "core/scanner_calibration/calibration_verdict.h"
#include "core/status/status_macros.h"
#include "planner_client/calibration/calibrate_scanner.h"
#include "planner_client/calibration/calibration_files.h"
#include "planner_client/calibration/recorded_lines.h"
#include "planner_client/command_line/process/exit_code.h"
#include "planner_client/command_line/process/output_folder.h"
#include "planner_client/command_line/process/progress_line.h"
#include "planner_client/commands/commands.h"
#include "planner_client/part_files/part_file.h"
#include "report/calibration/calibration_report.h"
#include "report/document/report_page.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

// Fraction of clipped rows or columns above which every crop of a line contains clipping.
constexpr double kAllClipped = 0.99;

struct CalibrateOptions {
  std::string folder, part, unit, out;
};

absl::Status WriteFiles(const CalibrateOptions& options, const CalibrationSet& set,
                        const CalibrationResult& result) {
  const fs::path out = options.out;
  const std::string part =
      options.part.empty() ? ""
                           : fs::relative(fs::absolute(options.part), fs::absolute(out)).string();
  v1::Inspection inspection = CalibratedInspection(result, set, part);
  if (!options.unit.empty()) inspection.mutable_part()->set_unit(options.unit);
  if (options.part.empty()) {
    SIGHTLINE_RETURN_IF_ERROR(
        WriteFileAtomically((out / "target.stl").string(), TargetStl(result.board)));
  }
  SIGHTLINE_RETURN_IF_ERROR(
      WriteFileAtomically((out / "inspection.json").string(), ToJson(inspection) + "\n"));
  SIGHTLINE_RETURN_IF_ERROR(
      WriteFileAtomically((out / "calibration.json").string(), CalibrationJson(result)));
  return WriteReport(CalibrationReport(result), (out / "report.html").string());
}

// Writes the folder recordings/ for sightline diagnose; returns a sentence about it.
absl::StatusOr<std::string> WriteRecordings(const CalibrateOptions& options,
                                            const CalibrationSet& set,
                                            const CalibrationResult& result) {
  const fs::path folder = fs::path(options.out) / "recordings";
  std::error_code error;
  fs::remove_all(folder, error);  // of an earlier run, whose lines may be of another scanner
  const auto lines = RecordedLinesOf(set, result);
  if (!lines.ok()) {
    return absl::StrCat("recordings/ is not written: ", lines.status().message());
  }
  fs::create_directories(folder / "images", error);
  if (error) {
    return absl::UnavailableError(absl::StrCat(folder.string(), ": ", error.message()));
  }
  for (const auto& [file, bytes] : lines->images) {
    SIGHTLINE_RETURN_IF_ERROR(WriteFileAtomically((folder / file).string(), bytes));
  }
  SIGHTLINE_RETURN_IF_ERROR(WriteFileAtomically((folder / "recordings.json").string(),
                                                RecordingsToJson(lines->recordings) + "\n"));
  return absl::StrFormat(
      "recordings/ has %d pieces of the lines for sightline diagnose; %.0f %% of their length is "
      "left out, since dark squares, edges or other parts are beside it%s",
      lines->images.size(), 100.0 * lines->left_out_px / std::max(1, lines->line_px),
      result.clipped_fraction > kAllClipped
          ? ". All lines are clipped: diagnose refuses the set until laser.power_w and "
            "exposure_time_s are stated in recordings.json"
          : "");
}

absl::StatusOr<int> Calibrate(const CalibrateOptions& options) {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto set, ReadCalibrationSet(options.folder));
  if (!options.part.empty()) {
    SIGHTLINE_RETURN_IF_ERROR(LoadPartFile(options.part, options.unit, {}).status());
  }
  SIGHTLINE_ASSIGN_OR_RETURN(const auto out_lock, OpenOutputFolder(options.out));
  ProgressLine line;
  const auto result = CalibrateScanner(set, [&line](double fraction, const std::string& phase) {
    line.Show(fraction, "calibrate: " + phase);
  });
  line.Finish();
  if (!result.ok()) return result.status();
  SIGHTLINE_RETURN_IF_ERROR(WriteFiles(options, set, *result));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto recordings, WriteRecordings(options, set, *result));

  std::printf("frame                 real rms mm  predicted rms mm  ratio\n");
  for (const CalibrationFrameResult& frame : result->frames) {
    if (!frame.used) {
      std::printf("%-20s  not used: %s\n", frame.name.c_str(), frame.because.c_str());
      continue;
    }
    std::printf("%-20s  %11.3f  %16.3f  %5.2f%s\n", frame.name.c_str(), 1e3 * frame.left_out.rms_m,
                1e3 * frame.left_out.predicted_rms_m,
                frame.left_out.rms_m / frame.left_out.predicted_rms_m,
                FarOffRemark(frame.left_out).empty() ? "" : "  far off");
  }
  std::printf("\nreal over predicted   %.2f (95 %%: %.2f to %.2f)\n", result->ratio.value,
              result->ratio.low, result->ratio.high);
  std::printf("%s\n", VerdictText(result->ratio, result->UsedFrames()).c_str());
  if (result->hand_eye) {
    std::printf("hand-eye closure      %.2f mm\n", 1e3 * result->hand_eye->closure_m);
  }
  for (const std::string& finding : LightFindings(result->light)) {
    std::printf("light: %s\n", finding.c_str());
  }
  for (const std::string& warning : result->warnings) {
    std::printf("warning: %s\n", warning.c_str());
  }
  std::printf("%s\n", recordings.c_str());
  for (const char* file : {"inspection.json", "calibration.json", "report.html", "report.json"}) {
    std::printf("%s\n", fs::absolute(fs::path(options.out) / file).c_str());
  }
  return kExitDone;
}

}  // namespace

Command AddCalibrateCommand(CLI::App& app) {
  auto options = std::make_shared<CalibrateOptions>();
  app.add_option("folder", options->folder, "folder with calibration_set.json and its images")
      ->required();
  app.add_option("--part", options->part,
                 "part of the written inspection; default: the target as a plate");
  app.add_option("--unit", options->unit,
                 "length unit of a part file that states none: m, cm, mm, um, inch");
  app.add_option("--out", options->out,
                 "folder for inspection.json, calibration.json, report.html, report.json and "
                 "recordings/")
      ->required();
  return [options]() -> int {
    const absl::StatusOr<int> code = Calibrate(*options);
    return code.ok() ? *code : ReportError(code.status());
  };
}

}  // namespace sightline
