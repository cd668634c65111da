// SPDX-License-Identifier: Apache-2.0
#include "core/process/program_path.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

namespace sightline {
namespace {

using testing::ElementsAre;
namespace fs = std::filesystem;

TEST(ProgramFolders, BuildFolderHasItsOwnFirst) {
  EXPECT_THAT(ProgramFolders("/tree/build/release/bin/sightline"),
              ElementsAre("/tree/build/release/bin", "/tree/build/release/libexec/sightline"));
}

TEST(ProgramFolders, InstalledProgramsFindEachOtherFromBothFolders) {
  EXPECT_THAT(ProgramFolders("/usr/bin/sightline"),
              ElementsAre("/usr/bin", "/usr/libexec/sightline"));
  EXPECT_THAT(ProgramFolders("/usr/libexec/sightline/sightline-plan"),
              ElementsAre("/usr/libexec/sightline", "/usr/bin"));
}

// A program that was copied somewhere, as into /tmp, trusts that folder alone.
TEST(ProgramFolders, OtherFoldersStandAlone) {
  EXPECT_THAT(ProgramFolders("/tmp/x/sightline"), ElementsAre("/tmp/x"));
  EXPECT_THAT(ProgramFolders("/tmp/sightline/sightline-plan"), ElementsAre("/tmp/sightline"));
}

TEST(FindProgram, FindsTheRunningProgramAndNamesWhatIsMissing) {
  const fs::path own = OwnProgram();
  EXPECT_EQ(FindProgram(own.filename().string()), own);
  EXPECT_EQ(FindProgram("no_such_program"), own.parent_path() / "no_such_program");
}

}  // namespace
}  // namespace sightline
