#include "core/file/temporary_folder.h"

#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr size_t kRandomCharacters = 6;
// Between making a folder and locking it there is a moment.
constexpr time_t kYoungest_s = 60;
constexpr int kMostLookedAt = 10'000;  // entries of the base folder

bool IsAbandoned(const std::string& path) {
  struct stat state {};
  return lstat(path.c_str(), &state) == 0 && S_ISDIR(state.st_mode) && state.st_uid == geteuid() &&
         time(nullptr) - state.st_mtime >= kYoungest_s;
}

void RemoveAbandoned(const std::string& base, const std::string& prefix) {
  std::error_code error;
  int looked_at = 0;
  for (fs::directory_iterator entry(base, error), end;
       !error && entry != end && ++looked_at <= kMostLookedAt; entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (name.size() != prefix.size() + kRandomCharacters || !absl::StartsWith(name, prefix)) {
      continue;
    }
    const std::string path = entry->path().string();
    if (!IsAbandoned(path)) continue;
    const absl::StatusOr<FolderLock> lock = FolderLock::Take(path);
    if (!lock.ok()) continue;
    std::error_code ignored;
    fs::remove_all(path, ignored);
  }
}

}  // namespace

absl::StatusOr<TemporaryFolder> TemporaryFolder::Make(const std::string& base,
                                                      const std::string& prefix) {
  RemoveAbandoned(base, prefix + "-");
  TemporaryFolder folder;
  std::string path = absl::StrCat(base, "/", prefix, "-", std::string(kRandomCharacters, 'X'));
  if (mkdtemp(path.data()) == nullptr) {
    return absl::UnavailableError(
        absl::StrCat("cannot make a folder in ", base, ": ", std::strerror(errno)));
  }
  folder.path_ = std::move(path);
  absl::StatusOr<FolderLock> lock = FolderLock::Take(folder.path_);
  if (!lock.ok()) return absl::UnavailableError(lock.status().message());
  folder.lock_ = *std::move(lock);
  return folder;
}

TemporaryFolder::TemporaryFolder(TemporaryFolder&& other) noexcept
    : path_(std::exchange(other.path_, "")), lock_(std::move(other.lock_)) {}

TemporaryFolder& TemporaryFolder::operator=(TemporaryFolder&& other) noexcept {
  std::swap(path_, other.path_);
  std::swap(lock_, other.lock_);
  return *this;
}

TemporaryFolder::~TemporaryFolder() {
  if (path_.empty()) return;
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

std::string TemporaryBase() {
  const char* given = std::getenv("TMPDIR");
  return given != nullptr && *given != '\0' ? given : "/tmp";
}

}  // namespace sightline
