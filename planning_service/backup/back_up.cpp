// SPDX-License-Identifier: Apache-2.0
#include "planning_service/backup/back_up.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <set>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "core/file/atomic_write.h"
#include "core/status/status_macros.h"
#include "planning_service/artefact_store/artefact_store.h"
#include "planning_service/job_store/database_identity.h"
#include "planning_service/job_store/planning_job_store.h"
#include "planning_service/job_store/sqlite_database.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr char kDatabase[] = "jobs.sqlite";
// Name of an empty file that marks a backup without a database.
constexpr char kBackupMark[] = "backup-of-files";

std::string In(const std::string& folder, const char* name) {
  return absl::StrCat(folder, "/", name);
}

// True if the folder has files but is neither a backup nor a data folder. Folders that belong to
// the file system itself do not count.
bool HoldsOtherFiles(const std::string& folder) {
  std::error_code error;
  bool others = false;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    if (name == kDatabase || name == kBackupMark || name == "artefacts") return false;
    if (name != "lost+found") others = true;
  }
  return others;
}

absl::Status CheckFolders(const std::string& data_folder, const std::string& backup_folder) {
  std::error_code error;
  if (!fs::is_directory(In(data_folder, "artefacts"), error)) {
    return absl::NotFoundError(absl::StrCat(
        data_folder, ": is not the data folder of a planning service: it has no artefacts"));
  }
  const fs::path data = fs::weakly_canonical(data_folder, error);
  const fs::path backup = fs::weakly_canonical(backup_folder, error);
  if (data == backup) {
    return absl::FailedPreconditionError(
        absl::StrCat(backup_folder, ": is the data folder itself"));
  }
  // The service removes unknown files in its folder, and the backup would contain itself.
  if (std::mismatch(data.begin(), data.end(), backup.begin(), backup.end()).first == data.end()) {
    return absl::FailedPreconditionError(
        absl::StrCat(backup_folder, ": lies inside the data folder ", data_folder,
                     "; nothing was changed. Choose a folder outside of it"));
  }
  if (HoldsOtherFiles(backup_folder)) {
    return absl::FailedPreconditionError(
        absl::StrCat(backup_folder,
                     ": has other files and no backup; nothing was changed. Choose a folder that "
                     "is new, empty or an earlier backup"));
  }
  fs::create_directories(backup_folder, error);
  if (!error) fs::permissions(backup_folder, fs::perms::owner_all, error);  // parts are secrets
  if (error)
    return absl::ErrnoToStatus(error.value(), absl::StrCat(backup_folder, ": cannot be made"));
  return absl::OkStatus();
}

// Digests that a copied database names.
absl::StatusOr<std::set<std::string>> NamedIn(const std::string& database) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto store, OpenSqliteJobStore(database));
  return store->NamedDigests();
}

bool HaveJobInCommon(PlanningJobStore* one, PlanningJobStore* other) {
  PlanningJobFilter page;
  page.limit = 1000;
  while (true) {
    const auto jobs = one->List(page);
    if (!jobs.ok() || jobs->empty()) return false;
    for (const PlanningJob& job : *jobs) {
      if (other->Get(job.job_id).ok()) return true;
    }
    page.before_sequence = jobs->back().sequence;
  }
}

// Checks that `copy` may replace the existing `database` in the backup folder, which must be an
// earlier backup of the same jobs.
absl::Status CheckReplaceable(const std::string& database, const std::string& copy) {
  const std::string folder = fs::path(database).parent_path().string();
  SIGHTLINE_ASSIGN_OR_RETURN(const auto theirs, ReadSqliteIdentity(database));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto ours, ReadSqliteIdentity(copy));
  if (theirs && !theirs->is_unchanged_copy) {
    return absl::FailedPreconditionError(
        absl::StrCat(folder,
                     ": has jobs of a service that worked with this folder, so that it is"
                     " no backup; nothing was changed. Choose another folder"));
  }
  if (theirs && ours) {
    if (DescendsFrom(*ours, *theirs)) return absl::OkStatus();
    return absl::FailedPreconditionError(
        absl::StrCat(folder, ": holds the backup of another service (", theirs->identity, ", not ",
                     ours->identity, "); nothing was changed. Choose another folder"));
  }
  // One of the two databases has no identity: an older version made it.
  SIGHTLINE_ASSIGN_OR_RETURN(const auto target, OpenSqliteJobStore(database));
  PlanningJobFilter any;
  any.limit = 1;
  SIGHTLINE_ASSIGN_OR_RETURN(const auto jobs, target->List(any));
  if (jobs.empty()) return absl::OkStatus();
  SIGHTLINE_ASSIGN_OR_RETURN(const auto source, OpenSqliteJobStore(copy));
  if (HaveJobInCommon(target.get(), source.get())) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat(folder,
                   ": has jobs, and none of them is of the data folder; nothing was"
                   " changed. Choose another folder"));
}

void RemoveDatabase(const std::string& file) {
  std::error_code error;
  for (const char* suffix : {"", "-wal", "-shm", ".lock"}) fs::remove(file + suffix, error);
}

// Gives the copied database its final name, durably.
absl::Status Conclude(const std::string& copy, const std::string& database) {
  std::error_code error;
  // These files belong to the replaced database, which no process has open.
  for (const char* suffix : {"-wal", "-shm"}) fs::remove(database + suffix, error);
  if (std::rename(copy.c_str(), database.c_str()) != 0) {
    return absl::ErrnoToStatus(errno, absl::StrCat(database, ": cannot be made"));
  }
  RemoveDatabase(copy);
  const std::string folder = fs::path(database).parent_path().string();
  const int fd = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  const bool flushed = fd >= 0 && fsync(fd) == 0;
  const int code = errno;
  if (fd >= 0) close(fd);
  if (flushed) return absl::OkStatus();
  return absl::ErrnoToStatus(code, absl::StrCat(folder, ": cannot be flushed to disk"));
}

}  // namespace

absl::StatusOr<BackupReport> BackUp(const std::string& data_folder,
                                    const std::string& backup_folder, bool only_files,
                                    const std::atomic<bool>& stop) {
  SIGHTLINE_RETURN_IF_ERROR(CheckFolders(data_folder, backup_folder));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto from, ArtefactStore::Open(In(data_folder, "artefacts"), 0));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto to, ArtefactStore::Open(In(backup_folder, "artefacts"), 0));
  // Files that the copied database names are held until they are copied, even if the service
  // forgets them meanwhile.
  SIGHTLINE_ASSIGN_OR_RETURN(const auto hold, from->Hold());

  const std::string database = In(backup_folder, kDatabase);
  const std::string copy = absl::StrCat(database, ".new");
  std::set<std::string> named;
  std::unique_ptr<SqlDatabase> earlier;  // kept open, so that no service starts on it
  if (only_files) {
    std::error_code error;
    if (fs::exists(database, error)) {
      return absl::FailedPreconditionError(
          absl::StrCat(backup_folder,
                       ": holds a database, and --only-files would take away the"
                       " files that it names. Choose another folder"));
    }
    // The folder "work" shows that a service has run here. Backups of older versions have neither.
    if (fs::exists(In(backup_folder, "work"), error) &&
        !fs::exists(In(backup_folder, kBackupMark), error)) {
      return absl::FailedPreconditionError(
          absl::StrCat(backup_folder,
                       ": is the data folder of a service; nothing was changed."
                       " Choose another folder"));
    }
    SIGHTLINE_RETURN_IF_ERROR(
        WriteFileAtomically(In(backup_folder, kBackupMark), "", kPrivateFile));
    named = from->Digests();
  } else {
    RemoveDatabase(copy);
    SIGHTLINE_RETURN_IF_ERROR(CopySqliteDatabase(In(data_folder, kDatabase), copy));
    std::error_code error;
    if (fs::exists(database, error)) {
      if (absl::Status allowed = CheckReplaceable(database, copy); !allowed.ok()) {
        RemoveDatabase(copy);
        return allowed;
      }
      SIGHTLINE_ASSIGN_OR_RETURN(earlier, OpenSqliteDatabase(database));
    }
    SIGHTLINE_RETURN_IF_ERROR(MarkSqliteCopy(copy));
    SIGHTLINE_ASSIGN_OR_RETURN(named, NamedIn(copy));
  }

  BackupReport report;
  for (const std::string& digest : named) {
    if (stop)
      return absl::CancelledError("the backup was stopped; the folder holds the one before");
    ++report.files;
    if (to->Has(digest)) continue;
    const auto path = from->Path(digest);
    if (!path.ok()) {
      return absl::DataLossError(
          absl::StrCat(data_folder, ": a job names the file ", digest, ", which is gone"));
    }
    SIGHTLINE_ASSIGN_OR_RETURN(const auto added, to->AddFile(*path));
    if (added.digest != digest) {
      return absl::DataLossError(absl::StrCat(*path, ": is damaged: its digest is ", added.digest));
    }
    ++report.copied_files;
    report.copied_bytes += added.size_bytes;
  }
  if (!only_files) {
    SIGHTLINE_RETURN_IF_ERROR(Conclude(copy, database));
  }
  SIGHTLINE_RETURN_IF_ERROR(to->RemoveAllBut(named, absl::ZeroDuration()).status());
  return report;
}

}  // namespace sightline
