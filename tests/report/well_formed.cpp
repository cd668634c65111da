// SPDX-License-Identifier: Apache-2.0
#include "tests/report/well_formed.h"

#include <google/protobuf/descriptor.h>

#include <cctype>
#include <functional>
#include <regex>
#include <set>
#include <vector>

#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

// Calls `change` for every field that is set, of this message and of those in it.
void ForEachField(Message* message,
                  const std::function<void(Message*, const FieldDescriptor*)>& change) {
  const google::protobuf::Reflection* reflection = message->GetReflection();
  std::vector<const FieldDescriptor*> fields;
  reflection->ListFields(*message, &fields);
  for (const FieldDescriptor* field : fields) {
    if (field->is_map()) continue;
    if (field->cpp_type() != FieldDescriptor::CPPTYPE_MESSAGE) {
      change(message, field);
    } else if (field->is_repeated()) {
      for (int i = 0; i < reflection->FieldSize(*message, field); ++i) {
        ForEachField(reflection->MutableRepeatedMessage(message, field, i), change);
      }
    } else {
      ForEachField(reflection->MutableMessage(message, field), change);
    }
  }
}

}  // namespace

std::string MarkupFault(const std::string& html) {
  static const std::set<std::string> kVoid = {"meta", "link", "img", "br"};
  static const std::regex kTag(
      R"re((/?)([a-zA-Z][a-zA-Z0-9]*)((?: [a-zA-Z][a-zA-Z0-9-]*="[^"<>]*")*)(/?))re");
  static const std::regex kEntity("(amp|lt|gt|quot|#[0-9]+);[\\s\\S]*");
  static const std::regex kNoNumber("(^|[^a-zA-Z])(nan|inf)([^a-zA-Z]|$)");
  static const std::regex kId(" id=\"([^\"]*)\"");
  std::vector<std::string> open;
  std::set<std::string> ids;
  size_t at = html.find("<html");
  if (at == std::string::npos) return "no <html>";
  while (at < html.size()) {
    if (html[at] == '&' && !std::regex_match(html.substr(at + 1, 10), kEntity)) {
      return absl::StrCat("stray & in: ", html.substr(at, 60));
    }
    if (html[at] != '<') {
      if (open.empty() && !std::isspace(static_cast<unsigned char>(html[at]))) {
        return absl::StrCat("text outside of the page: ", html.substr(at, 60));
      }
      ++at;
      continue;
    }
    const size_t end = html.find('>', at);
    if (end == std::string::npos) return "tag is not closed";
    const std::string tag = html.substr(at + 1, end - at - 1);
    std::smatch match;
    if (!std::regex_match(tag, match, kTag)) return absl::StrCat("odd tag: ", tag.substr(0, 200));
    const std::string name = match[2], attributes = match[3];
    if (std::regex_search(attributes, kNoNumber)) return absl::StrCat("no number in: ", tag);
    std::smatch id;
    if (std::regex_search(attributes, id, kId) && !ids.insert(id[1]).second) {
      return absl::StrCat("id used twice: ", id[1].str());
    }
    at = end + 1;
    if (match[1].length() > 0) {
      if (open.empty() || open.back() != name) {
        return absl::StrCat("</", name, "> closes <", open.empty() ? "" : open.back(), ">");
      }
      open.pop_back();
    } else if (match[4].length() == 0 && kVoid.count(name) == 0) {
      open.push_back(name);
      if (name == "style") at = html.find("</style>", at);
    }
  }
  return open.empty() ? "" : absl::StrCat("<", open.back(), "> is never closed");
}

std::string OutsideReference(const std::string& html) {
  for (const char* text : {"<script", "http://", "https://", "@import", "url(", "onload"}) {
    if (html.find(text) != std::string::npos) return text;
  }
  return "";
}

size_t CountOf(const std::string& text, const std::string& part) {
  size_t count = 0;
  for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

std::string SectionOf(const std::string& html, const std::string& id) {
  const size_t at = html.find("<section id=\"" + id + "\"");
  return at == std::string::npos ? "" : html.substr(at, html.find("</section>", at) - at);
}

void SetAllTexts(Message* message, const std::string& text) {
  ForEachField(message, [&](Message* m, const FieldDescriptor* field) {
    if (field->type() != FieldDescriptor::TYPE_STRING) return;
    const google::protobuf::Reflection* reflection = m->GetReflection();
    if (!field->is_repeated()) return reflection->SetString(m, field, text);
    for (int i = 0; i < reflection->FieldSize(*m, field); ++i) {
      reflection->SetRepeatedString(m, field, i, text);
    }
  });
}

void SetAllNumbers(Message* message, double value) {
  ForEachField(message, [&](Message* m, const FieldDescriptor* field) {
    const google::protobuf::Reflection* reflection = m->GetReflection();
    const int count = field->is_repeated() ? reflection->FieldSize(*m, field) : 1;
    for (int i = 0; i < count; ++i) {
      if (field->cpp_type() == FieldDescriptor::CPPTYPE_DOUBLE) {
        field->is_repeated() ? reflection->SetRepeatedDouble(m, field, i, value)
                             : reflection->SetDouble(m, field, value);
      } else if (field->cpp_type() == FieldDescriptor::CPPTYPE_FLOAT) {
        const auto narrow = static_cast<float>(value);
        field->is_repeated() ? reflection->SetRepeatedFloat(m, field, i, narrow)
                             : reflection->SetFloat(m, field, narrow);
      }
    }
  });
}

}  // namespace sightline
