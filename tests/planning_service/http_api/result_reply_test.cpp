// SPDX-License-Identifier: Apache-2.0
#include "planning_service/http_api/result_reply.h"

#include <gtest/gtest.h>

namespace sightline {
namespace {

std::string Range(const std::string& header) {
  const auto range = ParseByteRange(header, 100);
  return range ? std::to_string(range->offset) + "+" + std::to_string(range->length) : "whole";
}

TEST(ParseByteRange, ReadsOneRange) {
  EXPECT_EQ(Range("bytes=0-9"), "0+10");
  EXPECT_EQ(Range("bytes=90-"), "90+10");
  EXPECT_EQ(Range("bytes=90-1000"), "90+10");
  EXPECT_EQ(Range("bytes=-10"), "90+10");
  EXPECT_EQ(Range("bytes=-1000"), "0+100");
  EXPECT_EQ(Range(" bytes=5-5 "), "5+1");
  EXPECT_EQ(Range("bytes=99-99"), "99+1");
}

TEST(ParseByteRange, GivesNothingWhereTheFileHasNothing) {
  EXPECT_EQ(Range("bytes=100-"), "0+0");
  EXPECT_EQ(Range("bytes=100-200"), "0+0");
  EXPECT_EQ(ParseByteRange("bytes=-0", 100)->length, 0);
  EXPECT_EQ(ParseByteRange("bytes=0-", 0)->length, 0);
}

TEST(ParseByteRange, IgnoresTheRest) {
  for (const char* header : {"", "bytes", "bytes=", "bytes=-", "bytes=a-b", "bytes=9-0",
                             "bytes=0-1,3-4", "lines=0-1", "bytes=--1", "bytes=+1-2", "bytes=1-+2",
                             "bytes=0-99999999999999999999", "bytes=99999999999999999999-"}) {
    EXPECT_EQ(Range(header), "whole") << header;
  }
}

// As many as the head of a request has room for ask for no more than the file.
TEST(ParseByteRange, IgnoresManyRanges) {
  std::string header = "bytes=0-0";
  for (int i = 0; i < 5000; ++i) header += ",0-0";
  EXPECT_EQ(Range(header), "whole");
}

TEST(MatchesEntityTag, ReadsLists) {
  EXPECT_TRUE(MatchesEntityTag("\"a\"", "\"a\""));
  EXPECT_TRUE(MatchesEntityTag("\"b\", W/\"a\"", "\"a\""));
  EXPECT_TRUE(MatchesEntityTag("*", "\"a\""));
  EXPECT_FALSE(MatchesEntityTag("", "\"a\""));
  EXPECT_FALSE(MatchesEntityTag("a", "\"a\""));
  EXPECT_FALSE(MatchesEntityTag("\"ab\"", "\"a\""));
}

TEST(ContentTypeOf, GoesByTheExtension) {
  EXPECT_EQ(ContentTypeOf("plan.json"), "application/json");
  EXPECT_EQ(ContentTypeOf("images/001.PNG"), "image/png");
  EXPECT_EQ(ContentTypeOf("report.html"), "text/html; charset=utf-8");
  EXPECT_EQ(ContentTypeOf("points/scan_01.ply"), "application/octet-stream");
  EXPECT_EQ(ContentTypeOf("noextension"), "application/octet-stream");
}

}  // namespace
}  // namespace sightline
