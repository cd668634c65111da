// SPDX-License-Identifier: Apache-2.0
// Uploaded files on disk, by digest, limited in bytes and age; the least recently used go first.
#pragma once

#include <google/protobuf/message.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/memo/lru_store.h"

namespace sightline {

// Digest of a message: the same for equal messages, for any order of their maps.
std::string MessageDigest(const google::protobuf::Message& message);

// Memory of a waiting request: the message, and about as much for its parsed form.
int64_t MemoryOf(const google::protobuf::Message& request);

// A file that is removed with its last reference.
class Asset {
 public:
  explicit Asset(std::string path) : path_(std::move(path)) {}
  ~Asset();
  Asset(const Asset&) = delete;
  Asset& operator=(const Asset&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

// Thread-safe.
class AssetStore {
 public:
  // `folder` must exist; the store owns it.
  AssetStore(std::string folder, int64_t max_bytes);

  // Stores the bytes in a file that only this user can read; returns their digest.
  // RESOURCE_EXHAUSTED: they alone exceed the limit, or the disk is full.
  absl::StatusOr<std::string> Put(const std::string& bytes);
  // Null if unknown. The file stays while the asset is held.
  std::shared_ptr<const Asset> Get(const std::string& digest) { return assets_.Get(digest); }
  // Drops assets that were neither put nor read for that long.
  void DropUnused(absl::Duration age);

  int64_t count() const { return assets_.count(); }
  int64_t bytes() const { return assets_.bytes(); }

 private:
  const std::string folder_;
  LruStore<Asset> assets_;
  std::atomic<int64_t> next_file_ = 0;
};

}  // namespace sightline
