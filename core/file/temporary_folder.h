// Folders for the life of an object.
#pragma once

#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "core/file/folder_lock.h"

namespace sightline {

// A new folder of mode 0700, removed with the object. Those that processes left behind which were
// killed are removed by the next Make with the same base and prefix: they are not locked any
// longer.
class TemporaryFolder {
 public:
  // `base`: an existing folder, such as that of the environment's TMPDIR. The name is `prefix`, a
  // hyphen and 6 characters. UNAVAILABLE names the base and why no folder can be made there.
  static absl::StatusOr<TemporaryFolder> Make(const std::string& base, const std::string& prefix);

  TemporaryFolder(TemporaryFolder&& other) noexcept;
  TemporaryFolder& operator=(TemporaryFolder&& other) noexcept;
  ~TemporaryFolder();

  const std::string& path() const { return path_; }

 private:
  TemporaryFolder() = default;
  std::string path_;
  std::optional<FolderLock> lock_;
};

// TMPDIR of the environment, else /tmp.
std::string TemporaryBase();

}  // namespace sightline
