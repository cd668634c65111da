// SPDX-License-Identifier: Apache-2.0
#include "render_worker/service/asset_store.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <chrono>
#include <cstdio>

#include "absl/strings/str_cat.h"
#include "core/digest/sha256.h"
#include "core/file/atomic_write.h"
#include "core/status/status_macros.h"
#include "render_worker/service/without_folders.h"

namespace sightline {

std::string MessageDigest(const google::protobuf::Message& message) {
  std::string bytes;
  {
    google::protobuf::io::StringOutputStream stream(&bytes);
    google::protobuf::io::CodedOutputStream coded(&stream);
    coded.SetSerializationDeterministic(true);
    message.SerializeToCodedStream(&coded);
  }
  return Sha256Hex(bytes);
}

int64_t MemoryOf(const google::protobuf::Message& request) {
  return 2 * static_cast<int64_t>(request.SpaceUsedLong());
}

Asset::~Asset() { std::remove(path_.c_str()); }

AssetStore::AssetStore(std::string folder, int64_t max_bytes)
    : folder_(std::move(folder)), assets_(max_bytes) {}

absl::StatusOr<std::string> AssetStore::Put(const std::string& bytes) {
  const std::string digest = Sha256Hex(bytes);
  if (assets_.Get(digest) != nullptr) return digest;
  // A name of its own: an asset that is on its way out may have the same digest.
  const std::string path = absl::StrCat(folder_, "/asset-", next_file_++);
  if (absl::Status status = WriteFileAtomically(path, bytes, 0600); !status.ok()) {
    return WithoutFolders(
        absl::ResourceExhaustedError(absl::StrCat("the asset cannot be kept: ", status.message())),
        {folder_});
  }
  SIGHTLINE_RETURN_IF_ERROR(
      assets_.Put(digest, std::make_shared<const Asset>(path), static_cast<int64_t>(bytes.size())));
  return digest;
}

void AssetStore::DropUnused(absl::Duration age) {
  assets_.DropUnusedSince(std::chrono::steady_clock::now() - absl::ToChronoNanoseconds(age));
}

}  // namespace sightline
