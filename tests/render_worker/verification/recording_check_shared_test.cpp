// SPDX-License-Identifier: Apache-2.0
// Recordings of others where they lie beside the tree: they are as they are said to be, most of
// them with physics that the description leaves out, and are not accused.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "core/recordings/check/check_recordings.h"
#include "core/recordings/load_images.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> SharedSets() {
  std::vector<fs::path> sets;
  const char* source = std::getenv("SIGHTLINE_SOURCE_DIR");
  if (source == nullptr) return sets;
  for (const char* kind : {"open", "unlabelled"}) {
    const fs::path folder = fs::path(source) / ".." / "shared" / "recordings" / kind;
    if (!fs::exists(folder)) continue;
    for (const auto& entry : fs::directory_iterator(folder)) sets.push_back(entry.path());
  }
  std::sort(sets.begin(), sets.end());
  return sets;
}

class SharedSetTest : public ::testing::TestWithParam<fs::path> {};
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(SharedSetTest);

TEST_P(SharedSetTest, IsNotAccused) {
  const fs::path& folder = GetParam();
  const auto set = ReadRecordings((folder / "recordings.json").string());
  ASSERT_TRUE(set.ok()) << set.status();
  std::vector<std::string> paths;
  for (const RecordedImage& image : set->recordings) {
    paths.push_back((folder / image.file).string());
  }
  const LoadedImages loaded = *LoadRecordedImages(*set, paths);
  ASSERT_THAT(loaded.errors, testing::IsEmpty());
  const RecordingCheck check = CheckRecordings(*set, loaded.raw_dn);
  EXPECT_THAT(check.errors, testing::IsEmpty()) << folder;
  // Strong effects may look like mistakes, and are worth a word; a null set is as described.
  if (folder.filename().string().rfind("null_", 0) == 0) {
    EXPECT_THAT(check.warnings, testing::IsEmpty()) << folder;
  }
}

INSTANTIATE_TEST_SUITE_P(Shared, SharedSetTest, ::testing::ValuesIn(SharedSets()),
                         [](const auto& set) { return set.param.filename().string(); });

}  // namespace
}  // namespace sightline
