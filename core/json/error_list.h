// SPDX-License-Identifier: Apache-2.0
// All that is wrong with a file at once, so that people need not run a command once per mistake.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace sightline {

class ErrorList {
 public:
  // More would not be read, and looking for them could take long in a file that is all wrong.
  static constexpr size_t kMostErrors = 20;

  // Adds `status` unless it is OK; returns whether it is. Errors that say the same count once.
  bool Add(const absl::Status& status) {
    if (status.ok()) return true;
    if (full()) return false;
    const std::string message(status.message());
    for (const std::string& known : messages_) {
      if (known == message) return false;
    }
    if (messages_.empty()) code_ = status.code();
    messages_.push_back(message);
    return false;
  }
  bool empty() const { return messages_.empty(); }
  // A full list means that no further errors are looked for.
  bool full() const { return messages_.size() >= kMostErrors; }

  // OK if there are none; of the first one's code, one error a line in the order in which they
  // came.
  absl::Status Status() const {
    if (messages_.empty()) return absl::OkStatus();
    return {code_,
            absl::StrCat(absl::StrJoin(messages_, "\n"), full() ? "\n... there may be more" : "")};
  }

 private:
  absl::StatusCode code_ = absl::StatusCode::kInvalidArgument;
  std::vector<std::string> messages_;
};

}  // namespace sightline
