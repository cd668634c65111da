// SPDX-License-Identifier: Apache-2.0
#include "core/file/read_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "absl/strings/str_cat.h"
#include "core/file/no_such_file.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

absl::Status CannotBeRead(const std::string& path, int error) {
  return absl::NotFoundError(absl::StrCat(path, ": cannot be read: ", std::strerror(error),
                                          error == ENOENT ? NameInOtherCase(path) : ""));
}

std::string MebibytesText(uint64_t bytes) {
  return bytes < uint64_t{1} << 20 ? absl::StrCat(bytes, " bytes")
                                   : absl::StrCat((bytes + (1 << 20) - 1) >> 20, " MiB");
}

absl::Status TooLarge(const std::string& path, const std::string& size, uint64_t max_bytes) {
  return absl::InvalidArgumentError(
      absl::StrCat(path, ": has ", size, ", at most ", MebibytesText(max_bytes), " can be read"));
}

}  // namespace

absl::StatusOr<File> OpenRegularFile(const std::string& path) {
  // Opening a pipe without a writer would wait otherwise.
  const int descriptor = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
  if (descriptor < 0) return CannotBeRead(path, errno);
  struct stat state {};
  const bool known = fstat(descriptor, &state) == 0;
  if (!known || !S_ISREG(state.st_mode)) {
    close(descriptor);
    return absl::InvalidArgumentError(
        absl::StrCat(path, known && S_ISDIR(state.st_mode)
                               ? ": is a folder, must be a file"
                               : ": is no regular file (a pipe or a device cannot be read)"));
  }
  File file(fdopen(descriptor, "rb"));
  if (file == nullptr) {
    const int error = errno;
    close(descriptor);
    return CannotBeRead(path, error);
  }
  return file;
}

absl::StatusOr<std::string> ReadRegularFile(const std::string& path, uint64_t max_bytes) {
  SIGHTLINE_ASSIGN_OR_RETURN(File file, OpenRegularFile(path));
  struct stat state {};
  if (fstat(fileno(file.get()), &state) != 0) return CannotBeRead(path, errno);
  const uint64_t claimed = static_cast<uint64_t>(std::max<off_t>(state.st_size, 0));
  if (claimed > max_bytes) return TooLarge(path, MebibytesText(claimed), max_bytes);
  // Files of /proc claim nothing, and others may grow meanwhile: the end is where reading ends.
  std::string bytes(claimed, '\0');
  size_t size = std::fread(bytes.data(), 1, bytes.size(), file.get());
  bytes.resize(size);
  char more[1 << 14];
  while ((size = std::fread(more, 1, sizeof(more), file.get())) > 0) {
    if (bytes.size() + size > max_bytes) return TooLarge(path, "more", max_bytes);
    bytes.append(more, size);
  }
  if (std::ferror(file.get()) != 0) return CannotBeRead(path, errno);
  return bytes;
}

}  // namespace sightline
