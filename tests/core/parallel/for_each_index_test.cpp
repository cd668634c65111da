// SPDX-License-Identifier: Apache-2.0
#include "core/parallel/for_each_index.h"

#include <gtest/gtest.h>

#include <atomic>
#include <new>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

TEST(ForEachIndexTest, EveryIndexOnce) {
  std::vector<int> calls(1000, 0);
  ASSERT_TRUE(ForEachIndex(calls.size(), [&](size_t i) {
                ++calls[i];
                return absl::OkStatus();
              }).ok());
  EXPECT_EQ(calls, std::vector<int>(1000, 1));
  EXPECT_TRUE(ForEachIndex(0, [](size_t) { return absl::InternalError("called"); }).ok());
}

TEST(ForEachIndexTest, AnErrorEndsIt) {
  std::atomic<size_t> calls = 0;
  const absl::Status status = ForEachIndex(100000, [&](size_t i) -> absl::Status {
    ++calls;
    return i >= 10 ? absl::InternalError(absl::StrCat("index ", i)) : absl::OkStatus();
  });
  EXPECT_EQ(status.code(), absl::StatusCode::kInternal);
  EXPECT_LT(calls, 1000u);
}

TEST(ForEachIndexTest, AnExceptionReachesTheCaller) {
  EXPECT_THROW((void)ForEachIndex(8,
                                  [](size_t i) -> absl::Status {
                                    if (i == 3) throw std::bad_alloc();
                                    return absl::OkStatus();
                                  }),
               std::bad_alloc);
}

}  // namespace
}  // namespace sightline
