// SPDX-License-Identifier: Apache-2.0
#include "planning_service/task/file_contents.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <utility>

#include "absl/status/statusor.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "core/file/atomic_write.h"
#include "core/part/gltf_buffer_files.h"
#include "core/part/load_part.h"
#include "core/process_folder/process_folder.h"
#include "core/status/status_macros.h"
#include "core/text/step_length_unit.h"
#include "core/tolerance/qif/qif_reader.h"
#include "core/tolerance/qif/qif_units.h"
#include "planning_service/task/option_fields.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

// Scanning this much takes about two seconds of one core.
constexpr size_t kMostScannedBytes = size_t{64} << 20;
// A parsed document takes about ten times its size in memory.
constexpr size_t kMostQifBytes = size_t{4} << 20;

// A file that has a unit, and the fields that state both.
struct FileWithUnit {
  std::string file_field, unit_field;
  std::string file, unit;
};

std::vector<FileWithUnit> FilesOfTask(const v1::PlanningTask& task) {
  const v1::Inspection& inspection = task.inspection();
  std::vector<FileWithUnit> files = {{"inspection.part.file", "inspection.part.unit",
                                      inspection.part().file(), inspection.part().unit()}};
  for (int i = 0; i < inspection.obstacles_size(); ++i) {
    const std::string obstacle = absl::StrCat("inspection.obstacles[", i, "]");
    files.push_back({obstacle + ".file", obstacle + ".unit", inspection.obstacles(i).file(),
                     inspection.obstacles(i).unit()});
  }
  // The part's own file has the part's unit.
  if (inspection.tolerances().file() != inspection.part().file()) {
    files.push_back({"inspection.tolerances.file", "inspection.tolerances.unit",
                     inspection.tolerances().file(), inspection.tolerances().unit()});
  }
  files.push_back({"diagnose_options.part_file", "diagnose_options.part_unit",
                   task.diagnose_options().part_file(), task.diagnose_options().part_unit()});
  std::erase_if(files, [](const FileWithUnit& file) { return file.file.empty(); });
  return files;
}

absl::Status Violates(const std::string& field, const std::string& description) {
  return WithErrorInfo(InvalidFields({{field, description}}), "INVALID_FIELD");
}

// The first `most` + 1 bytes of a file.
absl::StatusOr<std::string> BytesOf(const std::string& file, size_t most,
                                    const TaskFilePieces& read) {
  std::string bytes;
  absl::Status status = read(file, [&](std::string_view piece) {
    bytes += piece.substr(0, most + 1 - bytes.size());
    return bytes.size() <= most;
  });
  if (!status.ok()) return status;
  return bytes;
}

// Result of a pass over the text of a STEP file.
struct StepText {
  bool is_step = true, states_none = false, states_all = false;
};

// `whole`: do not stop at the first unit.
absl::StatusOr<StepText> ScanStep(const std::string& file, bool whole, const TaskFilePieces& read) {
  StepLengthUnitScan scan;
  size_t bytes = 0;
  absl::Status status = read(file, [&](std::string_view piece) {
    scan.Add(piece);
    bytes += piece.size();
    return (whole || !scan.found()) && bytes <= kMostScannedBytes;
  });
  if (!status.ok()) return status;
  const bool is_known = bytes <= kMostScannedBytes;
  return StepText{scan.IsStep(), is_known && scan.StatesNone(), is_known && scan.StatesAll()};
}

absl::Status CheckStepText(const FileWithUnit& file, const StepText& text) {
  if (!text.is_step) {
    return Violates(file.file_field, absl::StrCat("is ", file.file,
                                                  ", which is no STEP file: it does not begin "
                                                  "with ISO-10303-21;"));
  }
  if (file.unit.empty() && text.states_none) {
    return Violates(file.unit_field, absl::StrCat("is missing: ", file.file,
                                                  " states no length unit, must be m, cm, mm, um "
                                                  "or inch"));
  }
  if (!file.unit.empty() && text.states_all) {
    return Violates(file.unit_field, absl::StrCat("is given, must be left out: ", file.file,
                                                  " states its length unit itself"));
  }
  return absl::OkStatus();
}

absl::Status CheckGltf(const FileWithUnit& file, const std::vector<std::string>& files,
                       const TaskFilePieces& read) {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto bytes, BytesOf(file.file, kMostScannedBytes, read));
  if (bytes.size() > kMostScannedBytes) return absl::OkStatus();
  const auto buffers = GltfBufferFiles(bytes);
  if (!buffers.ok()) {
    return Violates(file.file_field,
                    absl::StrCat("is ", file.file, ", which is ", buffers.status().message()));
  }
  for (const GltfBufferFile& buffer : *buffers) {
    const std::string name =
        (fs::path(file.file).parent_path() / buffer.file).lexically_normal().string();
    if (std::ranges::find(files, name) != files.end()) continue;
    return WithErrorInfo(
        absl::NotFoundError(absl::StrCat(
            file.file_field, ": ", file.file, " needs the file \"",
            absl::Utf8SafeCEscape(name.substr(0, 200)), "\" (", buffer.place,
            "), which did not come with the task; send it as well, or save the part as .glb")),
        "FILE_UNKNOWN", {{"field", file.file_field}, {"file", name.substr(0, 200)}});
  }
  return absl::OkStatus();
}

absl::Status CheckQif(const std::string& task_kind, const FileWithUnit& file,
                      const TaskFilePieces& read) {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto bytes, BytesOf(file.file, kMostQifBytes, read));
  if (bytes.size() > kMostQifBytes) return absl::OkStatus();
  const auto folder = ProcessFolder::Make(TemporaryBase(), "sightline-task");
  if (!folder.ok()) return absl::InternalError("no folder for checking the task");
  const std::string path = (fs::path(folder->path()) / "tolerances.qif").string();
  if (absl::Status written = WriteFileAtomically(path, bytes); !written.ok()) {
    return absl::InternalError("the QIF file cannot be written to be checked");
  }
  const absl::Status status = ReadQif(path, "", file.unit).status();
  if (!absl::IsInvalidArgument(status)) return absl::OkStatus();  // the job meets it again
  const std::string reason = absl::StrReplaceAll(status.message(), {{path, file.file}});
  return Violates(IsAboutQifLengthUnit(status) ? file.unit_field : file.file_field,
                  WithFieldNames(task_kind, reason));
}

}  // namespace

absl::Status CheckFileContents(const v1::PlanningTask& task, const std::vector<std::string>& files,
                               const TaskFilePieces& read) {
  // Results by file and by whether the whole file was scanned.
  std::map<std::pair<std::string, bool>, StepText> scanned;
  for (const FileWithUnit& file : FilesOfTask(task)) {
    SIGHTLINE_ASSIGN_OR_RETURN(const auto begin, BytesOf(file.file, 0, read));
    if (begin.empty())
      return Violates(file.file_field, absl::StrCat("is ", file.file, ", which is empty"));
    absl::Status checked;
    if (IsStepFileName(file.file)) {
      const std::pair key(file.file, !file.unit.empty());
      auto known = scanned.find(key);
      if (known == scanned.end()) {
        SIGHTLINE_ASSIGN_OR_RETURN(const StepText text, ScanStep(file.file, key.second, read));
        known = scanned.emplace(key, text).first;
      }
      checked = CheckStepText(file, known->second);
    } else if (absl::EndsWithIgnoreCase(file.file, ".gltf")) {
      checked = CheckGltf(file, files, read);
    } else if (absl::EndsWithIgnoreCase(file.file, ".qif")) {
      checked = CheckQif(task.kind(), file, read);
    }
    if (!checked.ok()) return checked;
  }
  return absl::OkStatus();
}

}  // namespace sightline
