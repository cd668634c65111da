// SPDX-License-Identifier: Apache-2.0
#include "core/json/strict_json.h"

#include <fcntl.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/util/json_util.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/file/read_file.h"
#include "core/json/error_list.h"
#include "core/json/json_text.h"
#include "core/json/line_comments.h"
#include "core/json/printable.h"
#include "core/spelling/nearest_name.h"

namespace sightline {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::EnumDescriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;

// protobuf's own JSON parser stops at 100 levels; far more than any of our files needs.
constexpr size_t kMaxDepth = 64;
// Once parsed a value takes some 200 bytes for a moment, however short its text is.
constexpr size_t kMaxJsonValues = 2'000'000;
// What reading a file may cost: the largest of ours, 10 000 recordings, has 10 MB.
constexpr uint64_t kMaxFileBytes = uint64_t{64} << 20;

struct JsonMember;

// A JSON value that, unlike nlohmann::json, keeps duplicate keys.
struct JsonNode {
  enum class Type { kNull, kBool, kInteger, kNumber, kString, kArray, kObject };
  Type type = Type::kNull;
  std::string text;   // of a string, or of a number as written
  double number = 0;  // of kInteger and kNumber
  bool negative = false;
  uint64_t magnitude = 0;  // of kInteger
  std::vector<JsonMember> members;
  std::vector<JsonNode> elements;
};

struct JsonMember {
  std::string key;
  JsonNode value;
};

struct TextPosition {
  size_t line = 1, column = 1;
};

TextPosition PositionOf(const std::string& text, size_t byte) {
  TextPosition position;
  for (size_t i = 0; i < std::min(byte, text.size()); ++i) {
    if (text[i] == '\n') {
      ++position.line;
      position.column = 1;
    } else {
      ++position.column;
    }
  }
  return position;
}

// Builds the tree from the parser's events. The stack holds open containers; pointers stay valid
// because only the innermost container grows.
class TreeBuilder : public nlohmann::json_sax<nlohmann::json> {
 public:
  JsonNode root;
  std::string error;
  size_t error_byte = 0;

  bool null() override { return Add({}) != nullptr; }
  bool boolean(bool value) override {
    JsonNode node;
    node.type = JsonNode::Type::kBool;
    node.text = value ? "true" : "false";
    return Add(std::move(node)) != nullptr;
  }
  bool number_integer(number_integer_t value) override {
    JsonNode node;
    node.type = JsonNode::Type::kInteger;
    node.negative = value < 0;
    node.magnitude = node.negative ? 0 - static_cast<uint64_t>(value) : value;
    node.number = static_cast<double>(value);
    node.text = absl::StrCat(value);
    return Add(std::move(node)) != nullptr;
  }
  bool number_unsigned(number_unsigned_t value) override {
    JsonNode node;
    node.type = JsonNode::Type::kInteger;
    node.magnitude = value;
    node.number = static_cast<double>(value);
    node.text = absl::StrCat(value);
    return Add(std::move(node)) != nullptr;
  }
  bool number_float(number_float_t value, const string_t& text) override {
    JsonNode node;
    node.type = JsonNode::Type::kNumber;
    node.number = value;
    node.text = text;
    return Add(std::move(node)) != nullptr;
  }
  bool string(string_t& value) override {
    JsonNode node;
    node.type = JsonNode::Type::kString;
    node.text = value;
    return Add(std::move(node)) != nullptr;
  }
  bool binary(binary_t&) override { return false; }  // not in JSON text
  bool start_object(size_t) override { return Open(JsonNode::Type::kObject); }
  bool start_array(size_t) override { return Open(JsonNode::Type::kArray); }
  bool end_object() override { return Close(); }
  bool end_array() override { return Close(); }
  bool key(string_t& value) override {
    key_ = value;
    return true;
  }
  bool parse_error(size_t byte, const std::string&, const nlohmann::detail::exception& e) override {
    error_byte = byte > 0 ? byte - 1 : 0;
    error = e.what();
    // "[json.exception.parse_error.101] parse error at line 1, column 5: reason": keep the reason.
    const size_t bracket = error.find("] ");
    if (bracket != std::string::npos) error = error.substr(bracket + 2);
    const size_t column = error.find("column ");
    const size_t reason = column == std::string::npos ? column : error.find(": ", column);
    if (reason != std::string::npos) error = error.substr(reason + 2);
    return false;
  }

 private:
  JsonNode* Add(JsonNode node) {
    if (++values_ > kMaxJsonValues) {
      error = absl::StrCat("has more than ", kMaxJsonValues, " values");
      error_byte = std::numeric_limits<size_t>::max();
      return nullptr;
    }
    if (open_.empty()) {
      root = std::move(node);
      return &root;
    }
    if (open_.back()->type == JsonNode::Type::kObject) {
      open_.back()->members.push_back({std::move(key_), std::move(node)});
      return &open_.back()->members.back().value;
    }
    open_.back()->elements.push_back(std::move(node));
    return &open_.back()->elements.back();
  }
  bool Open(JsonNode::Type type) {
    if (open_.size() >= kMaxDepth) {
      error = absl::StrCat("nested deeper than ", kMaxDepth, " levels");
      error_byte = std::numeric_limits<size_t>::max();
      return false;
    }
    JsonNode node;
    node.type = type;
    JsonNode* const added = Add(std::move(node));
    if (added == nullptr) return false;
    open_.push_back(added);
    return true;
  }
  bool Close() {
    open_.pop_back();
    return true;
  }

  std::vector<JsonNode*> open_;
  size_t values_ = 0;
  std::string key_;
};

std::string Shown(const std::string& text) {
  return absl::StrCat("\"", absl::CEscape(text.substr(0, 60)), text.size() > 60 ? "..." : "", "\"");
}

std::string Describe(const JsonNode& node) {
  switch (node.type) {
    case JsonNode::Type::kNull:
      return "null";
    case JsonNode::Type::kBool:
    case JsonNode::Type::kInteger:
    case JsonNode::Type::kNumber:
      return node.text;
    case JsonNode::Type::kString:
      return Shown(node.text);
    case JsonNode::Type::kArray:
      return "an array";
    case JsonNode::Type::kObject:
      return "an object";
  }
  return "";
}

// Checks a parsed tree against a message type; collects what is wrong.
class Walker {
 public:
  explicit Walker(std::string file) : file_(std::move(file)) {}

  absl::Status Check(const JsonNode& root, const Descriptor& type) {
    CheckMessage(root, type, "");
    return errors_.Status();
  }

 private:
  static std::string Shorten(const std::string& path) {
    return path.size() <= 200 ? path : path.substr(0, 200) + "...";
  }

  void Error(const std::string& path, const std::string& reason) {
    errors_.Add(absl::InvalidArgumentError(absl::StrCat(
        file_, ": ", path.empty() ? "" : absl::StrCat(Printable(path), ": "), reason)));
  }
  void Expected(const std::string& path, const std::string& what, const JsonNode& node) {
    if (node.type == JsonNode::Type::kNull) {
      Error(path,
            absl::StrCat("is null, must be ", what, "; leave the field out to get its default"));
      return;
    }
    Error(path, absl::StrCat("is ", Describe(node), ", must be ", what));
  }

  void CheckMessage(const JsonNode& node, const Descriptor& type, const std::string& path) {
    if (node.type != JsonNode::Type::kObject) {
      Expected(path, absl::StrCat("an object", ObjectInstead(node, type)), node);
      return;
    }
    // Ordered: keys could be made to have the same hash.
    std::set<std::string_view> seen;
    std::vector<std::pair<const google::protobuf::OneofDescriptor*, std::string>> oneofs;
    for (const auto& [key, value] : node.members) {
      if (errors_.full()) return;
      const std::string field_path = Shorten(path.empty() ? key : absl::StrCat(path, ".", key));
      const FieldDescriptor* field = type.FindFieldByName(key);
      if (field == nullptr) {
        UnknownField(key, type, field_path);
        continue;
      }
      if (!seen.insert(key).second) {
        Error(field_path, "given twice");
        continue;
      }
      if (const auto* oneof = field->real_containing_oneof()) {
        for (const auto& [other, name] : oneofs) {
          if (other == oneof) {
            Error(field_path, absl::StrCat("cannot be given together with ", name));
          }
        }
        oneofs.emplace_back(oneof, key);
      }
      CheckField(value, *field, field_path);
    }
  }

  void UnknownField(const std::string& key, const Descriptor& type, const std::string& path) {
    std::vector<std::string> known;
    for (int i = 0; i < type.field_count(); ++i) known.push_back(type.field(i)->name());
    Error(path, absl::StrCat("unknown field", known.empty()
                                                  ? ""
                                                  : absl::StrCat("; the nearest known name is \"",
                                                                 NearestName(key, known), "\"")));
  }

  // Messages that say what a number may be have `fixed` for a single one and `values` for several.
  static std::string ObjectInstead(const JsonNode& node, const Descriptor& type) {
    const auto is_number = [](const JsonNode& n) {
      return n.type == JsonNode::Type::kInteger || n.type == JsonNode::Type::kNumber;
    };
    const FieldDescriptor* fixed = type.FindFieldByName("fixed");
    if (fixed == nullptr || fixed->cpp_type() != FieldDescriptor::CPPTYPE_DOUBLE) return "";
    if (is_number(node)) return absl::StrCat(": write {\"fixed\": ", node.text, "}");
    if (node.type == JsonNode::Type::kArray && type.FindFieldByName("values") != nullptr) {
      return ": write {\"values\": [...]}, or {\"ranges\": [{\"min\": ..., \"max\": ...}]}";
    }
    return "";
  }

  void CheckField(const JsonNode& node, const FieldDescriptor& field, const std::string& path) {
    if (!field.is_repeated()) return CheckValue(node, field, path);
    if (field.is_map()) return CheckMap(node, field, path);
    if (node.type != JsonNode::Type::kArray) return Expected(path, "an array", node);
    for (size_t i = 0; i < node.elements.size() && !errors_.full(); ++i) {
      CheckValue(node.elements[i], field, absl::StrCat(path, "[", i, "]"));
    }
  }

  // Keys are strings; that is all our messages need.
  void CheckMap(const JsonNode& node, const FieldDescriptor& field, const std::string& path) {
    if (node.type != JsonNode::Type::kObject) return Expected(path, "an object", node);
    // protobuf's reader takes seconds for many keys that were made to have the same hash. Effects,
    // the only ones with maps, have at most five parameters.
    constexpr size_t kMaxEntries = 100;
    if (node.members.size() > kMaxEntries) {
      return Error(path, absl::StrCat("has ", node.members.size(), " entries, must have at most ",
                                      kMaxEntries));
    }
    std::set<std::string_view> seen;
    for (const auto& [key, value] : node.members) {
      if (errors_.full()) return;
      const std::string entry = Shorten(absl::StrCat(path, ".", key));
      if (!seen.insert(key).second) {
        Error(entry, "given twice");
        continue;
      }
      CheckValue(value, *field.message_type()->map_value(), entry);
    }
  }

  void CheckValue(const JsonNode& node, const FieldDescriptor& field, const std::string& path) {
    switch (field.cpp_type()) {
      case FieldDescriptor::CPPTYPE_MESSAGE:
        return CheckMessage(node, *field.message_type(), path);
      case FieldDescriptor::CPPTYPE_ENUM:
        return CheckEnum(node, *field.enum_type(), path);
      case FieldDescriptor::CPPTYPE_STRING:
        if (node.type != JsonNode::Type::kString) Expected(path, "a string", node);
        return;
      case FieldDescriptor::CPPTYPE_BOOL:
        if (node.type != JsonNode::Type::kBool) Expected(path, "true or false", node);
        return;
      case FieldDescriptor::CPPTYPE_FLOAT:
      case FieldDescriptor::CPPTYPE_DOUBLE: {
        // proto3 JSON would also take "NaN", "Infinity" and numbers in quotes.
        const bool number =
            node.type == JsonNode::Type::kInteger || node.type == JsonNode::Type::kNumber;
        const bool fits = field.cpp_type() == FieldDescriptor::CPPTYPE_DOUBLE
                              ? std::isfinite(node.number)
                              : std::abs(node.number) <= std::numeric_limits<float>::max();
        if (!number || !fits) Expected(path, "a finite number", node);
        return;
      }
      case FieldDescriptor::CPPTYPE_INT32:
        return CheckInteger(node, path, uint64_t{1} << 31, (uint64_t{1} << 31) - 1);
      case FieldDescriptor::CPPTYPE_INT64:
        return CheckInteger(node, path, uint64_t{1} << 63, (uint64_t{1} << 63) - 1);
      case FieldDescriptor::CPPTYPE_UINT32:
        return CheckInteger(node, path, 0, (uint64_t{1} << 32) - 1);
      case FieldDescriptor::CPPTYPE_UINT64:
        return CheckInteger(node, path, 0, std::numeric_limits<uint64_t>::max());
    }
  }

  void CheckInteger(const JsonNode& node, const std::string& path, uint64_t max_negative,
                    uint64_t max_positive) {
    const std::string range = absl::StrCat("an integer in [", max_negative > 0 ? "-" : "",
                                           max_negative, ", ", max_positive, "]");
    if (node.type == JsonNode::Type::kNumber) {
      // 512.0 is an integer too; beyond 2^53 a number with a point no longer says which.
      const bool integral =
          std::trunc(node.number) == node.number && std::abs(node.number) <= 9007199254740992.0;
      if (!integral || (node.number < 0 && -node.number > static_cast<double>(max_negative)) ||
          (node.number > 0 && node.number > static_cast<double>(max_positive))) {
        Expected(path, range, node);
      }
      return;
    }
    if (node.type != JsonNode::Type::kInteger ||
        node.magnitude > (node.negative ? max_negative : max_positive)) {
      Expected(path, range, node);
    }
  }

  void CheckEnum(const JsonNode& node, const EnumDescriptor& type, const std::string& path) {
    std::vector<std::string> known;
    for (int i = 0; i < type.value_count(); ++i) known.push_back(type.value(i)->name());
    if (node.type != JsonNode::Type::kString) {
      return Expected(path, absl::StrCat("one of ", absl::StrJoin(known, ", ")), node);
    }
    if (type.FindValueByName(node.text) != nullptr) return;
    Error(path, absl::StrCat("unknown value ", Describe(node), "; the nearest known name is \"",
                             NearestName(node.text, known),
                             "\" (known: ", absl::StrJoin(known, ", "), ")"));
  }

  std::string file_;
  ErrorList errors_;
};

template <typename Number>
std::string ShortestText(Number value) {
  if (std::isnan(value)) return "NaN";
  if (std::isinf(value)) return value > 0 ? "Infinity" : "-Infinity";
  if (value == 0) return std::signbit(value) ? "-0.0" : "0";
  const double magnitude = std::abs(static_cast<double>(value));
  const auto format = magnitude >= 1e-5 && magnitude < 1e15 ? std::chars_format::fixed
                                                            : std::chars_format::scientific;
  char buffer[64];
  const auto end = std::to_chars(buffer, buffer + sizeof(buffer), value, format).ptr;
  return std::string(buffer, end);
}

// JSON has no NaN or infinity; the strings are proto3 JSON's and are refused when read back.
template <typename Number>
std::string JsonNumber(Number value) {
  const std::string text = ShortestText(value);
  return std::isfinite(value) ? text : absl::StrCat("\"", text, "\"");
}

std::string StringText(const std::string& value) {
  return nlohmann::json(value).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

void AppendMessage(const Message& message, int indent, std::string* out);

// `index` < 0: the field is not repeated.
void AppendValue(const Message& message, const FieldDescriptor& field, int index, int indent,
                 std::string* out) {
  const Reflection& reflection = *message.GetReflection();
  const bool repeated = index >= 0;
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_MESSAGE:
      AppendMessage(repeated ? reflection.GetRepeatedMessage(message, &field, index)
                             : reflection.GetMessage(message, &field),
                    indent, out);
      return;
    case FieldDescriptor::CPPTYPE_ENUM: {
      const int value = repeated ? reflection.GetRepeatedEnumValue(message, &field, index)
                                 : reflection.GetEnumValue(message, &field);
      const auto* name = field.enum_type()->FindValueByNumber(value);
      absl::StrAppend(
          out, name != nullptr ? absl::StrCat("\"", name->name(), "\"") : absl::StrCat(value));
      return;
    }
    case FieldDescriptor::CPPTYPE_STRING: {
      const std::string value = repeated ? reflection.GetRepeatedString(message, &field, index)
                                         : reflection.GetString(message, &field);
      out->append(field.type() == FieldDescriptor::TYPE_BYTES
                      ? absl::StrCat("\"", absl::Base64Escape(value), "\"")
                      : StringText(value));
      return;
    }
    case FieldDescriptor::CPPTYPE_BOOL:
      out->append((repeated ? reflection.GetRepeatedBool(message, &field, index)
                            : reflection.GetBool(message, &field))
                      ? "true"
                      : "false");
      return;
    case FieldDescriptor::CPPTYPE_FLOAT:
      out->append(JsonNumber(repeated ? reflection.GetRepeatedFloat(message, &field, index)
                                      : reflection.GetFloat(message, &field)));
      return;
    case FieldDescriptor::CPPTYPE_DOUBLE:
      out->append(JsonNumber(repeated ? reflection.GetRepeatedDouble(message, &field, index)
                                      : reflection.GetDouble(message, &field)));
      return;
    case FieldDescriptor::CPPTYPE_INT32:
      absl::StrAppend(out, repeated ? reflection.GetRepeatedInt32(message, &field, index)
                                    : reflection.GetInt32(message, &field));
      return;
    case FieldDescriptor::CPPTYPE_INT64:
      absl::StrAppend(out, repeated ? reflection.GetRepeatedInt64(message, &field, index)
                                    : reflection.GetInt64(message, &field));
      return;
    case FieldDescriptor::CPPTYPE_UINT32:
      absl::StrAppend(out, repeated ? reflection.GetRepeatedUInt32(message, &field, index)
                                    : reflection.GetUInt32(message, &field));
      return;
    case FieldDescriptor::CPPTYPE_UINT64:
      absl::StrAppend(out, repeated ? reflection.GetRepeatedUInt64(message, &field, index)
                                    : reflection.GetUInt64(message, &field));
      return;
  }
}

// Ordered by key: the same message gives the same bytes.
void AppendMap(const Message& message, const FieldDescriptor& field, int indent, std::string* out) {
  const Reflection& reflection = *message.GetReflection();
  const FieldDescriptor& key = *field.message_type()->map_key();
  const FieldDescriptor& value = *field.message_type()->map_value();
  std::map<std::string, const Message*> entries;
  for (int i = 0; i < reflection.FieldSize(message, &field); ++i) {
    const Message& entry = reflection.GetRepeatedMessage(message, &field, i);
    entries[entry.GetReflection()->GetString(entry, &key)] = &entry;
  }
  const std::string margin(static_cast<size_t>(indent) + 2, ' ');
  out->append("{");
  for (auto entry = entries.begin(); entry != entries.end(); ++entry) {
    absl::StrAppend(out, entry == entries.begin() ? "\n" : ",\n", margin, StringText(entry->first),
                    ": ");
    AppendValue(*entry->second, value, -1, indent + 2, out);
  }
  absl::StrAppend(out, "\n", std::string(static_cast<size_t>(indent), ' '), "}");
}

void AppendMessage(const Message& message, int indent, std::string* out) {
  std::vector<const FieldDescriptor*> fields;
  message.GetReflection()->ListFields(message, &fields);  // in order of field numbers
  if (fields.empty()) {
    out->append("{}");
    return;
  }
  const std::string margin(static_cast<size_t>(indent) + 2, ' ');
  out->append("{");
  for (size_t i = 0; i < fields.size(); ++i) {
    const FieldDescriptor& field = *fields[i];
    absl::StrAppend(out, i == 0 ? "\n" : ",\n", margin, "\"", field.name(), "\": ");
    if (!field.is_repeated()) {
      AppendValue(message, field, -1, indent + 2, out);
      continue;
    }
    if (field.is_map()) {
      AppendMap(message, field, indent + 2, out);
      continue;
    }
    // Numbers on one line, messages one below the other.
    const bool one_line = field.cpp_type() != FieldDescriptor::CPPTYPE_MESSAGE;
    out->append("[");
    const int count = message.GetReflection()->FieldSize(message, &field);
    for (int k = 0; k < count; ++k) {
      if (one_line) {
        out->append(k == 0 ? "" : ", ");
      } else {
        absl::StrAppend(out, k == 0 ? "\n" : ",\n", margin, "  ");
      }
      AppendValue(message, field, k, indent + 4, out);
    }
    if (!one_line) absl::StrAppend(out, "\n", margin);
    out->append("]");
  }
  absl::StrAppend(out, "\n", std::string(static_cast<size_t>(indent), ' '), "}");
}

}  // namespace

absl::Status ParseStrictJson(const std::string& given, const std::string& file, Message* message) {
  const std::string json = BlankLineComments(given);
  TreeBuilder builder;
  if (!nlohmann::json::sax_parse(json, &builder)) {
    if (builder.error_byte == std::numeric_limits<size_t>::max()) {
      return absl::InvalidArgumentError(absl::StrCat(file, ": ", builder.error));
    }
    const TextPosition position = PositionOf(json, builder.error_byte);
    return absl::InvalidArgumentError(absl::StrCat(file, ": line ", position.line, ", column ",
                                                   position.column, ": ", builder.error));
  }
  if (absl::Status status = Walker(file).Check(builder.root, *message->GetDescriptor());
      !status.ok()) {
    return status;
  }
  message->Clear();
  const auto status = google::protobuf::util::JsonStringToMessage(json, message);
  if (!status.ok()) {
    return absl::InvalidArgumentError(absl::StrCat(file, ": ", status.message().ToString()));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::string> ReadJsonText(const std::string& path) {
  return ReadRegularFile(path, kMaxFileBytes);
}

absl::Status ReadStrictJsonFile(const std::string& path, Message* message) {
  const absl::StatusOr<std::string> text = ReadJsonText(path);
  if (!text.ok()) return text.status();
  return ParseStrictJson(*text, path, message);
}

std::string NumberText(double value) { return ShortestText(value); }

std::string ToJson(const Message& message) {
  std::string out;
  AppendMessage(message, 0, &out);
  out += '\n';
  return out;
}

absl::Status WriteFileAtomically(const std::string& path, const std::string& contents) {
  // The temporary file is beside the final one: rename() is atomic only within a file system.
  static std::atomic<int64_t> counter{0};
  const std::string temporary = absl::StrCat(path, ".", getpid(), ".", counter++, ".tmp");
  const auto failure = [&](const char* what) {
    const int error = errno;
    unlink(temporary.c_str());
    const std::string reason =
        absl::StrCat(path, ": cannot be written: ", what, ": ", std::strerror(error));
    switch (error) {
      case ENOENT:
      case ENOTDIR:
        return absl::NotFoundError(reason);
      case ENOSPC:
      case EDQUOT:
      case EFBIG:
        // Trying again changes nothing until somebody makes room.
        return absl::ResourceExhaustedError(reason);
      default:
        return absl::UnavailableError(reason);
    }
  };
  const int descriptor = open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (descriptor < 0) return failure("open");
  size_t written = 0;
  while (written < contents.size()) {
    const ssize_t count = write(descriptor, contents.data() + written, contents.size() - written);
    if (count < 0) {
      if (errno == EINTR) continue;
      const int error = errno;
      close(descriptor);
      errno = error;
      return failure("write");
    }
    written += static_cast<size_t>(count);
  }
  // Without this a crash of the machine could leave the new name with empty contents.
  if (fsync(descriptor) != 0 && errno != EINVAL) {
    const int error = errno;
    close(descriptor);
    errno = error;
    return failure("fsync");
  }
  if (close(descriptor) != 0) return failure("close");
  if (rename(temporary.c_str(), path.c_str()) != 0) return failure("rename");
  return absl::OkStatus();
}

}  // namespace sightline
