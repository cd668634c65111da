// SPDX-License-Identifier: Apache-2.0
#include "planning/robot/urdf/urdf_file.h"

#include <console_bridge/console.h>
#include <tinyxml.h>
#include <urdf_model/model.h>
#include <urdf_parser/urdf_parser.h>

#include <algorithm>
#include <exception>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <sstream>
#include <string_view>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/digest/sha256.h"
#include "core/file/no_such_file.h"
#include "planning/robot/urdf/urdf_vocabulary.h"

namespace sightline {
namespace {

// The largest published arms have some 100 kB without their meshes.
constexpr uintmax_t kMostBytes = 4 << 20;
// URDF itself is less than ten deep, with at most four attributes.
constexpr int kMostDepth = 64;
constexpr int kMostAttributes = 64;

// Collects the messages that urdfdom writes to its console. Only its second error message names the
// joint or link of the first one.
class Messages final : public console_bridge::OutputHandler {
 public:
  void log(const std::string& text, console_bridge::LogLevel level, const char*, int) override {
    if (level >= console_bridge::CONSOLE_BRIDGE_LOG_ERROR && count_++ < kMostErrors) {
      absl::StrAppend(&errors_, errors_.empty() ? "" : "; ", text);
    }
  }
  const std::string& errors() const { return errors_; }

 private:
  static constexpr int kMostErrors = 2;
  int count_ = 0;
  std::string errors_;
};

// Finds constructs that TinyXML must not read; empty if there are none. TinyXML reads elements by
// recursion and finds duplicate attributes by comparing all pairs. Tags are split exactly as
// TinyXML does, which differs from XML: otherwise a comment here could be an element there.
std::string Refuse(std::string_view xml) {
  int depth = 0;
  bool after_root = false;
  size_t at = 0;
  size_t end = 0;  // end of the checked text
  // TinyXML silently stops at text behind the root.
  const auto has_text_behind_root = [&](size_t until) {
    const std::string_view between = xml.substr(end, until - end);
    return after_root && depth == 0 && between.find_first_not_of(" \t\r\n") != between.npos;
  };
  while ((at = xml.find('<', at)) != std::string_view::npos) {
    if (has_text_behind_root(at)) return "has text behind its root element";
    const std::string_view rest = xml.substr(at);
    size_t length = 0;
    if (rest.starts_with("<!--")) {
      // Unlike in XML, the dashes at its start are not those at its end, as in <!-->.
      length = rest.find("-->", 4);
      length = length == rest.npos ? rest.size() : length + 2;
    } else if (rest.starts_with("<![CDATA[")) {
      return "has a CDATA section, which a URDF does not need";
    } else if (rest.starts_with("<?")) {
      // Ends at the first '>', whatever precedes it.
      length = std::min(rest.find('>'), rest.size());
      if (!rest.substr(0, length).ends_with('?'))
        return "has a declaration that does not end in ?>";
    } else if (rest.starts_with("<!")) {
      return "has a document type declaration, which a URDF does not need";
    } else if (rest.starts_with("</")) {
      if (--depth < 0) return "closes an element that is not open";
      after_root = true;
      length = std::min(rest.find('>'), rest.size());
    } else {
      // Attributes may hold '>' between quotes.
      char quote = 0;
      int attributes = 0;
      for (length = 1; length < rest.size() && (quote != 0 || rest[length] != '>'); ++length) {
        const char c = rest[length];
        if (quote != 0) {
          if (c == quote) quote = 0;
        } else if (c == '"' || c == '\'') {
          quote = c;
        } else if (c == '=') {
          ++attributes;
        }
      }
      if (attributes > kMostAttributes) {
        return absl::StrCat("has an element with more than ", kMostAttributes, " attributes");
      }
      if (after_root && depth == 0) return "has a second root element";
      if (rest[length - 1] == '/') {
        after_root = true;
      } else if (++depth > kMostDepth) {
        return absl::StrCat("has elements nested more than ", kMostDepth, " deep");
      }
    }
    at = std::min(at + length, xml.size());
    end = std::min(at + 1, xml.size());
  }
  return has_text_behind_root(xml.size()) ? "has text behind its root element" : "";
}

// Returns why the links of a robot are no forest; empty if they are. Links that own one another in
// a loop would never be freed.
std::string RefuseLoops(const TiXmlElement& robot) {
  std::map<std::string, std::string> parent_of;
  const auto link_of = [](const TiXmlElement* end) {
    const char* name = end != nullptr ? end->Attribute("link") : nullptr;
    return std::string(name != nullptr ? name : "");
  };
  for (const TiXmlElement* joint = robot.FirstChildElement("joint"); joint != nullptr;
       joint = joint->NextSiblingElement("joint")) {
    const std::string child = link_of(joint->FirstChildElement("child"));
    const std::string parent = link_of(joint->FirstChildElement("parent"));
    if (child.empty() || parent.empty()) continue;
    if (!parent_of.emplace(child, parent).second) {
      return absl::StrCat("link ", child, " has two parents");
    }
  }
  // Links from which the walk to the parents is known to end.
  std::map<std::string, bool> ends;
  for (const auto& [link, parent] : parent_of) {
    std::vector<std::string> way;
    std::string at = link;
    while (!ends.contains(at)) {
      ends[at] = false;
      way.push_back(at);
      const auto above = parent_of.find(at);
      if (above == parent_of.end()) {
        ends[at] = true;
        break;
      }
      at = above->second;
    }
    if (!ends[at]) return absl::StrCat("link ", at, " is in a loop");
    for (const std::string& passed : way) ends[passed] = true;
  }
  return "";
}

// Names of the joints whose element `tag` has one of the attributes.
std::set<std::string> JointsThatState(const TiXmlElement& robot, const char* tag, const char* lower,
                                      const char* upper) {
  std::set<std::string> names;
  for (const TiXmlElement* joint = robot.FirstChildElement("joint"); joint != nullptr;
       joint = joint->NextSiblingElement("joint")) {
    const TiXmlElement* element = joint->FirstChildElement(tag);
    const char* name = joint->Attribute("name");
    if (element == nullptr || name == nullptr) continue;
    if (element->Attribute(lower) != nullptr || element->Attribute(upper) != nullptr) {
      names.insert(name);
    }
  }
  return names;
}

}  // namespace

absl::StatusOr<UrdfFile> ReadUrdfFile(const std::string& path) {
  const auto bad = [&](const std::string& reason) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": ", reason));
  };
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) {
    const std::string other = NameInOtherCase(path);
    return absl::NotFoundError(absl::StrCat(path, other.empty() ? ": no such file" : other));
  }
  if (!std::filesystem::is_regular_file(status)) return bad("is not a regular file");
  if (const uintmax_t bytes = std::filesystem::file_size(path, error);
      error || bytes > kMostBytes) {
    return bad(absl::StrCat("has ", bytes, " bytes; a URDF has at most ", kMostBytes));
  }
  std::ifstream file(path, std::ios::binary);
  std::ostringstream stream;
  stream << file.rdbuf();
  const std::string xml = std::move(stream).str();
  if (!file || xml.size() > kMostBytes) return bad("cannot be read");
  if (xml.find('\0') != std::string::npos) return bad("is not XML: it holds zero bytes");
  if (const std::string reason = Refuse(xml); !reason.empty()) return bad(reason);
  UrdfFile result;
  {
    TiXmlDocument document;
    document.Parse(xml.c_str());
    if (document.Error()) {
      return bad(absl::StrCat("line ", document.ErrorRow(),
                              ": is not well formed: ", document.ErrorDesc()));
    }
    const TiXmlElement* robot = document.RootElement();
    if (robot == nullptr) return bad("is not a URDF: it has no element");
    const absl::Status known = CheckUrdfVocabulary(*robot, &result.remarks);
    if (!known.ok()) return bad(std::string(known.message()));
    if (const std::string reason = RefuseLoops(*robot); !reason.empty()) return bad(reason);
    result.joints_with_limits = JointsThatState(*robot, "limit", "lower", "upper");
    result.joints_with_soft_limits =
        JointsThatState(*robot, "safety_controller", "soft_lower_limit", "soft_upper_limit");
  }

  // urdfdom has one console for the whole process.
  static std::mutex console;
  const std::lock_guard<std::mutex> lock(console);
  Messages messages;
  console_bridge::useOutputHandler(&messages);
  std::string thrown;
  try {
    result.model = urdf::parseURDF(xml);
  } catch (const std::exception& exception) {
    thrown = exception.what();
  }
  console_bridge::restorePreviousOutputHandler();
  // After some errors urdfdom continues without the faulty element.
  if (!messages.errors().empty()) return bad(messages.errors());
  if (!thrown.empty()) return bad(thrown);
  if (!result.model) return bad("is not a URDF");
  Sha256 digest;
  digest.Update(xml);
  result.digest = digest.Hex();
  return result;
}

}  // namespace sightline
