#include "planner_client/robot/urdf/urdf_file.h"

#include <console_bridge/console.h>
#include <urdf_model/model.h>
#include <urdf_parser/urdf_parser.h>

#include <algorithm>
#include <exception>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <sstream>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "planner_client/rpc_client/sha256.h"

namespace sightline {
namespace {

// The largest published arms have some 100 kB without their meshes.
constexpr uintmax_t kMostBytes = 4 << 20;
// TinyXML reads by recursion; URDF itself is less than ten deep.
constexpr int kMostDepth = 64;

// What urdfdom says on its console.
class Messages final : public console_bridge::OutputHandler {
 public:
  void log(const std::string& text, console_bridge::LogLevel level, const char*, int) override {
    if (level >= console_bridge::CONSOLE_BRIDGE_LOG_ERROR && first_error_.empty()) {
      first_error_ = text;
    }
  }
  const std::string& first_error() const { return first_error_; }

 private:
  std::string first_error_;
};

// What TinyXML must not be given: empty if nothing.
std::string Refuse(std::string_view xml) {
  int depth = 0;
  size_t at = 0;
  const auto skip_past = [&](std::string_view end) {
    const size_t found = xml.find(end, at);
    at = found == std::string_view::npos ? xml.size() : found + end.size();
  };
  while ((at = xml.find('<', at)) != std::string_view::npos) {
    const std::string_view rest = xml.substr(at);
    if (rest.starts_with("<!--")) {
      skip_past("-->");
    } else if (rest.starts_with("<![CDATA[")) {
      skip_past("]]>");
    } else if (rest.starts_with("<?")) {
      skip_past("?>");
    } else if (rest.starts_with("<!")) {
      return "has a document type declaration, which a URDF does not need";
    } else if (rest.starts_with("</")) {
      --depth;
      skip_past(">");
    } else {
      // Attributes may hold '>' between quotes.
      char quote = 0;
      size_t end = at + 1;
      for (; end < xml.size(); ++end) {
        const char c = xml[end];
        if (quote != 0) {
          if (c == quote) quote = 0;
        } else if (c == '"' || c == '\'') {
          quote = c;
        } else if (c == '>') {
          break;
        }
      }
      if (xml[end - 1] != '/' && ++depth > kMostDepth) {
        return absl::StrCat("has elements nested more than ", kMostDepth, " deep");
      }
      at = std::min(end + 1, xml.size());
    }
  }
  return "";
}

}  // namespace

absl::StatusOr<UrdfFile> ReadUrdfFile(const std::string& path) {
  const auto bad = [&](const std::string& reason) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": ", reason));
  };
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) {
    return absl::NotFoundError(absl::StrCat(path, ": no such file"));
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
  // The console of urdfdom is one for the whole process.
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
  // urdfdom goes on after some errors, without what was wrong.
  if (!messages.first_error().empty()) return bad(messages.first_error());
  if (!thrown.empty()) return bad(thrown);
  if (!result.model) return bad("is not a URDF");
  Sha256 digest;
  digest.Add(xml);
  result.digest = digest.Hex();
  return result;
}

}  // namespace sightline
