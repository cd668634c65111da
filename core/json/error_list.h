// SPDX-License-Identifier: Apache-2.0
// Collects all errors of a file, so that people need not run a command once per error.
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
  // Limit on errors: nobody reads more, and in a very wrong file the search could take long.
  static constexpr size_t kMostErrors = 20;

  // Adds `status` unless it is OK; returns true if it is OK. Equal messages are added once.
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

  // OK if there are no errors. Else a status with the code of the first error and one error per
  // line, in the order in which they were added.
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
