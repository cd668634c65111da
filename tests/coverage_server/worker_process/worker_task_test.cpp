// SPDX-License-Identifier: Apache-2.0
// Work in other processes gives what it gives here, also after some were killed.
#include <gtest/gtest.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <numbers>
#include <optional>
#include <string>
#include <thread>

#include "core/resting/convex_hull.h"
#include "coverage_server/occlusion/occluder_mesh.h"
#include "coverage_server/scene/hull_corners.h"
#include "coverage_server/worker_process/worker_process.h"
#include "tests/core/part/test_meshes.h"
#include "tests/coverage_server/test_parts.h"
#include "tests/limits/wait_until.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

template <typename T>
bool SameBytes(std::span<const T> a, std::span<const T> b) {
  return a.size() == b.size() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.size_bytes()) == 0);
}

void ExpectSame(const OccluderMesh& a, const OccluderMesh& b) {
  EXPECT_TRUE(SameBytes(a.vertices, b.vertices));
  EXPECT_TRUE(SameBytes(a.triangles, b.triangles));
  EXPECT_TRUE(SameBytes(a.normals, b.normals));
  EXPECT_TRUE(SameBytes(a.clusters, b.clusters));
  EXPECT_TRUE(SameBytes(a.cluster_vertices, b.cluster_vertices));
  EXPECT_EQ(a.closed, b.closed);
}

OccluderOptions Options(size_t most_triangles_here) {
  return {.point_spacing_m = 1e-3f, .most_triangles_here = most_triangles_here};
}

// Processes that this one has started for a task.
std::vector<pid_t> TaskProcesses() {
  std::vector<pid_t> found;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator("/proc", error)) {
    const std::string name = entry.path().filename();
    if (!std::all_of(name.begin(), name.end(), [](char c) { return c >= '0' && c <= '9'; })) {
      continue;
    }
    std::ifstream words_file(entry.path() / "cmdline", std::ios::binary);
    const std::string words(std::istreambuf_iterator<char>(words_file), {});
    std::ifstream state_file(entry.path() / "stat");
    std::string state;
    std::getline(state_file, state);
    // pid (name) state parent
    const size_t end = state.rfind(')');
    if (end == std::string::npos || words.find("--worker-task") == std::string::npos) continue;
    if (std::atoi(state.c_str() + end + 4) == getpid()) found.push_back(std::atoi(name.c_str()));
  }
  return found;
}

TEST(WorkerTask, OccludersAreTheSameWhereverTheyAreMade) {
  ASSERT_NE(WorkerProgram(), "");
  const TriangleMesh part = BlindHolePart();
  TriangleMesh open = SteppedPart();
  open.triangles.pop_back();
  for (const TriangleMesh* obstacle : {&part, static_cast<const TriangleMesh*>(&open)}) {
    const auto here = MakeOccluderMesh(part, {&obstacle, 1}, Options(1 << 30), nullptr);
    const auto there = MakeOccluderMesh(part, {&obstacle, 1}, Options(0), nullptr);
    ASSERT_TRUE(here.ok() && there.ok()) << here.status() << there.status();
    EXPECT_GT(here->clusters.size(), 10u);
    EXPECT_EQ(here->closed, obstacle == &part);
    ExpectSame(*here, *there);
  }
}

TEST(WorkerTask, HullIsTheSameWhereverItIsMade) {
  const TriangleMesh part = SphereMesh(0.05, 7);
  ASSERT_GT(part.positions_m.size(), 10'000u);  // not made here
  const auto there = HullCorners(part.positions_m, nullptr);
  const auto here = MakeConvexHull(part.positions_m);
  ASSERT_TRUE(here.ok() && there.ok()) << here.status() << there.status();
  EXPECT_EQ(here->corners_m, *there);
}

TEST(WorkerTask, ErrorsComeBackAsTheyAre) {
  const std::vector<Eigen::Vector3f> flat(20'000, Eigen::Vector3f(0.01f, 0, 0));
  const auto there = HullCorners(flat, nullptr);
  const auto here = MakeConvexHull(flat);
  EXPECT_FALSE(there.ok());
  EXPECT_EQ(there.status(), here.status());
}

TEST(WorkerTask, IsDoneAgainIfItsProcessIsKilledButNotForEver) {
  const TriangleMesh part = Lathe({{0, 0}, {0.05, 0}, {0.05, 0.05}, {0, 0.05}}, 60'000);
  const auto want = MakeOccluderMesh(part, {}, Options(1 << 30), nullptr);
  ASSERT_TRUE(want.ok());
  for (const int most_kills : {1, 1000}) {
    std::atomic<bool> ended = false;
    std::atomic<int> kills = 0;
    std::thread killer([&] {
      std::vector<pid_t> killed;
      while (!ended && kills < most_kills) {
        for (const pid_t pid : TaskProcesses()) {
          if (kills == most_kills || std::count(killed.begin(), killed.end(), pid) > 0) continue;
          killed.push_back(pid);
          kills += kill(pid, SIGKILL) == 0 ? 1 : 0;
        }
      }
    });
    const auto made = MakeOccluderMesh(part, {}, Options(0), nullptr);
    ended = true;
    killer.join();
    EXPECT_GE(kills, 1);
    if (most_kills == 1) {
      ASSERT_TRUE(made.ok()) << made.status();
      ExpectSame(*made, *want);
    } else {
      EXPECT_TRUE(absl::IsUnavailable(made.status())) << made.status();
      EXPECT_EQ(kills, 3);
    }
  }
}

// A worker that is slow to begin: it waits for a file before it becomes the program, which does not
// know the task and ends with exit code 2.
class SlowWorkerTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_NE(mkdtemp(folder_.data()), nullptr);
    std::ofstream(script()) << "#!/bin/sh\nwhile [ ! -e " << go()
                            << " ]; do sleep 0.01; done\nexec " << WorkerProgram() << " \"$@\"\n";
    ASSERT_EQ(chmod(script().c_str(), 0700), 0);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string script() const { return folder_ + "/worker"; }
  std::string go() const { return folder_ + "/go"; }
  absl::StatusOr<WorkerProcess> Start() const {
    return WorkerProcess::Start(script(), {"--worker-task", "no such task", "0", "1"}, {});
  }

  std::string folder_ = "/tmp/sightline-worker-XXXXXX";
};

TEST_F(SlowWorkerTest, WorksForAParentThatIsThere) {
  auto worker = Start();
  ASSERT_TRUE(worker.ok()) << worker.status();
  std::ofstream(go()).flush();
  std::optional<int> state;
  WaitUntil([&] { return (state = worker->Ended()).has_value(); });
  EXPECT_TRUE(WIFEXITED(*state) && WEXITSTATUS(*state) == 2) << *state;
}

TEST_F(SlowWorkerTest, EndsAtOnceIfItsParentWentBefore) {
  // Orphans become our children, so that we can see how they end.
  ASSERT_EQ(prctl(PR_SET_CHILD_SUBREAPER, 1), 0);
  const pid_t parent = fork();
  ASSERT_GE(parent, 0);
  if (parent == 0) {
    const auto worker = Start();
    _exit(worker.ok() ? 0 : 1);  // as if killed: nothing is cleaned up
  }
  int parent_state = 0;
  ASSERT_EQ(waitpid(parent, &parent_state, 0), parent);
  ASSERT_EQ(parent_state, 0);
  std::ofstream(go()).flush();
  int state = 0;
  EXPECT_GT(waitpid(-1, &state, 0), 0);
  prctl(PR_SET_CHILD_SUBREAPER, 0);
  EXPECT_TRUE(WIFSIGNALED(state) && WTERMSIG(state) == SIGKILL) << state;
}

TEST(SharedMemory, WhatIsCutIsNotTakenForWhole) {
  const auto file = SharedMemory::Make("test", 0);
  ASSERT_TRUE(file.ok());
  SharedWriter writer(file->fd());
  writer.PutText("seven b");
  writer.PutAll(std::span<const double>(std::array{1.5, 2.5}));
  ASSERT_TRUE(writer.status().ok());
  for (const int cut : {0, 1, 8, 16, 17, 24}) {
    ASSERT_EQ(ftruncate(file->fd(), 40 - cut), 0);
    auto reader = SharedReader::Map(file->fd());
    ASSERT_TRUE(reader.ok());
    const bool has_text = cut <= 24;
    EXPECT_EQ(reader->GetText(), has_text ? "seven b" : "");
    const auto values = reader->GetAll<double>();
    EXPECT_EQ(reader->ok(), cut == 0);
    EXPECT_EQ(std::vector<double>(values.begin(), values.end()),
              cut == 0 ? (std::vector{1.5, 2.5}) : std::vector<double>());
    ASSERT_EQ(ftruncate(file->fd(), 40), 0);
  }
}

}  // namespace
}  // namespace sightline
