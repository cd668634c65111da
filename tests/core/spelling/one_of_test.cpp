// SPDX-License-Identifier: Apache-2.0
#include "core/spelling/one_of.h"

#include <gtest/gtest.h>

namespace sightline {
namespace {

TEST(OneOf, ReadsAsASentence) {
  EXPECT_EQ(OneOf({}), "");
  EXPECT_EQ(OneOf({"m"}), "m");
  EXPECT_EQ(OneOf({"m", "mm"}), "m or mm");
  EXPECT_EQ(OneOf({"m", "cm", "mm"}), "m, cm or mm");
}

}  // namespace
}  // namespace sightline
