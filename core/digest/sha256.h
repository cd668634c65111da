// SPDX-License-Identifier: Apache-2.0
// SHA-256 (FIPS 180-4) by OpenSSL: the digest of parts, uploads, requests and cache entries.
//
//   Sha256 digest;
//   digest.Update(header);
//   digest.Update(body);
//   return digest.Hex();
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"

struct evp_md_ctx_st;

namespace sightline {

// The digest of bytes that come piece by piece.
class Sha256 {
 public:
  using Bytes = std::array<unsigned char, 32>;

  Sha256();
  void Update(std::string_view bytes);
  // The digest as 64 lower-case hexadecimal digits. It is computed once, after the last Update.
  std::string Hex();
  // The digest as 32 bytes, otherwise as Hex.
  Bytes Finish();

 private:
  struct Free {
    void operator()(evp_md_ctx_st* context) const;
  };
  std::unique_ptr<evp_md_ctx_st, Free> context_;
};

// The digest of `bytes` as 64 lower-case hexadecimal digits.
std::string Sha256Hex(std::string_view bytes);

struct FileDigest {
  std::string sha256;  // 64 lower-case hexadecimal digits
  int64_t size_bytes = 0;
};

// The digest of a regular file, read block by block. NOT_FOUND: the file cannot be read.
// INVALID_ARGUMENT: a folder, a pipe or a device.
absl::StatusOr<FileDigest> DigestOfFile(const std::string& path);

}  // namespace sightline
