// SPDX-License-Identifier: Apache-2.0
#include "report/page/page_template.h"

#include "absl/strings/str_cat.h"

namespace sightline {

std::string FillTemplate(absl::string_view text,
                         const std::vector<std::pair<absl::string_view, std::string>>& values) {
  std::string result;
  while (true) {
    const size_t begin = text.find("{{");
    const size_t end = begin == absl::string_view::npos ? begin : text.find("}}", begin);
    if (end == absl::string_view::npos) break;
    absl::StrAppend(&result, text.substr(0, begin));
    const absl::string_view name = text.substr(begin + 2, end - begin - 2);
    for (const auto& [key, value] : values) {
      if (key == name) result += value;
    }
    text.remove_prefix(end + 2);
  }
  absl::StrAppend(&result, text);
  return result;
}

}  // namespace sightline
