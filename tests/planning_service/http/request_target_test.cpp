// SPDX-License-Identifier: Apache-2.0
#include "planning_service/http/request_target.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sightline {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;

TEST(RequestTarget, SplitsAndDecodes) {
  const auto target = ParseRequestTarget("/v1/jobs/a%2Fb/x%20y?state=QUEUED&kind=a+b%26&flag#end");
  ASSERT_TRUE(target.ok()) << target.status();
  EXPECT_THAT(target->path, ElementsAre("v1", "jobs", "a/b", "x y"));
  EXPECT_THAT(target->query,
              ElementsAre(Pair("flag", ""), Pair("kind", "a b&"), Pair("state", "QUEUED")));
  EXPECT_THAT(target->authority, IsEmpty());
}

TEST(RequestTarget, KeepsEmptySegments) {
  const auto target = ParseRequestTarget("/v1//jobs/");
  ASSERT_TRUE(target.ok());
  EXPECT_THAT(target->path, ElementsAre("v1", "", "jobs", ""));
}

TEST(RequestTarget, TakesAbsoluteForm) {
  const auto target = ParseRequestTarget("HTTP://other.example:80/v1?a=b");
  ASSERT_TRUE(target.ok());
  EXPECT_EQ(target->authority, "other.example:80");
  EXPECT_THAT(target->path, ElementsAre("v1"));
}

TEST(RequestTarget, RefusesWhatIsNoPath) {
  for (const char* wrong : {"", "*", "v1/jobs", "http://host", "?a=b"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(ParseRequestTarget(wrong).status())) << wrong;
  }
}

TEST(RequestTarget, RefusesBrokenEncoding) {
  for (const char* wrong : {"/%", "/%4", "/%zz", "/a?b=%1", "/%00", "/a%0d%0ab", "/%7f", "/%ff",
                            "/%c0%af", "/%ed%a0%80", "/a?b=%80", "/a?b=%0a"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(ParseRequestTarget(wrong).status())) << wrong;
  }
}

TEST(PercentEncode, IsUndoneByDecoding) {
  const std::string text = "points/scan 1_\xc3\xa4%.ply";
  EXPECT_EQ(PercentEncode(text, true), "points/scan%201_%c3%a4%25.ply");
  EXPECT_EQ(PercentEncode("a/b", false), "a%2fb");
  EXPECT_EQ(PercentDecode(PercentEncode(text, false)).value(), text);
}

}  // namespace
}  // namespace sightline
