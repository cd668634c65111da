// SPDX-License-Identifier: Apache-2.0
#include "planning_service/web/web_page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <regex>
#include <string>

namespace sightline {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

std::map<std::string, WebPageFile> FilesByPath() {
  std::map<std::string, WebPageFile> files;
  for (const WebPageFile& file : WebPage()) {
    EXPECT_TRUE(files.emplace(file.path, file).second) << file.path;
  }
  return files;
}

TEST(WebPageTest, EveryFileHasTypeAndBytes) {
  const std::map<std::string, WebPageFile> files = FilesByPath();
  ASSERT_TRUE(files.count("/"));
  for (const auto& [path, file] : files) {
    EXPECT_THAT(path, StartsWith("/"));
    EXPECT_FALSE(file.content_type.empty()) << path;
    EXPECT_GT(file.bytes.size(), 100u) << path;
  }
}

TEST(WebPageTest, WhatThePageNamesIsThere) {
  const std::map<std::string, WebPageFile> files = FilesByPath();
  const std::string& index = files.at("/").bytes;
  const std::regex address("(?:src|href)=\"([^\"#]+)\"");
  int found = 0;
  for (auto it = std::sregex_iterator(index.begin(), index.end(), address);
       it != std::sregex_iterator(); ++it, ++found) {
    const std::string path = (*it)[1];
    // Relative, so that the page works behind a proxy's folder too.
    EXPECT_THAT(path, Not(StartsWith("/")));
    EXPECT_THAT(path, Not(HasSubstr(":")));
    EXPECT_TRUE(files.count("/" + path) || path == "v1/openapi.json") << path;
  }
  EXPECT_GE(found, 4);
  EXPECT_THAT(files.at("/assets/page.js").bytes, HasSubstr("assets/part_reader.js"));
  EXPECT_THAT(files.at("/assets/page.js").bytes, HasSubstr("results_worker.js"));
}

TEST(WebPageTest, NothingNeedsAnInlineScriptOrStyle) {
  const std::string index = FilesByPath().at("/").bytes;
  EXPECT_THAT(index, Not(HasSubstr("<style")));
  EXPECT_THAT(index, Not(HasSubstr("style=\"")));
  EXPECT_FALSE(std::regex_search(index, std::regex("<script(?![^>]*src=)")));
  EXPECT_FALSE(std::regex_search(index, std::regex("\\son[a-z]+=\"")));
}

}  // namespace
}  // namespace sightline
