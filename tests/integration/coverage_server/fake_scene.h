// SPDX-License-Identifier: Apache-2.0
// A coverage engine that is a formula: fast, deterministic, and as slow as a test wants it.
#pragma once

#include <atomic>
#include <string>

#include "absl/time/time.h"
#include "coverage_server/service/coverage_backend.h"

namespace sightline {

struct FakeCounters {
  std::atomic<int> builds_started = 0;
  std::atomic<int> builds_finished = 0;
  std::atomic<int> queries_started = 0;
  // Not cancelled.
  std::atomic<int> queries_finished = 0;
  std::atomic<int> queries_running = 0;
};

struct FakeOptions {
  absl::Duration build_time;
  absl::Duration query_time;
  // Targets of every scene.
  size_t targets = 1000;
  // Builds and queries do not end while this is true; must outlive the server; may be null.
  const std::atomic<bool>* hold = nullptr;
  // If given: a file that a query makes when it begins.
  std::string query_file = {};
  FakeCounters* counters = nullptr;  // must outlive the server; may be null
};

// Every tenth target is not measurable. Part gamma above 350 degrees collides; offset y above 0.45
// m needs too much travel. Exact coverage is a little larger than fast coverage. Results depend on
// the number of the part's triangles and on the sampling seed.
CoverageBackend MakeFakeBackend(const FakeOptions& options);

// The scene that such a backend serves, for comparison.
std::unique_ptr<CoverageScene> MakeFakeScene(SceneDefinition definition,
                                             const FakeOptions& options);

}  // namespace sightline
