// SPDX-License-Identifier: Apache-2.0
#include "planner_client/inspection_draft/commented_json.h"

#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "core/json/strict_json.h"

namespace sightline {
namespace {

constexpr size_t kColumns = 96;

void AppendComment(const std::string& comment, size_t indent, std::string* out) {
  const std::string start = absl::StrCat(std::string(indent, ' '), "//");
  std::string line = start;
  for (const absl::string_view word : absl::StrSplit(comment, ' ', absl::SkipEmpty())) {
    if (line.size() + 1 + word.size() > kColumns && line.size() > start.size()) {
      absl::StrAppend(out, line, "\n");
      line = start;
    }
    absl::StrAppend(&line, " ", word);
  }
  absl::StrAppend(out, line, "\n");
}

// The name of the field that a line of ToJson begins, two spaces a level; empty: none.
absl::string_view FieldOf(absl::string_view line, size_t* indent) {
  *indent = line.find_first_not_of(' ');
  if (*indent == absl::string_view::npos || line[*indent] != '"') return "";
  const size_t end = line.find("\": ", *indent + 1);
  if (end == absl::string_view::npos) return "";
  return line.substr(*indent + 1, end - *indent - 1);
}

}  // namespace

std::string CommentedJson(const google::protobuf::Message& message, const FieldComments& comments) {
  std::string out;
  const auto comment = [&](const std::string& path, size_t indent) {
    if (const auto found = comments.find(path); found != comments.end()) {
      AppendComment(found->second, indent, &out);
    }
  };
  comment("", 0);
  std::vector<std::string> path;
  std::string json = ToJson(message);
  json.pop_back();  // its last line break
  for (const absl::string_view line : absl::StrSplit(json, '\n')) {
    size_t indent = 0;
    if (const absl::string_view field = FieldOf(line, &indent); !field.empty()) {
      path.resize(indent / 2 - 1);
      path.emplace_back(field);
      comment(absl::StrJoin(path, "."), indent);
    }
    absl::StrAppend(&out, line, "\n");
  }
  return out;
}

}  // namespace sightline
