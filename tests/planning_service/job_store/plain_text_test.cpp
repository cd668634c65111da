// SPDX-License-Identifier: Apache-2.0
#include "planning_service/job_store/plain_text.h"

#include <gtest/gtest.h>

namespace sightline {
namespace {

TEST(PlainText, TellsTextFromBytes) {
  EXPECT_TRUE(IsPlainText(""));
  EXPECT_TRUE(
      IsPlainText("Gr\xc3\xbc\xc3\x9f"
                  "e \xe2\x82\xac \xf0\x9f\x98\x80"));
  EXPECT_FALSE(IsPlainText(absl::string_view("a\0b", 3)));
  EXPECT_FALSE(IsPlainText("\xff"));
  EXPECT_FALSE(IsPlainText("\x80"));              // goes on without a beginning
  EXPECT_FALSE(IsPlainText("\xc3"));              // breaks off
  EXPECT_FALSE(IsPlainText("\xc0\x80"));          // NUL written longer
  EXPECT_FALSE(IsPlainText("\xe0\x80\xaf"));      // "/" written longer
  EXPECT_FALSE(IsPlainText("\xed\xa0\x80"));      // half a surrogate pair
  EXPECT_FALSE(IsPlainText("\xf4\x90\x80\x80"));  // beyond Unicode
}

TEST(PlainText, ReplacesWhatIsNoText) {
  EXPECT_EQ(ToPlainText("good", 100), "good");
  EXPECT_EQ(ToPlainText(absl::string_view("a\0\xff"
                                          "b",
                                          4),
                        100),
            "a\xef\xbf\xbd\xef\xbf\xbd"
            "b");
  EXPECT_TRUE(IsPlainText(ToPlainText("\xe2\x82", 100)));
}

TEST(PlainText, CutsBetweenCharacters) {
  EXPECT_EQ(ToPlainText("a\xe2\x82\xac", 3), "a");
  EXPECT_EQ(ToPlainText("a\xe2\x82\xac", 4), "a\xe2\x82\xac");
}

}  // namespace
}  // namespace sightline
