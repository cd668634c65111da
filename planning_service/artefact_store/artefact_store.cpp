// SPDX-License-Identifier: Apache-2.0
#include "planning_service/artefact_store/artefact_store.h"

#include <fcntl.h>
#include <linux/fs.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/digest/sha256.h"
#include "core/status/status_macros.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr size_t kBlockBytes = 1 << 20;
// Number of files that are remembered as checked; takes about 20 MB.
constexpr size_t kMostChecked = 100'000;
constexpr int64_t kMaxReadBytes = int64_t{64} << 20;
constexpr absl::Duration kMaxIncomingAge = absl::Hours(24);
constexpr size_t kDigestLength = 64;
constexpr char kIncoming[] = "incoming";
constexpr char kLockFile[] = "lock";
constexpr char kHoldFile[] = "hold";

absl::Status DiskFull(const std::string& message) {
  return WithErrorInfo(absl::ResourceExhaustedError(message), "DISK_FULL");
}

absl::Status FileError(int code, const std::string& path, const std::string& what) {
  absl::Status status = absl::ErrnoToStatus(code, absl::StrCat(path, ": ", what));
  if (code == ENOSPC || code == EDQUOT) return DiskFull(std::string(status.message()));
  return status;
}

class FileDescriptor {
 public:
  explicit FileDescriptor(int fd = -1) : fd_(fd) {}
  ~FileDescriptor() { Close(); }
  FileDescriptor(const FileDescriptor&) = delete;
  FileDescriptor& operator=(const FileDescriptor&) = delete;
  FileDescriptor(FileDescriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  FileDescriptor& operator=(FileDescriptor&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }

  int get() const { return fd_; }
  bool is_open() const { return fd_ >= 0; }
  // The caller closes it.
  int Release() { return std::exchange(fd_, -1); }
  // Returns 0 or errno.
  int Close() {
    if (fd_ < 0) return 0;
    return close(std::exchange(fd_, -1)) == 0 ? 0 : errno;
  }

 private:
  int fd_;
};

bool IsDigest(const std::string& text) {
  return text.size() == kDigestLength && std::all_of(text.begin(), text.end(), [](char c) {
           return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f');
         });
}

std::string PathOf(const std::string& folder, const std::string& digest) {
  return absl::StrCat(folder, "/", digest.substr(0, 2), "/", digest);
}

// Folder of the digests that begin with this byte.
std::string FolderOf(const std::string& folder, int first) {
  return absl::StrCat(folder, "/", absl::Hex(first, absl::kZeroPad2));
}

// 0 or errno.
int WriteAll(int fd, const char* bytes, size_t size) {
  while (size > 0) {
    const ssize_t written = write(fd, bytes, size);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return errno;
    if (written == 0) return ENOSPC;
    bytes += written;
    size -= written;
  }
  return 0;
}

// Flushes the names in the folder to disk; fsync of a file flushes only its bytes.
absl::Status FlushFolder(const std::string& folder) {
  const FileDescriptor fd(open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!fd.is_open()) return FileError(errno, folder, "cannot be opened");
  if (fsync(fd.get()) != 0) return FileError(errno, folder, "cannot be flushed to disk");
  return absl::OkStatus();
}

absl::Status MakeFolder(const std::string& folder) {
  if (mkdir(folder.c_str(), 0700) == 0) {
    const std::string parent = fs::path(folder).parent_path().string();
    return FlushFolder(parent.empty() ? "." : parent);
  }
  if (errno != EEXIST) return FileError(errno, folder, "cannot be made");
  return absl::OkStatus();
}

absl::StatusOr<FileDescriptor> OpenRegular(const std::string& path, struct stat* info) {
  // Without O_NONBLOCK a pipe would wait for its writer.
  FileDescriptor fd(open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK));
  if (!fd.is_open()) {
    if (errno == ELOOP) return absl::InvalidArgumentError(absl::StrCat(path, ": is a link"));
    return FileError(errno, path, "cannot be opened");
  }
  if (fstat(fd.get(), info) != 0) return FileError(errno, path, "cannot be read");
  if (!S_ISREG(info->st_mode)) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": is not a regular file"));
  }
  return fd;
}

bool HasMoreThan(const std::string& folder, int64_t reserve_bytes) {
  struct statvfs info {};
  if (statvfs(folder.c_str(), &info) != 0) return false;
  return static_cast<double>(info.f_bavail) * static_cast<double>(info.f_frsize) >
         static_cast<double>(reserve_bytes);
}

struct Copied {
  std::string digest;
  int64_t size_bytes = 0;
};

// Copies the file, sharing blocks where the file system can. The digest is that of the copy: the
// original may still be written to.
absl::StatusOr<Copied> Copy(int from, const std::string& from_path, int to,
                            const std::string& to_path) {
  const bool cloned = ioctl(to, FICLONE, from) == 0;
  const int source = cloned ? to : from;
  Sha256 digest;
  Copied copied;
  std::string block(kBlockBytes, '\0');
  while (true) {
    const ssize_t size = pread(source, block.data(), block.size(), copied.size_bytes);
    if (size < 0 && errno == EINTR) continue;
    if (size < 0) return FileError(errno, from_path, "cannot be read");
    if (size == 0) break;
    digest.Update({block.data(), static_cast<size_t>(size)});
    copied.size_bytes += size;
    if (cloned) continue;
    if (const int error = WriteAll(to, block.data(), size); error != 0) {
      return FileError(error, to_path, "cannot be written");
    }
  }
  copied.digest = digest.Hex();
  return copied;
}

// A new file for reading and writing. `path` ends with XXXXXX and gets the file's name.
absl::StatusOr<FileDescriptor> NewTemporary(std::string* path) {
  FileDescriptor fd(mkostemp(path->data(), O_CLOEXEC));
  if (!fd.is_open()) return FileError(errno, *path, "cannot be made");
  return fd;
}

// A lock of the folder; the kernel frees it however a process ends.
absl::StatusOr<FileDescriptor> Lock(const std::string& folder, const char* name, int operation) {
  const std::string path = absl::StrCat(folder, "/", name);
  FileDescriptor fd(open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600));
  if (!fd.is_open()) return FileError(errno, path, "cannot be opened");
  while (flock(fd.get(), operation) != 0) {
    if (errno == EINTR) continue;
    if (errno == EWOULDBLOCK) return absl::AbortedError(absl::StrCat(path, ": is locked"));
    return FileError(errno, path, "cannot be locked");
  }
  return fd;
}

// Held while a file gets its name (shared) or is removed (exclusive). Without it a new file could
// be removed because of the age of the file that it replaces.
absl::StatusOr<FileDescriptor> LockNames(const std::string& folder, int operation) {
  return Lock(folder, kLockFile, operation);
}

// The time by the file system's clock, which on a file server may differ from ours. Needs no disk
// space, so that old files can be removed from a full disk.
absl::StatusOr<absl::Time> FileTimeNow(const std::string& folder) {
  const std::string path = absl::StrCat(folder, "/", kLockFile);
  const FileDescriptor fd(open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600));
  if (!fd.is_open()) return FileError(errno, path, "cannot be opened");
  struct stat info {};
  if (futimens(fd.get(), nullptr) != 0 || fstat(fd.get(), &info) != 0) {
    return FileError(errno, path, "cannot be touched");
  }
  return absl::TimeFromTimespec(info.st_mtim);
}

// Names in a folder, in no order; none if it cannot be read.
std::vector<std::string> NamesIn(const std::string& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error); !error && entry != fs::directory_iterator();
       entry.increment(error)) {
    names.push_back(entry->path().filename().string());
  }
  return names;
}

}  // namespace

struct ArtefactWriter::Impl {
  std::string folder;
  int64_t reserve_bytes = 0;
  std::string path;  // below incoming; empty: it has got its name
  FileDescriptor fd;
  Sha256 digest;
  absl::Status status;  // first error
  bool discarded = false;

  ~Impl() {
    if (!path.empty()) unlink(path.c_str());
  }

  // Flushes the file and gives it its name.
  absl::Status Keep(const std::string& name) {
    // The file is read-only from now on. Its age counts from the moment at which it gets its name.
    if (fchmod(fd.get(), 0400) != 0 || futimens(fd.get(), nullptr) != 0) {
      return FileError(errno, path, "cannot be changed");
    }
    if (fsync(fd.get()) != 0) return FileError(errno, path, "cannot be flushed to disk");
    if (const int error = fd.Close(); error != 0) {
      return FileError(error, path, "cannot be written");
    }
    const std::string target = PathOf(folder, name);
    const std::string target_folder = fs::path(target).parent_path().string();
    SIGHTLINE_RETURN_IF_ERROR(MakeFolder(target_folder));
    SIGHTLINE_ASSIGN_OR_RETURN(const auto lock, LockNames(folder, LOCK_SH));
    // A file that exists already is replaced, which renews its age and repairs possible damage of
    // its bytes.
    if (rename(path.c_str(), target.c_str()) != 0) {
      return FileError(errno, target, "cannot be made");
    }
    path.clear();
    return FlushFolder(target_folder);
  }
};

ArtefactWriter::ArtefactWriter(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
ArtefactWriter::~ArtefactWriter() = default;

absl::Status ArtefactWriter::Write(const std::string& bytes) {
  if (!impl_->status.ok()) return impl_->status;
  if (!impl_->fd.is_open()) return absl::FailedPreconditionError("the file is complete");
  if (impl_->discarded) {
    impl_->digest.Update(bytes);
    size_bytes_ += static_cast<int64_t>(bytes.size());
    return absl::OkStatus();
  }
  if (!HasMoreThan(impl_->folder, impl_->reserve_bytes)) {
    return impl_->status = DiskFull(absl::StrCat(impl_->folder, ": the disk is full"));
  }
  if (const int error = WriteAll(impl_->fd.get(), bytes.data(), bytes.size()); error != 0) {
    return impl_->status = FileError(error, impl_->path, "cannot be written");
  }
  impl_->digest.Update(bytes);
  size_bytes_ += static_cast<int64_t>(bytes.size());
  return absl::OkStatus();
}

void ArtefactWriter::DiscardBytes() {
  impl_->discarded = true;
  // If its blocks cannot be freed now, the destructor removes the file.
  if (impl_->fd.is_open() && ftruncate(impl_->fd.get(), 0) != 0) return;
}

absl::StatusOr<std::string> ArtefactWriter::Digest(const std::string& expected_digest) {
  if (!impl_->status.ok()) return impl_->status;
  if (!impl_->fd.is_open()) return absl::FailedPreconditionError("the file is complete");
  const std::string digest = impl_->digest.Hex();
  if (expected_digest.empty() || digest == expected_digest) return digest;
  return impl_->status = WithErrorInfo(
             absl::InvalidArgumentError(absl::StrCat("the file's digest is ", digest, ", not \"",
                                                     absl::CHexEscape(expected_digest), "\"")),
             "DIGEST_MISMATCH", {{"digest", digest}});
}

absl::StatusOr<std::string> ArtefactWriter::Commit(const std::string& expected_digest) {
  if (impl_->discarded) return absl::FailedPreconditionError("the bytes were discarded");
  SIGHTLINE_ASSIGN_OR_RETURN(std::string digest, Digest(expected_digest));
  if (absl::Status kept = impl_->Keep(digest); !kept.ok()) return impl_->status = kept;
  return digest;
}

ArtefactStore::ArtefactStore(std::string folder, int64_t reserve_bytes)
    : folder_(std::move(folder)), reserve_bytes_(reserve_bytes) {}

absl::StatusOr<std::unique_ptr<ArtefactStore>> ArtefactStore::Open(const std::string& folder,
                                                                   int64_t reserve_bytes) {
  std::error_code error;
  fs::create_directories(fs::path(folder).parent_path(), error);  // MakeFolder reports it
  for (const std::string& made : {folder, absl::StrCat(folder, "/", kIncoming)}) {
    SIGHTLINE_RETURN_IF_ERROR(MakeFolder(made));
  }
  // A full disk must not keep the service from starting: results can still be read.
  const auto now = FileTimeNow(folder);
  if (!now.ok() && !absl::IsResourceExhausted(now.status())) return now.status();
  for (const std::string& name : NamesIn(absl::StrCat(folder, "/", kIncoming))) {
    const std::string path = absl::StrCat(folder, "/", kIncoming, "/", name);
    struct stat info {};
    if (!now.ok() || lstat(path.c_str(), &info) != 0 || !S_ISREG(info.st_mode)) continue;
    if (*now - absl::TimeFromTimespec(info.st_mtim) > kMaxIncomingAge) unlink(path.c_str());
  }
  return std::unique_ptr<ArtefactStore>(new ArtefactStore(folder, reserve_bytes));
}

absl::StatusOr<std::unique_ptr<ArtefactWriter>> ArtefactStore::NewFile() {
  if (!HasRoom()) return DiskFull(absl::StrCat(folder_, ": the disk is full"));
  auto impl = std::make_unique<ArtefactWriter::Impl>();
  impl->folder = folder_;
  impl->reserve_bytes = reserve_bytes_;
  std::string path = absl::StrCat(folder_, "/", kIncoming, "/file.XXXXXX");
  SIGHTLINE_ASSIGN_OR_RETURN(auto fd, NewTemporary(&path));
  impl->path = path;
  impl->fd = std::move(fd);
  return std::unique_ptr<ArtefactWriter>(new ArtefactWriter(std::move(impl)));
}

absl::StatusOr<ArtefactStore::Added> ArtefactStore::AddFile(const std::string& path) {
  struct stat info {};
  SIGHTLINE_ASSIGN_OR_RETURN(const auto source, OpenRegular(path, &info));
  if (!HasMoreThan(folder_, reserve_bytes_ + info.st_size)) {
    return DiskFull(absl::StrCat(folder_, ": no room for ", info.st_size, " bytes"));
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto writer, NewFile());
  ArtefactWriter::Impl& impl = *writer->impl_;
  SIGHTLINE_ASSIGN_OR_RETURN(const auto copied, Copy(source.get(), path, impl.fd.get(), impl.path));
  SIGHTLINE_RETURN_IF_ERROR(impl.Keep(copied.digest));
  return Added{copied.digest, copied.size_bytes};
}

std::set<std::string> ArtefactStore::Digests() const {
  std::set<std::string> digests;
  for (int first = 0; first < 256; ++first) {
    for (std::string& name : NamesIn(FolderOf(folder_, first))) {
      if (IsDigest(name)) digests.insert(std::move(name));
    }
  }
  return digests;
}

bool ArtefactStore::Has(const std::string& digest) const { return Path(digest).ok(); }

absl::StatusOr<std::string> ArtefactStore::Path(const std::string& digest) const {
  if (IsDigest(digest)) {
    std::string path = PathOf(folder_, digest);
    struct stat info {};
    if (lstat(path.c_str(), &info) == 0 && S_ISREG(info.st_mode)) return path;
  }
  return absl::NotFoundError(absl::StrCat("no file of digest \"", absl::CHexEscape(digest), "\""));
}

absl::StatusOr<std::string> ArtefactStore::Read(const std::string& digest, int64_t offset,
                                                int64_t limit) const {
  if (offset < 0 || limit < 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("offset ", offset, " and limit ", limit, " must not be negative"));
  }
  SIGHTLINE_ASSIGN_OR_RETURN(const auto path, Path(digest));
  struct stat info {};
  SIGHTLINE_ASSIGN_OR_RETURN(const auto fd, OpenRegular(path, &info));
  const int64_t left = std::max<int64_t>(info.st_size - offset, 0);
  std::string bytes(std::min({limit, left, kMaxReadBytes}), '\0');
  size_t filled = 0;
  while (filled < bytes.size()) {
    const ssize_t size = pread(fd.get(), bytes.data() + filled, bytes.size() - filled,
                               offset + static_cast<int64_t>(filled));
    if (size < 0 && errno == EINTR) continue;
    if (size < 0) return FileError(errno, path, "cannot be read");
    if (size == 0) break;
    filled += size;
  }
  bytes.resize(filled);
  return bytes;
}

absl::StatusOr<std::string> ArtefactStore::CheckedPath(const std::string& digest) const {
  SIGHTLINE_ASSIGN_OR_RETURN(std::string path, Path(digest));
  struct stat info {};
  if (stat(path.c_str(), &info) != 0) return FileError(errno, path, "cannot be read");
  const Checked now = {info.st_ino,
                       int64_t{info.st_mtim.tv_sec} * 1'000'000'000 + info.st_mtim.tv_nsec,
                       info.st_size};
  {
    std::lock_guard lock(checked_mutex_);
    const auto known = checked_.find(digest);
    if (known != checked_.end() && known->second == now) return path;
  }
  SIGHTLINE_ASSIGN_OR_RETURN(const FileDigest actual, DigestOfFile(path));
  if (actual.sha256 != digest) {
    return absl::DataLossError(absl::StrCat(path, ": is damaged: its digest is ", actual.sha256));
  }
  // Two changes within one tick of the file system's clock have the same time of change.
  if (absl::Now() - absl::TimeFromTimespec(info.st_mtim) < absl::Seconds(1)) return path;
  std::lock_guard lock(checked_mutex_);
  if (checked_.size() >= kMostChecked) checked_.clear();
  checked_[digest] = now;
  return path;
}

absl::Status ArtefactStore::Materialise(const std::string& digest, const std::string& path) const {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto stored, Path(digest));
  struct stat info {};
  SIGHTLINE_ASSIGN_OR_RETURN(const auto source, OpenRegular(stored, &info));
  const fs::path parent = fs::path(path).parent_path();
  std::error_code error;
  if (!parent.empty()) fs::create_directories(parent, error);
  if (error) return FileError(error.value(), parent.string(), "cannot be made");
  // Written under a temporary name first, so that a file under its name is complete.
  std::string part = absl::StrCat(path, ".XXXXXX");
  SIGHTLINE_ASSIGN_OR_RETURN(auto target, NewTemporary(&part));
  const auto copied = Copy(source.get(), stored, target.get(), part);
  absl::Status status = copied.status();
  if (status.ok() && copied->digest != digest) {
    status =
        absl::DataLossError(absl::StrCat(stored, ": is damaged: its digest is ", copied->digest));
  }
  if (status.ok() && fchmod(target.get(), 0400) != 0) {
    status = FileError(errno, part, "cannot be changed");
  }
  if (status.ok() && rename(part.c_str(), path.c_str()) != 0) {
    status = FileError(errno, path, "cannot be made");
  }
  if (!status.ok()) unlink(part.c_str());
  return status;
}

ArtefactHold::~ArtefactHold() { close(fd_); }

absl::StatusOr<std::unique_ptr<ArtefactHold>> ArtefactStore::Hold() {
  SIGHTLINE_ASSIGN_OR_RETURN(auto lock, Lock(folder_, kHoldFile, LOCK_SH));
  return std::unique_ptr<ArtefactHold>(new ArtefactHold(lock.Release()));
}

absl::StatusOr<int64_t> ArtefactStore::RemoveAllBut(const std::set<std::string>& keep,
                                                    absl::Duration min_age) {
  const auto alone = Lock(folder_, kHoldFile, LOCK_EX | LOCK_NB);
  if (absl::IsAborted(alone.status())) return 0;
  // Removal is allowed even if the disk is too full for the lock file.
  if (!alone.ok() && !absl::IsResourceExhausted(alone.status())) return alone.status();
  SIGHTLINE_ASSIGN_OR_RETURN(const auto now, FileTimeNow(folder_));
  int64_t freed_bytes = 0;
  for (int first = 0; first < 256; ++first) {
    const std::string folder = FolderOf(folder_, first);
    for (const std::string& name : NamesIn(folder)) {
      if (!IsDigest(name) || keep.count(name) > 0) continue;
      const std::string path = absl::StrCat(folder, "/", name);
      SIGHTLINE_ASSIGN_OR_RETURN(const auto lock, LockNames(folder_, LOCK_EX));
      struct stat info {};
      if (lstat(path.c_str(), &info) != 0 || !S_ISREG(info.st_mode)) continue;
      if (now - absl::TimeFromTimespec(info.st_mtim) < min_age) continue;
      if (unlink(path.c_str()) != 0) return FileError(errno, path, "cannot be removed");
      freed_bytes += info.st_size;
    }
  }
  return freed_bytes;
}

bool ArtefactStore::HasRoom() const { return HasMoreThan(folder_, reserve_bytes_); }

}  // namespace sightline
