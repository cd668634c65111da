// SPDX-License-Identifier: Apache-2.0
#include "core/trace/trace_context.h"

#include <random>
#include <utility>

#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

// "00-" 32 digits "-" 16 digits "-" 2 digits.
constexpr size_t kTraceIdBegin = 3;
constexpr size_t kTraceIdDigits = 32;
constexpr size_t kParentIdBegin = 36;
constexpr size_t kParentIdDigits = 16;
constexpr size_t kFlagsBegin = 53;
constexpr size_t kLength = 55;

std::string process_traceparent;
thread_local std::string thread_traceparent;

bool IsHex(std::string_view text) {
  return text.find_first_not_of("0123456789abcdef") == std::string_view::npos;
}

bool IsId(std::string_view text) {
  return IsHex(text) && text.find_first_not_of('0') != std::string_view::npos;
}

}  // namespace

std::string NewTraceparent() {
  std::random_device random;
  const auto digits = [&random](size_t count) {
    std::string id;
    // All zeros would be no id.
    do {
      id.clear();
      while (id.size() < count) absl::StrAppend(&id, absl::Hex(random(), absl::kZeroPad8));
    } while (!IsId(id));
    return id;
  };
  const std::string trace_id = digits(kTraceIdDigits);
  return absl::StrCat("00-", trace_id, "-", digits(kParentIdDigits), "-00");
}

std::string ValidTraceparent(std::string_view text) {
  if (text.size() < kLength || !IsHex(text.substr(0, 2)) || text.starts_with("ff")) return "";
  const bool first_version = text.starts_with("00");
  if (first_version ? text.size() != kLength : text.size() > kLength && text[kLength] != '-') {
    return "";
  }
  if (text[kTraceIdBegin - 1] != '-' || text[kParentIdBegin - 1] != '-' ||
      text[kFlagsBegin - 1] != '-' || !IsId(text.substr(kTraceIdBegin, kTraceIdDigits)) ||
      !IsId(text.substr(kParentIdBegin, kParentIdDigits)) || !IsHex(text.substr(kFlagsBegin, 2))) {
    return "";
  }
  return "00" + std::string(text.substr(2, kLength - 2));
}

std::string_view TraceIdOf(std::string_view traceparent) {
  return traceparent.size() < kLength ? std::string_view()
                                      : traceparent.substr(kTraceIdBegin, kTraceIdDigits);
}

const std::string& CurrentTraceparent() {
  return thread_traceparent.empty() ? process_traceparent : thread_traceparent;
}

void SetProcessTraceparent(std::string traceparent) {
  process_traceparent = std::move(traceparent);
}

ScopedTrace::ScopedTrace(std::string traceparent)
    : before_(std::exchange(thread_traceparent, std::move(traceparent))) {}

ScopedTrace::~ScopedTrace() { thread_traceparent = std::move(before_); }

}  // namespace sightline
