// SPDX-License-Identifier: Apache-2.0
// Identifies the request to which a call, a job or a log line belongs, by W3C Trace Context
// (https://www.w3.org/TR/trace-context/). The context is passed on unchanged; no spans are
// recorded.
#pragma once

#include <string>
#include <string_view>

namespace sightline {

// Name of the gRPC metadata and of the HTTP header.
inline constexpr char kTraceparentKey[] = "traceparent";

// A new one, not sampled: "00-TRACE_ID-PARENT_ID-00".
std::string NewTraceparent();

// The traceparent in version 00 if `text` is a valid one of that or a later version; else empty.
std::string ValidTraceparent(std::string_view text);

// The trace id of a valid traceparent, 32 lower-case hexadecimal digits; empty for an empty one.
std::string_view TraceIdOf(std::string_view traceparent);

// Traceparent of this thread, or else of this process; empty: none.
const std::string& CurrentTraceparent();

// For programs that work on one request from start to end. Before threads are started.
void SetProcessTraceparent(std::string traceparent);

// Assigns this thread's work to that request until the end of the scope.
class ScopedTrace {
 public:
  explicit ScopedTrace(std::string traceparent);
  ~ScopedTrace();
  ScopedTrace(const ScopedTrace&) = delete;
  ScopedTrace& operator=(const ScopedTrace&) = delete;

 private:
  std::string before_;
};

}  // namespace sightline
