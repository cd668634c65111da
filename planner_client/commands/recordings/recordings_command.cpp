// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "core/file/atomic_write.h"
#include "core/inspection/inspection.h"
#include "core/json/strict_json.h"
#include "core/recordings/assumed_values.h"
#include "core/recordings/check/check_recordings.h"
#include "core/recordings/load_images.h"
#include "core/recordings/recordings.h"
#include "core/recordings/reduction/reduce_posed_plates.h"
#include "core/recordings/reduction/start_from_images.h"
#include "core/recordings/shot_list.h"
#include "core/status/status_macros.h"
#include "planner_client/command_line/process/exit_code.h"
#include "planner_client/command_line/process/output_folder.h"
#include "planner_client/command_line/process/print.h"
#include "planner_client/commands/commands.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

struct NewOptions {
  std::string input, out = "recordings";
  int images = 44;
};

absl::StatusOr<int> New(const NewOptions& options) {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto inspection, ReadInspection(options.input));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto list,
                             PlanShotList(inspection, options.input, options.images));
  const fs::path folder = options.out;
  if (fs::exists(folder / "recordings.json")) {
    return absl::InvalidArgumentError(
        absl::StrCat(options.out, ": has a recordings.json already; give another --out"));
  }
  SIGHTLINE_ASSIGN_OR_RETURN(const auto out_lock, OpenOutputFolder(options.out));
  SIGHTLINE_RETURN_IF_ERROR(MakeOutputFolder((folder / "images").string()));
  SIGHTLINE_RETURN_IF_ERROR(
      WriteFileAtomically((folder / "README.md").string(), ShotListText(list)));
  SIGHTLINE_RETURN_IF_ERROR(WriteFileAtomically(
      (folder / "recordings.json").string(), RecordingsToJson(RecordingsToProto(list.set)) + "\n"));
  for (const std::string& note : list.notes) PrintTextTo(stderr, "note: %s\n", note.c_str());
  PrintText("%zu recordings to take:\n", list.set.recordings.size());
  for (const char* file : {"README.md", "recordings.json"}) {
    PrintText("%s\n", fs::absolute(folder / file).c_str());
  }
  return kExitDone;
}

// Describes the missing images: named, if there are few, else how many.
std::string MissingText(const std::vector<std::string>& missing) {
  constexpr size_t kNamed = 5;
  const size_t named = std::min(missing.size(), kNamed);
  std::string text =
      absl::StrJoin(missing.begin(), missing.begin() + static_cast<int64_t>(named), ", ");
  if (missing.size() > named) absl::StrAppend(&text, ", ... (", missing.size(), ")");
  return text;
}

absl::StatusOr<int> Check(const std::string& input) {
  fs::path folder = input;
  fs::path description = folder / "recordings.json";
  if (fs::is_regular_file(folder)) {
    description = folder;
    folder = folder.parent_path();
  }
  v1::Recordings message;
  SIGHTLINE_RETURN_IF_ERROR(ReadRecordingsMessage(description.string(), &message));
  std::vector<std::string> paths, notes, missing;
  // Plates in poses usually state little; other sets are made by a shot list, which states all.
  if (message.format_version() == 3) notes = AssumeMissingValues(&message);
  SIGHTLINE_ASSIGN_OR_RETURN(auto set, ParseRecordings(message, description.string()));
  for (const RecordedImage& image : set.recordings) {
    paths.push_back((folder / image.file).string());
    std::error_code error;
    if (!fs::exists(paths.back(), error)) missing.push_back(image.file);
  }
  if (missing.size() == paths.size()) {
    return absl::NotFoundError(absl::StrCat(
        description.string(), ": none of its ", paths.size(), " images is there yet: ",
        MissingText(missing), "; record them as the README.md beside it says, and check again"));
  }
  absl::StatusOr<LoadedImages> loaded = LoadRecordedImages(set, paths);
  if (!loaded.ok()) {
    return absl::Status(loaded.status().code(),
                        absl::StrCat(description.string(), ": ", loaded.status().message()));
  }
  std::vector<Image<uint16_t>>& images = loaded->raw_dn;
  std::vector<std::string> errors = loaded->errors;
  notes.insert(notes.end(), loaded->remarks.begin(), loaded->remarks.end());
  if (loaded->eight_bit_files) {
    notes.push_back(TakeNarrowNumbers(EightBitNumbers(set.camera), &set, &images));
  }
  if (set.posed) {
    const RecordingCheck whole = CheckRecordings(set, images);
    errors.insert(errors.end(), whole.errors.begin(), whole.errors.end());
    SIGHTLINE_ASSIGN_OR_RETURN(auto reduced, ReducePosedPlates(set, images));
    set = std::move(reduced.set);
    images = std::move(reduced.raw_dn);
    notes.insert(notes.end(), reduced.remarks.begin(), reduced.remarks.end());
    for (std::string& note : StartFromImages(images, &set)) notes.push_back(std::move(note));
  }
  RecordingCheck check = CheckRecordings(set, images);
  if (check.narrow) {
    notes.push_back(TakeNarrowNumbers(*check.narrow, &set, &images));
    check = CheckRecordings(set, images);
  }
  check.warnings.insert(check.warnings.begin(), notes.begin(), notes.end());
  errors.insert(errors.end(), check.errors.begin(), check.errors.end());

  PrintText("file                 kind     mean DN  largest  saturated  line  remarks\n");
  for (size_t i = 0; i < images.size(); ++i) {
    const RecordedImage& recording = set.recordings[i];
    const RecordingState& state = check.recordings[i];
    const char* kind = recording.kind == RecordingKind::kLaser  ? "laser"
                       : recording.kind == RecordingKind::kDark ? "dark"
                                                                : "ambient";
    const std::string& file =
        recording.part_of_image ? recording.part_of_image->file : recording.file;
    if (std::find(missing.begin(), missing.end(), file) != missing.end()) continue;
    if (images[i].empty()) {
      PrintText("%-20s %-7s %8s %8s %10s  %-4s  not usable\n", recording.file.c_str(), kind, "-",
                "-", "-", "-");
      continue;
    }
    PrintText("%-20s %-7s %8.1f %8.0f %8.2f %%  %-4s  %s\n", recording.file.c_str(), kind,
              state.mean_dn, state.largest_dn, 100 * state.saturated_fraction,
              set.format_version != 1 ? "-"
              : state.line_found      ? "yes"
                                      : "no",
              absl::StrJoin(state.remarks, "; ").c_str());
  }
  PrintText("\n");
  for (const std::string& warning : check.warnings) PrintText("warning: %s\n", warning.c_str());
  // One line for all that are not there.
  std::erase_if(errors, [&](const std::string& error) {
    return std::any_of(missing.begin(), missing.end(), [&](const std::string& file) {
      return absl::StartsWith(error, file + ": recordings[") &&
             absl::StrContains(error, "].file is missing");
    });
  });
  if (!missing.empty()) {
    errors.push_back(absl::StrCat(missing.size(), " of ", paths.size(),
                                  " images are not there: ", MissingText(missing)));
  }
  for (const std::string& error : errors) PrintText("error: %s\n", error.c_str());
  if (!errors.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(
        description.string(), ": ", errors.size(), " error", errors.size() > 1 ? "s" : "",
        ", see above; take or save these recordings again"));
  }
  PrintText("%zu recordings: usable%s\n", images.size(),
            check.warnings.empty() ? "" : ", with warnings");
  return kExitDone;
}

}  // namespace

Command AddRecordingsCommand(CLI::App& app) {
  app.require_subcommand(1);
  auto fresh = std::make_shared<NewOptions>();
  CLI::App* add = app.add_subcommand("new", "shot list and skeleton folder for recordings");
  add->add_option("inspection", fresh->input, "inspection.json with sensor, lens and laser")
      ->required();
  add->add_option("--out", fresh->out, "folder for recordings.json, README.md and images/")
      ->capture_default_str();
  add->add_option("--images", fresh->images, "about how many; bursts are not cut")
      ->check(CLI::Range(kFewestShots, kMostShots))
      ->capture_default_str();
  auto folder = std::make_shared<std::string>();
  CLI::App* check =
      app.add_subcommand("check", "whether recordings are usable, while the rig still stands");
  check->add_option("folder", *folder, "folder of recordings, or its recordings.json")->required();
  return [=]() -> int {
    const absl::StatusOr<int> code = add->parsed() ? New(*fresh) : Check(*folder);
    return code.ok() ? *code : ReportError(code.status());
  };
}

}  // namespace sightline
