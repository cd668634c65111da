// SPDX-License-Identifier: Apache-2.0
#include "core/json/line_comments.h"

#include <cstddef>

namespace sightline {

std::string BlankLineComments(std::string json) {
  bool in_string = false;
  for (size_t i = 0; i < json.size(); ++i) {
    if (in_string) {
      if (json[i] == '\\') ++i;  // an escaped character does not end the string
      // A string ends with its line: one that is not closed hides nothing of the next.
      if (i < json.size() && (json[i] == '"' || json[i] == '\n')) in_string = false;
    } else if (json[i] == '"') {
      in_string = true;
    } else if (json[i] == '/' && i + 1 < json.size() && json[i + 1] == '/') {
      for (; i < json.size() && json[i] != '\n'; ++i) json[i] = ' ';
    }
  }
  return json;
}

}  // namespace sightline
