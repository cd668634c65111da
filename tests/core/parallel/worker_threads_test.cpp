// SPDX-License-Identifier: Apache-2.0
#include "core/parallel/worker_threads.h"

#include <gtest/gtest.h>

#include <atomic>
#include <new>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "core/parallel/exception_status.h"

namespace sightline {
namespace {

TEST(WorkerThreadsTest, TheFirstExceptionReachesWhoJoins) {
  std::atomic<int> done = 0;
  WorkerThreads threads;
  for (int i = 0; i < 8; ++i) {
    threads.Start([&done, i] {
      if (i == 3) throw std::bad_alloc();
      ++done;
    });
  }
  EXPECT_THROW(threads.Join(), std::bad_alloc);
  EXPECT_EQ(done, 7);
  threads.Start([&done] { ++done; });
  EXPECT_NO_THROW(threads.Join());
  EXPECT_EQ(done, 8);
}

TEST(WorkerThreadsTest, WaitsWhenItIsLeftByAnException) {
  std::atomic<int> done = 0;
  EXPECT_THROW(
      {
        WorkerThreads threads;
        for (int i = 0; i < 4; ++i) threads.Start([&done] { ++done; });
        throw std::runtime_error("in the thread that started them");
      },
      std::runtime_error);
  EXPECT_EQ(done, 4);
}

absl::StatusCode CodeOf(auto throw_something) {
  try {
    throw_something();
  } catch (...) {
    return StatusOfException().code();
  }
  return absl::StatusCode::kOk;
}

TEST(ExceptionStatusTest, LackOfResourcesIsToldFromMistakes) {
  EXPECT_EQ(CodeOf([] { throw std::bad_alloc(); }), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(CodeOf([] { std::vector<double>().reserve(~size_t{0}); }),
            absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(
      CodeOf([] {
        throw std::system_error(std::make_error_code(std::errc::resource_unavailable_try_again));
      }),
      absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(CodeOf([] { throw std::runtime_error("wrong"); }), absl::StatusCode::kInternal);
  EXPECT_EQ(CodeOf([] { throw 1; }), absl::StatusCode::kInternal);
}

}  // namespace
}  // namespace sightline
