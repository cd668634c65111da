// SPDX-License-Identifier: Apache-2.0
#include "planning_service/execution/server_paths.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

constexpr char kJob[] = "/srv/planning/data/work/job-1";

ServerPaths Paths() {
  return ServerPaths(kJob, {"/srv/planning/data", "/opt/sightline/bin", "/opt/sightline/libexec/",
                            "/tmp", "/var/cache//step_cache", ""});
}

// A path as it may stand in a message, and what is left of it.
struct PathInMessage {
  std::string path;
  std::string shown;
};

const std::vector<PathInMessage> kCases = {
    {"/srv/planning/data/work/job-1/in/part.glb", "part.glb"},
    {"/srv/planning/data/work/job-1/in/sub/part.glb", "sub/part.glb"},
    {"/srv/planning/data/work/job-1/in/teil größe 3.glb", "teil größe 3.glb"},
    {"/srv/planning/data/work/job-1/in/in/part.glb", "in/part.glb"},
    {"/srv/planning/data/work/job-1//in///part.glb", "part.glb"},
    {"/srv/planning/data/work/job-1/out/points/scan_01.ply", "points/scan_01.ply"},
    {"../out/plan.json", "plan.json"},
    {"../in/out/plan.json", "out/plan.json"},
    {"../out", "(the folder of the job)"},
    {"/srv/planning/data/work/job-1", "(the folder of the job)"},
    {"/srv/planning/data/work/job-1/in/", "(the folder of the job)"},
    {"/srv/planning/data/work/job-12/in/other.glb", "other.glb"},
    {"/srv/planning/data/artefacts/ab/abcd", "abcd"},
    {"/srv/planning/data/jobs.sqlite", "jobs.sqlite"},
    {"/srv/planning/data/", "(a folder of the service)"},
    {"/opt/sightline/bin/coverage_server", "coverage_server"},
    {"/opt/sightline/libexec/sightline-plan", "sightline-plan"},
    {"/tmp/sightline-Xy12ab/coverage.sock", "coverage.sock"},
    {"/var/cache/step_cache/0a1b.mesh", "0a1b.mesh"},
};

// Around the path in a message: it stays whole, whatever the path is.
const std::vector<std::pair<std::string, std::string>> kSurroundings = {
    {"", ""},
    {"", ": No such file or directory"},
    {"cannot open ", ""},
    {"cannot open ", " for reading"},
    {"cannot open \"", "\": denied"},
    {"cannot open '", "'"},
    {"field part.file (", "), line 3"},
    {"--out=", " is not empty"},
    {"unix:", ", after 5 s"},
    {"first line\n", "\nand a third line"},
    {"[", "]"},
    {"{\"error\":\"", "\"}"},
};

TEST(ServerPaths, ClientsReadTheirOwnNamesAlone) {
  const ServerPaths paths = Paths();
  for (const PathInMessage& c : kCases) {
    for (const auto& [before, after] : kSurroundings) {
      const std::string message = absl::StrCat(before, c.path, after);
      EXPECT_EQ(paths.WithoutPaths(message), absl::StrCat(before, c.shown, after)) << message;
    }
  }
}

TEST(ServerPaths, EveryPathOfAMessageIsShown) {
  const ServerPaths paths = Paths();
  for (const PathInMessage& first : kCases) {
    for (const PathInMessage& second : kCases) {
      const std::string shown =
          paths.WithoutPaths(absl::StrCat("'", first.path, "' -> '", second.path, "'"));
      EXPECT_EQ(shown, absl::StrCat("'", first.shown, "' -> '", second.shown, "'"));
      for (const char* folder : {"/srv", "planning/data", "/opt", "/tmp", "/var", "../out"}) {
        EXPECT_THAT(shown, Not(HasSubstr(folder)));
      }
    }
  }
}

TEST(ServerPaths, OtherTextStays) {
  const ServerPaths paths = Paths();
  for (const std::string message :
       {"", "/", "part.glb: is no mesh", "assets/tmp/part.glb: is no mesh", "a/b",
        "1/2 of 3/4 done", "mine/srv/planning/data/x.glb", "/srv/planning/database/x",
        "/home/anna/tmp/x.mtl", "is \"../part.glb\", must be a relative name without ..",
        "../output/x", "5 mm/s", "...", "http://example.org/tmp/x"}) {
    EXPECT_EQ(paths.WithoutPaths(message), message);
  }
}

// Replacing once is enough: what clients read is not replaced again.
TEST(ServerPaths, IsIdempotent) {
  const ServerPaths paths = Paths();
  for (const PathInMessage& c : kCases) {
    const std::string once = paths.WithoutPaths(absl::StrCat("cannot open ", c.path, ": denied"));
    EXPECT_EQ(paths.WithoutPaths(once), once);
  }
}

// Programs ask the system for their working folder, which gives the path without links.
TEST(ServerPaths, LinksAreFollowed) {
  std::string made = (fs::temp_directory_path() / "sightline-paths-XXXXXX").string();
  ASSERT_NE(mkdtemp(made.data()), nullptr);
  const fs::path folder = fs::canonical(made);
  fs::create_directories(folder / "real/job-1/in");
  fs::create_directory_symlink(folder / "real", folder / "link");
  const ServerPaths paths((folder / "link/job-1").string(), {(folder / "link").string()});
  for (const char* name : {"link", "real"}) {
    EXPECT_EQ(paths.WithoutPaths(absl::StrCat((folder / name / "job-1/in/a.glb").string(), ": x")),
              "a.glb: x");
    EXPECT_EQ(paths.WithoutPaths(absl::StrCat((folder / name / "other").string(), ": x")),
              "other: x");
  }
  fs::remove_all(folder);
}

TEST(ServerPaths, AddressesOfFilesAreShortenedToo) {
  EXPECT_EQ(Paths().WithoutPaths("file:///tmp/a/b.sock: x"), "file:b.sock: x");
}

TEST(ServerPaths, TheRootHidesNothing) {
  EXPECT_EQ(ServerPaths(kJob, {"/"}).WithoutPaths("/home/x and /"), "/home/x and /");
}

TEST(ServerPaths, FoldersOfAnInstalledProgram) {
  const ServerPaths paths(kJob, FoldersOfProgram("/usr/local/bin/sightline"));
  EXPECT_EQ(paths.WithoutPaths("/usr/local/libexec/sightline/sightline-plan: not found"),
            "sightline-plan: not found");
  EXPECT_EQ(paths.WithoutPaths("/usr/local/bin/sightline: killed"), "sightline: killed");
}

}  // namespace
}  // namespace sightline
