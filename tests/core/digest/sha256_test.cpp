// SPDX-License-Identifier: Apache-2.0
#include "core/digest/sha256.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

// Examples of FIPS 180-4 (NIST, SHA256.pdf).
constexpr char kOfNothing[] = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";
constexpr char kOfAbc[] = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
constexpr char kOfMillionA[] = "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0";

TEST(Sha256, EqualsTheStandardsExamples) {
  EXPECT_EQ(Sha256Hex(""), kOfNothing);
  EXPECT_EQ(Sha256Hex("abc"), kOfAbc);
  Sha256 digest;
  const std::string block(999, 'a');
  for (int i = 0; i < 1001; ++i) digest.Update(block);
  digest.Update("a");
  EXPECT_EQ(digest.Hex(), kOfMillionA);
  Sha256 bytes;
  bytes.Update("a");
  bytes.Update("");
  bytes.Update("bc");
  EXPECT_EQ(bytes.Finish()[0], 0xba);
}

TEST(Sha256, ReadsFilesBlockByBlock) {
  const std::string path = absl::StrCat(testing::TempDir(), "/sha256_test_", getpid());
  std::ofstream(path) << std::string(1'000'000, 'a');
  const auto digest = DigestOfFile(path);
  ASSERT_TRUE(digest.ok()) << digest.status();
  EXPECT_EQ(digest->sha256, kOfMillionA);
  EXPECT_EQ(digest->size_bytes, 1'000'000);
  std::filesystem::remove(path);
  EXPECT_TRUE(absl::IsNotFound(DigestOfFile(path).status()));
  EXPECT_TRUE(absl::IsInvalidArgument(DigestOfFile(testing::TempDir()).status()));
}

}  // namespace
}  // namespace sightline
