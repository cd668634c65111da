// SPDX-License-Identifier: Apache-2.0
#include "core/trace/trace_context.h"

#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <set>
#include <string>
#include <thread>

#include "core/job/job_store.h"

namespace sightline {
namespace {

constexpr char kSample[] = "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01";

TEST(TraceContextTest, NewOnesAreValidAndDifferent) {
  std::set<std::string> seen;
  for (int i = 0; i < 1000; ++i) {
    const std::string made = NewTraceparent();
    EXPECT_EQ(ValidTraceparent(made), made);
    EXPECT_TRUE(seen.insert(std::string(TraceIdOf(made))).second);
  }
}

// Cases of the specification, section 3.2.
TEST(TraceContextTest, KnowsValidOnes) {
  EXPECT_EQ(ValidTraceparent(kSample), kSample);
  EXPECT_EQ(TraceIdOf(kSample), "0af7651916cd43dd8448eb211c80319c");
  const std::string rest = std::string(kSample).substr(2);
  EXPECT_EQ(ValidTraceparent("cc" + rest), kSample);
  EXPECT_EQ(ValidTraceparent("cc" + rest + "-what-the-future-will-be-like"), kSample);
  EXPECT_EQ(ValidTraceparent("cc" + rest + ".what"), "");
  EXPECT_EQ(ValidTraceparent("ff" + rest), "");
  EXPECT_EQ(ValidTraceparent("00" + rest + "-more"), "");
  EXPECT_EQ(ValidTraceparent(""), "");
  EXPECT_EQ(ValidTraceparent("00-00000000000000000000000000000000-b7ad6b7169203331-01"), "");
  EXPECT_EQ(ValidTraceparent("00-0af7651916cd43dd8448eb211c80319c-0000000000000000-01"), "");
}

// Text from outside goes into logs: nothing but the very form may pass.
TEST(TraceContextTest, NoOtherByteAnywhere) {
  for (size_t i = 0; i < sizeof(kSample) - 1; ++i) {
    for (const char other : {'G', 'A', ' ', '\n', '"', '=', '\0'}) {
      std::string text = kSample;
      text[i] = other;
      EXPECT_EQ(ValidTraceparent(text), "") << i;
    }
    EXPECT_EQ(ValidTraceparent(std::string(kSample, i)), "") << i;
  }
}

TEST(TraceContextTest, ScopesNestAndAreOfTheirThread) {
  EXPECT_EQ(CurrentTraceparent(), "");
  const ScopedTrace outer("outer");
  {
    const ScopedTrace inner("inner");
    EXPECT_EQ(CurrentTraceparent(), "inner");
    std::string seen = "none";
    std::thread([&] { seen = CurrentTraceparent(); }).join();
    EXPECT_EQ(seen, "");
  }
  EXPECT_EQ(CurrentTraceparent(), "outer");
}

TEST(TraceContextTest, JobsBelongToTheRequestThatMadeThem) {
  const auto store = MakeInMemoryJobStore(1);
  std::string seen[2];
  std::string ids[2];
  for (int i = 0; i < 2; ++i) {
    const ScopedTrace trace(i == 0 ? "first" : "second");
    const auto job = store->Create("job", "", "", [&seen, i](JobContext&) {
      seen[i] = CurrentTraceparent();
      return absl::StatusOr<std::string>("");
    });
    ASSERT_TRUE(job.ok());
    ids[i] = job->job_id;
  }
  for (const std::string& id : ids) {
    int64_t revision = 0;
    while (true) {
      const auto job = store->WaitForChange(id, revision, absl::InfiniteDuration());
      ASSERT_TRUE(job.ok());
      if (job->finished()) break;
      revision = job->revision;
    }
  }
  EXPECT_EQ(seen[0], "first");
  EXPECT_EQ(seen[1], "second");
}

}  // namespace
}  // namespace sightline
