// SPDX-License-Identifier: Apache-2.0
#include "planner_client/part_files/step_mesh.h"

#include <fcntl.h>
#include <openssl/evp.h>
#include <stdlib.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <mutex>
#include <system_error>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr auto kKeptUnused = std::chrono::hours(24 * 30);

// A folder of this process, removed when it ends.
class ProcessFolder {
 public:
  ProcessFolder() {
    std::string folder = (fs::temp_directory_path() / "sightline-step-XXXXXX").string();
    if (mkdtemp(folder.data()) != nullptr) path_ = folder;
  }
  ~ProcessFolder() {
    std::error_code ignored;
    if (!path_.empty()) fs::remove_all(path_, ignored);
  }
  ProcessFolder(const ProcessFolder&) = delete;
  ProcessFolder& operator=(const ProcessFolder&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

bool CanWrite(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  return !error && access(folder.c_str(), W_OK | X_OK) == 0;
}

absl::StatusOr<fs::path> CacheFolder(const std::string& given) {
  if (!given.empty()) {
    if (CanWrite(given)) return fs::path(given);
    return absl::InvalidArgumentError(absl::StrCat(given, ": cannot be written"));
  }
  const auto from = [](const char* variable) {
    const char* value = std::getenv(variable);
    const fs::path path = value == nullptr ? "" : value;
    return path.is_absolute() ? path : fs::path();
  };
  for (const fs::path& base : {from("XDG_CACHE_HOME"), from("HOME") / ".cache"}) {
    const fs::path folder = base / "sightline" / "step";
    if (base.is_absolute() && CanWrite(folder)) return folder;
  }
  static const ProcessFolder own;
  if (!own.path().empty()) return fs::path(own.path());
  return absl::UnavailableError("no folder can be written for the mesh of a STEP file");
}

// SHA-256 of what the mesh depends on: the file, and the importer as far as its file tells.
absl::StatusOr<std::string> KeyOf(const std::string& file, const std::string& program) {
  std::ifstream bytes(file, std::ios::binary);
  if (!bytes) return absl::NotFoundError(absl::StrCat(file, ": ", std::strerror(errno)));
  const std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> digest(EVP_MD_CTX_new(),
                                                                       &EVP_MD_CTX_free);
  EVP_DigestInit_ex(digest.get(), EVP_sha256(), nullptr);
  std::vector<char> buffer(1 << 20);
  while (bytes) {
    bytes.read(buffer.data(), static_cast<std::streamsize>(buffer.size()));
    EVP_DigestUpdate(digest.get(), buffer.data(), static_cast<size_t>(bytes.gcount()));
  }
  if (bytes.bad()) return absl::NotFoundError(absl::StrCat(file, ": cannot be read"));
  std::error_code error;
  const std::string importer =
      absl::StrCat(fs::file_size(program, error), " ",
                   fs::last_write_time(program, error).time_since_epoch().count());
  EVP_DigestUpdate(digest.get(), importer.data(), importer.size());
  std::array<unsigned char, EVP_MAX_MD_SIZE> hash;
  unsigned int size = 0;
  EVP_DigestFinal_ex(digest.get(), hash.data(), &size);
  return absl::BytesToHexString(
      absl::string_view(reinterpret_cast<const char*>(hash.data()), size));
}

// Held by one process at a time; the kernel gives it back however the process ends.
class FileLock {
 public:
  explicit FileLock(const fs::path& path)
      : fd_(open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600)) {
    if (fd_ < 0) return;
    while (flock(fd_, LOCK_EX) != 0 && errno == EINTR) {
    }
  }
  ~FileLock() {
    if (fd_ >= 0) close(fd_);
  }
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;
  bool held() const { return fd_ >= 0; }

 private:
  int fd_;
};

void RemoveUnused(const fs::path& folder) {
  std::error_code error;
  const auto now = fs::file_time_type::clock::now();
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    std::error_code gone;
    if (now - entry.last_write_time(gone) > kKeptUnused && !gone) fs::remove(entry.path(), gone);
  }
}

}  // namespace

absl::StatusOr<std::string> MeshOfStepFile(const std::string& file,
                                           const StepMeshOptions& options) {
  std::error_code error;
  if (!fs::is_regular_file(file, error)) {
    return absl::NotFoundError(absl::StrCat(file, ": no such file"));
  }
  const auto program = FindStepProgram(file, options.program);
  if (!program.ok()) return program.status();
  const auto folder = CacheFolder(options.cache_folder);
  if (!folder.ok()) return folder.status();
  const auto key = KeyOf(file, *program);
  if (!key.ok()) return key.status();
  const fs::path mesh = *folder / (*key + ".glb");
  const FileLock lock(*folder / (*key + ".lock"));
  if (!lock.held()) {
    return absl::UnavailableError(absl::StrCat(folder->string(), ": ", std::strerror(errno)));
  }
  if (fs::exists(mesh, error)) {
    fs::last_write_time(mesh, fs::file_time_type::clock::now(), error);
    return mesh.string();
  }
  RemoveUnused(*folder);
  const fs::path unfinished = *folder / absl::StrCat(*key, ".unfinished.glb");
  const auto made = RunStepImport(file, {"--out", unfinished.string()}, options.program);
  if (made.ok()) fs::rename(unfinished, mesh, error);
  if (made.ok() && !error) return mesh.string();
  std::error_code ignored;
  fs::remove(unfinished, ignored);
  if (!made.ok()) return made.status();
  return absl::UnavailableError(absl::StrCat(mesh.string(), ": ", error.message()));
}

}  // namespace sightline
