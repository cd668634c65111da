// SPDX-License-Identifier: Apache-2.0
// Parallel work on many independent rows.
#pragma once

#include <algorithm>
#include <cstdint>

#include "core/parallel/worker_threads.h"

namespace sightline {

// Calls work(begin, end) on disjoint ranges that cover [0, count), one per thread. Each index must
// write its own result, so that results do not depend on the number of threads.
template <typename Work>
void ForIndexRanges(int threads, int count, const Work& work) {
  const int parts = std::clamp(threads, 1, std::max(count, 1));
  const auto bound = [&](int part) {
    return static_cast<int>(static_cast<int64_t>(count) * part / parts);
  };
  WorkerThreads others;
  for (int part = 1; part < parts; ++part) {
    others.Start([&work, begin = bound(part), end = bound(part + 1)] { work(begin, end); });
  }
  work(0, bound(1));
  others.Join();
}

}  // namespace sightline
