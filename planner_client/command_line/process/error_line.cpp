// SPDX-License-Identifier: Apache-2.0
#include "planner_client/command_line/process/error_line.h"

#include <cstdio>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "core/text/printable.h"
#include "planner_client/command_line/process/progress_line.h"

namespace sightline {

void PrintError(std::string_view code, std::string_view reason, const std::string& message) {
  if (UsesJsonProgress()) {
    const nlohmann::json line = {
        {"error", {{"code", code}, {"reason", reason}, {"message", message}}}};
    std::fprintf(stderr, "%s\n",
                 line.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace).c_str());
    return;
  }
  const bool several = message.find('\n') != std::string::npos;
  const std::string shown =
      several ? absl::StrCat("several errors:\n  ", absl::StrReplaceAll(message, {{"\n", "\n  "}}))
              : message;
  std::fprintf(stderr, "sightline: %s\n", Printable(shown).c_str());
}

}  // namespace sightline
