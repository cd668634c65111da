// SPDX-License-Identifier: Apache-2.0
#include "planning_service/execution/command_messages.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

constexpr size_t kLongestLine = 64 << 10;
constexpr size_t kLastWordsBytes = 2000;

absl::StatusCode CodeFromName(const std::string& name) {
  for (int code = 0; code <= 16; ++code) {
    const auto candidate = static_cast<absl::StatusCode>(code);
    if (absl::StatusCodeToString(candidate) == name) return candidate;
  }
  return absl::StatusCode::kUnknown;
}

std::string MessageText(const nlohmann::json& object, const char* field) {
  return object.contains(field) && object[field].is_string() ? object[field].get<std::string>()
                                                             : "";
}

}  // namespace

void CommandMessages::Add(const char* bytes, size_t size) {
  rest_.append(bytes, size);
  size_t begin = 0;
  for (size_t end = rest_.find('\n'); end != std::string::npos; end = rest_.find('\n', begin)) {
    Line(rest_.substr(begin, end - begin));
    begin = end + 1;
  }
  rest_.erase(0, begin);
  if (rest_.size() > kLongestLine) rest_.clear();
}

void CommandMessages::Line(const std::string& line) {
  const nlohmann::json json = nlohmann::json::parse(line, nullptr, /*allow_exceptions=*/false);
  if (json.is_object() && json.contains("progress") && json["progress"].is_number()) {
    progress_.fraction = std::clamp(json["progress"].get<double>(), 0.0, 1.0);
    progress_.message = MessageText(json, "message");
  } else if (json.is_object() && json.contains("error") && json["error"].is_object()) {
    const nlohmann::json& error = json["error"];
    failure_ = JobFailure{CodeFromName(MessageText(error, "code")), MessageText(error, "reason"),
                          MessageText(error, "message")};
  } else {
    absl::StrAppend(&last_words_, line, "\n");
    if (last_words_.size() > 2 * kLastWordsBytes) {
      // Cuts between words: half a path could not be recognised as a path (server_paths.h).
      const size_t cut = last_words_.find_first_of(" \n", last_words_.size() - kLastWordsBytes);
      last_words_.erase(0, cut == std::string::npos ? cut : cut + 1);
    }
  }
}

}  // namespace sightline
