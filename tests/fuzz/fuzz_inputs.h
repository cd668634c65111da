// SPDX-License-Identifier: Apache-2.0
// Bytes in the forms that readers want.
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "core/json/strict_json.h"

namespace sightline {

// Bytes as a file, in memory, for readers that want a path.
class MemoryFile {
 public:
  explicit MemoryFile(std::string_view bytes) : descriptor_(memfd_create("fuzz", MFD_CLOEXEC)) {
    if (descriptor_ < 0 ||
        write(descriptor_, bytes.data(), bytes.size()) != static_cast<ssize_t>(bytes.size())) {
      std::abort();
    }
  }
  ~MemoryFile() { close(descriptor_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  std::string path() const { return absl::StrCat("/proc/self/fd/", descriptor_); }

 private:
  int descriptor_;
};

// A folder in memory for readers that want one; one per process, whose files are overwritten.
class MemoryFolder {
 public:
  MemoryFolder() {
    if (mkdtemp(path_.data()) == nullptr) std::abort();
  }
  ~MemoryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  MemoryFolder(const MemoryFolder&) = delete;
  MemoryFolder& operator=(const MemoryFolder&) = delete;

  const std::string& path() const { return path_; }
  std::string Write(const std::string& name, std::string_view bytes) const {
    const std::filesystem::path file = std::filesystem::path(path_) / name;
    std::filesystem::create_directories(file.parent_path());
    std::ofstream(file, std::ios::binary) << bytes;
    return file.string();
  }

 private:
  std::string path_ = "/dev/shm/sightline-fuzz-XXXXXX";
};

template <typename Message>
Message ReadJson(std::string_view bytes) {
  Message message;
  const absl::Status status = ParseStrictJson(std::string(bytes), "fuzz.json", &message);
  // Accepted messages read back.
  if (status.ok()) {
    Message again;
    if (!ParseStrictJson(ToJson(message), "again.json", &again).ok()) std::abort();
  }
  return message;
}

}  // namespace sightline
