// SPDX-License-Identifier: Apache-2.0
#include "core/digest/sha256.h"

#include <openssl/evp.h>

#include <cassert>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "core/file/read_file.h"
#include "core/status/status_macros.h"

namespace sightline {

void Sha256::Free::operator()(evp_md_ctx_st* context) const { EVP_MD_CTX_free(context); }

Sha256::Sha256() : context_(EVP_MD_CTX_new()) {
  [[maybe_unused]] const int ok = EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr);
  assert(ok == 1);
}

void Sha256::Update(std::string_view bytes) {
  EVP_DigestUpdate(context_.get(), bytes.data(), bytes.size());
}

Sha256::Bytes Sha256::Finish() {
  Bytes digest{};
  EVP_DigestFinal_ex(context_.get(), digest.data(), nullptr);
  return digest;
}

std::string Sha256::Hex() {
  const Bytes digest = Finish();
  return absl::BytesToHexString(
      absl::string_view(reinterpret_cast<const char*>(digest.data()), digest.size()));
}

std::string Sha256Hex(std::string_view bytes) {
  Sha256 digest;
  digest.Update(bytes);
  return digest.Hex();
}

absl::StatusOr<FileDigest> DigestOfFile(const std::string& path) {
  SIGHTLINE_ASSIGN_OR_RETURN(const File file, OpenRegularFile(path));
  Sha256 digest;
  FileDigest result;
  std::string block(size_t{1} << 16, '\0');
  size_t size = 0;
  while ((size = std::fread(block.data(), 1, block.size(), file.get())) > 0) {
    digest.Update(std::string_view(block).substr(0, size));
    result.size_bytes += static_cast<int64_t>(size);
  }
  if (std::ferror(file.get()) != 0) {
    return absl::NotFoundError(absl::StrCat(path, ": cannot be read: ", std::strerror(errno)));
  }
  result.sha256 = digest.Hex();
  return result;
}

}  // namespace sightline
