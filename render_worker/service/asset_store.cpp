// SPDX-License-Identifier: Apache-2.0
#include "render_worker/service/asset_store.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>
#include <openssl/evp.h>

#include <array>
#include <cstdio>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "core/json/strict_json.h"
#include "render_worker/service/without_folders.h"

namespace sightline {

std::string Sha256Hex(const std::string& bytes) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest;
  unsigned int size = 0;
  EVP_Digest(bytes.data(), bytes.size(), digest.data(), &size, EVP_sha256(), nullptr);
  return absl::BytesToHexString(
      absl::string_view(reinterpret_cast<const char*>(digest.data()), size));
}

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
  if (absl::Status status = WriteFileAtomically(path, bytes); !status.ok()) {
    return WithoutFolders(
        absl::ResourceExhaustedError(absl::StrCat("the asset cannot be kept: ", status.message())),
        {folder_});
  }
  absl::Status status =
      assets_.Put(digest, std::make_shared<const Asset>(path), static_cast<int64_t>(bytes.size()));
  if (!status.ok()) return status;
  return digest;
}

}  // namespace sightline
