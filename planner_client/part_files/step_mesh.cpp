// SPDX-License-Identifier: Apache-2.0
#include "planner_client/part_files/step_mesh.h"

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <system_error>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "core/digest/sha256.h"
#include "core/file/atomic_write.h"
#include "core/file/file_lock.h"
#include "core/file/read_file.h"
#include "core/status/status_macros.h"
#include "planner_client/part_files/private_folder.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr uint64_t kMaxGlbBytes = uint64_t{1} << 31;
constexpr uint64_t kMaxRecordBytes = uint64_t{1} << 20;
// First line of a record, and part of every key: another number when either changes.
constexpr char kRecordRule[] = "sightline step mesh 2";
// Beginning of the importer's lines about omissions (tools/step_import/main.cpp).
constexpr char kRemarkLine[] = "remark: ";

absl::StatusOr<std::string> KeyOfMesh(const StepFile& file, const StepMeshOptions& options) {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto program, FindStepProgram(file.path(), options.program));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto importer, DigestOfFile(program));
  // The mesh names the file that it was made of.
  return Sha256Hex(absl::StrCat(kRecordRule, "\n", file.sha256(), "\n", importer.sha256, "\n",
                                options.unit, "\n", options.construction_geometry, "\n",
                                fs::path(file.path()).filename().string()));
}

// The record beside a mesh: its digest and remarks, and a digest of these.
std::string RecordOf(const StepMesh& mesh) {
  std::string record = absl::StrCat(kRecordRule, "\n", Sha256Hex(mesh.glb), "\n");
  for (const std::string& remark : mesh.remarks)
    absl::StrAppend(&record, kRemarkLine, remark, "\n");
  return absl::StrCat(record, Sha256Hex(record), "\n");
}

std::vector<std::string> RemarksAmong(absl::string_view lines) {
  std::vector<std::string> remarks;
  for (absl::string_view line : absl::StrSplit(lines, '\n')) {
    if (absl::ConsumePrefix(&line, kRemarkLine)) remarks.emplace_back(line);
  }
  return remarks;
}

// An entry of the cache.
class KeptMesh {
 public:
  KeptMesh(const fs::path& folder, const std::string& key)
      : glb_((folder / (key + ".glb")).string()), record_((folder / (key + ".record")).string()) {}

  const std::string& glb_path() const { return glb_; }

  // The mesh, if it exists and is intact. `damaged`: it exists but is not intact.
  std::optional<StepMesh> Read(bool* damaged) const {
    *damaged = false;
    std::error_code error;
    // One file alone is no damage: a process ended between writing the two.
    if (!fs::exists(glb_, error) || !fs::exists(record_, error)) return std::nullopt;
    *damaged = true;
    auto glb = ReadRegularFile(glb_, kMaxGlbBytes);
    auto record = ReadRegularFile(record_, kMaxRecordBytes);
    if (!glb.ok() || !record.ok()) return std::nullopt;
    StepMesh mesh{glb_, *std::move(glb), RemarksAmong(*record)};
    if (RecordOf(mesh) != *record) return std::nullopt;
    *damaged = false;
    return mesh;
  }

  void Touch() const {
    std::error_code ignored;
    const auto now = fs::file_time_type::clock::now();
    fs::last_write_time(glb_, now, ignored);
    fs::last_write_time(record_, now, ignored);
  }

  absl::StatusOr<StepMesh> Make(const StepFile& file, const StepMeshOptions& options) const {
    SIGHTLINE_ASSIGN_OR_RETURN(auto unfinished, UnfinishedFile::Make(glb_, kPrivateFile));
    std::vector<std::string> arguments = {"--out", unfinished.temporary_path()};
    if (!options.unit.empty()) arguments.insert(arguments.end(), {"--unit", options.unit});
    if (options.construction_geometry) arguments.emplace_back("--construction-geometry");
    SIGHTLINE_ASSIGN_OR_RETURN(const auto said, RunStepImport(file, arguments, options.program));
    SIGHTLINE_ASSIGN_OR_RETURN(auto glb,
                               ReadRegularFile(unfinished.temporary_path(), kMaxGlbBytes));
    StepMesh mesh{glb_, std::move(glb), RemarksAmong(said)};
    SIGHTLINE_RETURN_IF_ERROR(unfinished.Commit());
    SIGHTLINE_RETURN_IF_ERROR(WriteFileAtomically(record_, RecordOf(mesh), kPrivateFile));
    return mesh;
  }

 private:
  const std::string glb_, record_;
};

absl::StatusOr<std::string> CacheFolder(const std::string& given) {
  std::string folder = given;
  if (const char* value = std::getenv(kStepCacheVariable); folder.empty() && value != nullptr) {
    folder = value;
  }
  if (!folder.empty()) {
    SIGHTLINE_RETURN_IF_ERROR(MakePrivateFolder(folder));
    return folder;
  }
  return UserCacheFolder("step");
}

}  // namespace

absl::StatusOr<StepMesh> MeshOfStepFile(const std::string& file, const StepMeshOptions& options) {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto step, StepFile::Read(file));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto key, KeyOfMesh(step, options));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto folder, CacheFolder(options.cache_folder));
  SIGHTLINE_ASSIGN_OR_RETURN(
      const auto lock, FileLock::AwaitFile((fs::path(folder) / (key + ".lock")).string(), {}));
  const KeptMesh kept(folder, key);
  bool damaged = false;
  if (auto mesh = kept.Read(&damaged)) {
    kept.Touch();
    return *std::move(mesh);
  }
  RemoveUnusedFiles(folder);
  auto made = kept.Make(step, options);
  if (made.ok() && damaged) {
    made->remarks.push_back(
        absl::StrCat("the kept mesh ", kept.glb_path(), " was damaged and has been made again"));
  }
  return made;
}

}  // namespace sightline
