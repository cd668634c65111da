// SPDX-License-Identifier: Apache-2.0
#include "core/json/strict_json.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/string_view.h"
#include "core/file/read_file.h"
#include "core/json/error_list.h"
#include "core/json/finite_numbers.h"
#include "core/json/json_text.h"
#include "core/json/line_comments.h"
#include "core/spelling/nearest_name.h"
#include "core/status/status_macros.h"
#include "core/text/number_text.h"
#include "core/text/printable.h"
#include "core/text/text_encoding.h"

namespace sightline {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::EnumDescriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;

// protobuf's own JSON parser stops at 100 levels; far more than any of our files needs.
constexpr size_t kMaxDepth = 64;
// This bounds the time, as MostMessageBytes does the memory.
constexpr size_t kMaxJsonValues = 2'000'000;
// Limits on the cost of reading a file: the largest of ours, 10 000 recordings, has 10 MB.
constexpr uint64_t kMaxFileBytes = uint64_t{64} << 20;
// Messages of files with few values may be larger than ten times the text.
constexpr size_t kFreeMessageBytes = size_t{256} << 10;
// No message of ours takes as much beyond its text.
constexpr size_t kMostBytesBeyondText = size_t{64} << 20;
// Overhead of an allocation: the header of malloc and the space lost to its steps of 16 bytes.
constexpr size_t kAllocationBytes = 16;
// Table of a map with its first entries.
constexpr size_t kTableBytes = 64;

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

std::string Shown(absl::string_view text) {
  return absl::StrCat("\"", absl::CEscape(text.substr(0, 60)), text.size() > 60 ? "..." : "", "\"");
}

// A value of the text; for arrays and objects only the kind.
struct JsonValue {
  enum class Type { kNull, kBool, kInteger, kNumber, kString, kArray, kObject };
  Type type = Type::kNull;
  absl::string_view text{};  // of kString, and of kNumber as written
  double number = 0;         // of kInteger and kNumber
  bool flag = false;         // of kBool
  bool negative = false;     // of kInteger
  uint64_t magnitude = 0;    // of kInteger

  bool IsNumber() const { return type == Type::kInteger || type == Type::kNumber; }
};

std::string Describe(const JsonValue& value) {
  switch (value.type) {
    case JsonValue::Type::kNull:
      return "null";
    case JsonValue::Type::kBool:
      return value.flag ? "true" : "false";
    case JsonValue::Type::kInteger:
      return absl::StrCat(value.negative ? "-" : "", value.magnitude);
    case JsonValue::Type::kNumber:
      return std::string(value.text);
    case JsonValue::Type::kString:
      return Shown(value.text);
    case JsonValue::Type::kArray:
      return "an array";
    case JsonValue::Type::kObject:
      return "an object";
  }
  return "";
}

std::vector<std::string> NamesOf(const Descriptor& type) {
  std::vector<std::string> names;
  for (int i = 0; i < type.field_count(); ++i) names.push_back(type.field(i)->name());
  return names;
}

std::vector<std::string> NamesOf(const EnumDescriptor& type) {
  std::vector<std::string> names;
  for (int i = 0; i < type.value_count(); ++i) names.push_back(type.value(i)->name());
  return names;
}

// Advice for a number or an array where an object must stand. Messages for the values of a number
// have `fixed` for a single one and `values` for several.
std::string ObjectInstead(const JsonValue& value, const Descriptor& type) {
  const FieldDescriptor* fixed = type.FindFieldByName("fixed");
  if (fixed == nullptr || fixed->cpp_type() != FieldDescriptor::CPPTYPE_DOUBLE) return "";
  if (value.IsNumber()) return absl::StrCat(": write {\"fixed\": ", Describe(value), "}");
  if (value.type == JsonValue::Type::kArray && type.FindFieldByName("values") != nullptr) {
    return ": write {\"values\": [...]}, or {\"ranges\": [{\"min\": ..., \"max\": ...}]}";
  }
  return "";
}

// The integer that a value stands for, from -`max_negative` to `max_positive`. 512.0 is an integer
// too; beyond 2^53 a number with a point no longer says which.
template <typename Integer>
std::optional<Integer> IntegerOf(const JsonValue& value, uint64_t max_negative,
                                 uint64_t max_positive) {
  if (value.type == JsonValue::Type::kInteger) {
    if (value.magnitude > (value.negative ? max_negative : max_positive)) return std::nullopt;
    return static_cast<Integer>(value.negative ? 0 - value.magnitude : value.magnitude);
  }
  if (value.type != JsonValue::Type::kNumber) return std::nullopt;
  const double number = value.number;
  if (std::trunc(number) != number || std::abs(number) >= 9007199254740992.0) return std::nullopt;
  if (number < 0 ? -number > static_cast<double>(max_negative)
                 : number > static_cast<double>(max_positive)) {
    return std::nullopt;
  }
  return static_cast<Integer>(number);
}

// Fills a message from the parser's events without an intermediate tree, so that only the text and
// the message take memory. Continues after a wrong field, so that all errors are reported together;
// the message is then not valid.
class MessageReader : public nlohmann::json_sax<nlohmann::json> {
 public:
  MessageReader(std::string file, size_t most_bytes, Message* root)
      : file_(std::move(file)), most_bytes_(most_bytes), root_(root) {}

  // Reason why the text was not read to its end: its syntax, or a limit.
  const std::string& error() const { return error_; }
  // Place of an error of the syntax.
  std::optional<size_t> error_byte() const { return error_byte_; }
  // Errors of the fields.
  absl::Status FieldErrors() const { return errors_.Status(); }

  bool null() override { return Add({}); }
  bool boolean(bool value) override { return Add({.type = JsonValue::Type::kBool, .flag = value}); }
  bool number_integer(number_integer_t value) override {
    const bool negative = value < 0;
    const auto bits = static_cast<uint64_t>(value);
    return Add({.type = JsonValue::Type::kInteger,
                .number = static_cast<double>(value),
                .negative = negative,
                .magnitude = negative ? 0 - bits : bits});
  }
  bool number_unsigned(number_unsigned_t value) override {
    return Add({.type = JsonValue::Type::kInteger,
                .number = static_cast<double>(value),
                .magnitude = value});
  }
  bool number_float(number_float_t value, const string_t& text) override {
    return Add({.type = JsonValue::Type::kNumber, .text = text, .number = value});
  }
  bool string(string_t& value) override {
    return Add({.type = JsonValue::Type::kString, .text = value});
  }
  bool binary(binary_t&) override { return false; }  // not in JSON text
  bool start_object(size_t) override { return Open(JsonValue::Type::kObject); }
  bool start_array(size_t) override { return Open(JsonValue::Type::kArray); }
  bool end_object() override {
    const bool is_map = levels_.back().kind == Level::Kind::kMap;
    const size_t count = levels_.back().count;
    if (is_map) levels_.back().message->MergeFromString(levels_.back().entries);
    levels_.pop_back();
    if (is_map && count > kMaxEntries) {
      Error(absl::StrCat("has ", count, " entries, must have at most ", kMaxEntries));
    }
    return EndValue();
  }
  bool end_array() override {
    levels_.pop_back();
    return EndValue();
  }
  bool key(string_t& name) override {
    Level& level = levels_.back();
    // A level that is passed over may have keys as long as the text.
    if (level.kind == Level::Kind::kPassedOver) return true;
    level.key = name;
    if (level.kind == Level::Kind::kMessage) EnterField();
    if (level.kind == Level::Kind::kMap) EnterEntry();
    return true;
  }
  bool parse_error(size_t byte, const std::string&, const nlohmann::detail::exception& e) override {
    error_byte_ = byte > 0 ? byte - 1 : 0;
    error_ = e.what();
    // "[json.exception.parse_error.101] parse error at line 1, column 5: reason": keep the reason.
    const size_t bracket = error_.find("] ");
    if (bracket != std::string::npos) error_ = error_.substr(bracket + 2);
    const size_t column = error_.find("column ");
    const size_t reason = column == std::string::npos ? column : error_.find(": ", column);
    if (reason != std::string::npos) error_ = error_.substr(reason + 2);
    // It quotes the last text read, which may be a string of megabytes.
    constexpr size_t kMostReasonBytes = 400;
    if (error_.size() > kMostReasonBytes) error_ = error_.substr(0, kMostReasonBytes) + "...";
    return false;
  }

 private:
  // An open array or object.
  struct Level {
    enum class Kind { kMessage, kArray, kMap, kPassedOver };
    Kind kind = Kind::kPassedOver;
    Message* message = nullptr;              // itself, or the one that has the array or map
    const FieldDescriptor* field = nullptr;  // of the last key (null: passed over), array or map
    size_t count = 0;                        // elements before this one, or entries
    std::string key;                         // the last one
    std::vector<bool> seen;                  // of a message: fields by their index
    std::set<std::string> keys;              // of a map
    std::string entries;                     // of a map: on the wire
    std::unique_ptr<Message> entry;          // of a map: the one at hand
  };

  bool Stop(std::string reason) {
    error_ = std::move(reason);
    return false;
  }

  // Accounts for memory that the message takes.
  void Take(size_t bytes) { used_bytes_ += bytes; }

  bool Count() {
    if (++values_ > kMaxJsonValues) {
      return Stop(absl::StrCat("has more than ", kMaxJsonValues, " values"));
    }
    if (used_bytes_ > most_bytes_) {
      return Stop(absl::StrCat("its values would take more than ", most_bytes_,
                               " bytes of memory, the limit for a text of its size"));
    }
    return true;
  }

  // Path of the value at hand: "rig.camera_bodies[2].box".
  std::string Path() const {
    std::string path;
    for (const Level& level : levels_) {
      if (level.kind == Level::Kind::kArray) {
        absl::StrAppend(&path, "[", level.count, "]");
      } else {
        absl::StrAppend(&path, path.empty() ? "" : ".", level.key);
      }
    }
    constexpr size_t kMostPathBytes = 200;
    return path.size() <= kMostPathBytes ? path : path.substr(0, kMostPathBytes) + "...";
  }

  // True if the search for errors should end. Equal errors count too.
  bool IsFull() const {
    constexpr size_t kMostFound = 1000;
    return errors_.full() || errors_found_ >= kMostFound;
  }
  void Error(const std::string& reason) {
    ++errors_found_;
    const std::string path = Path();
    errors_.Add(absl::InvalidArgumentError(absl::StrCat(
        file_, ": ", path.empty() ? "" : absl::StrCat(Printable(path), ": "), reason)));
  }
  void Expected(const std::string& what, const JsonValue& value) {
    if (value.type == JsonValue::Type::kNull) {
      return Error(
          absl::StrCat("is null, must be ", what, "; leave the field out to get its default"));
    }
    Error(absl::StrCat("is ", Describe(value), ", must be ", what));
  }
  void ExpectedObject(const Descriptor& type, const JsonValue& value) {
    Expected(absl::StrCat("an object", ObjectInstead(value, type)), value);
  }

  // A key of a message: the field that the next value belongs to.
  void EnterField() {
    Level& level = levels_.back();
    level.field = nullptr;
    if (IsFull()) return;
    const Descriptor& type = *level.message->GetDescriptor();
    const FieldDescriptor* field = type.FindFieldByName(level.key);
    if (field == nullptr) {
      return Error(absl::StrCat("unknown field",
                                type.field_count() == 0
                                    ? ""
                                    : absl::StrCat("; the nearest known name is \"",
                                                   NearestName(level.key, NamesOf(type)), "\"")));
    }
    const auto index = static_cast<size_t>(field->index());
    if (level.seen[index]) return Error("given twice");
    if (const auto* oneof = field->real_containing_oneof()) {
      for (int i = 0; i < oneof->field_count(); ++i) {
        if (!level.seen[static_cast<size_t>(oneof->field(i)->index())]) continue;
        Error(absl::StrCat("cannot be given together with ", oneof->field(i)->name()));
      }
    }
    level.seen[index] = true;
    level.field = field;
  }

  // protobuf takes seconds for many keys that were made to have the same hash. Effects, the only
  // messages with maps, have at most five parameters.
  static constexpr size_t kMaxEntries = 100;

  // A key of a map: the entry that the next value belongs to. Keys are strings; that is all our
  // messages need.
  void EnterEntry() {
    Level& level = levels_.back();
    level.entry.reset();
    if (++level.count > kMaxEntries || IsFull()) return;
    if (!level.keys.insert(level.key).second) return Error("given twice");
    const Descriptor& type = *level.field->message_type();
    level.entry.reset(
        level.message->GetReflection()->GetMessageFactory()->GetPrototype(&type)->New());
    level.entry->GetReflection()->SetString(level.entry.get(), type.map_key(), level.key);
  }

  // The entry, once it has its value. Parsing puts it into the map itself; what reflection adds
  // stands in a list beside the map as well.
  void KeepEntry() {
    Level& level = levels_.back();
    google::protobuf::io::StringOutputStream stream(&level.entries);
    google::protobuf::io::CodedOutputStream out(&stream);
    out.WriteTag(static_cast<uint32_t>(level.field->number()) << 3 | 2);  // length-delimited
    const std::string bytes = level.entry->SerializeAsString();
    out.WriteVarint32(static_cast<uint32_t>(bytes.size()));
    out.WriteString(bytes);
    // A node with key, value and link, its place in the table, and a long key.
    Take(BytesOf(level.key) + 32);
    level.entry.reset();
  }

  // The next value of an array has the next index; the entry of a map is complete.
  bool EndValue() {
    if (levels_.empty()) return true;
    Level& level = levels_.back();
    if (level.kind == Level::Kind::kArray) ++level.count;
    if (level.kind == Level::Kind::kMap && level.entry != nullptr) KeepEntry();
    return true;
  }

  // Destination of the present value: a message and its field, which may be repeated.
  struct Place {
    Message* message = nullptr;  // null: it is passed over
    const FieldDescriptor* field = nullptr;
    bool is_element = false;  // of an array
  };
  Place PlaceOfValue() {
    Level& level = levels_.back();
    if (IsFull()) return {};
    switch (level.kind) {
      case Level::Kind::kMessage:
        return {level.field == nullptr ? nullptr : level.message, level.field, false};
      case Level::Kind::kArray:
        return {level.message, level.field, true};
      case Level::Kind::kMap:
        return {level.entry.get(), level.field->message_type()->map_value(), false};
      case Level::Kind::kPassedOver:
        break;
    }
    return {};
  }

  // A value that is no array and no object.
  bool Add(const JsonValue& value) {
    if (!Count()) return false;
    if (levels_.empty()) {
      ExpectedObject(*root_->GetDescriptor(), value);
      return true;
    }
    if (const Place place = PlaceOfValue(); place.message != nullptr) {
      if (place.field->is_repeated() && !place.is_element) {
        Expected(place.field->is_map() ? "an object" : "an array", value);
      } else {
        SetValue(place, value);
      }
    }
    return EndValue();
  }

  bool Open(JsonValue::Type type) {
    if (levels_.size() >= kMaxDepth) {
      return Stop(absl::StrCat("nested deeper than ", kMaxDepth, " levels"));
    }
    if (!Count()) return false;
    Level level;
    if (levels_.empty()) {
      if (type == JsonValue::Type::kObject) {
        level = LevelOf(root_);
      } else {
        ExpectedObject(*root_->GetDescriptor(), {.type = type});
      }
    } else if (const Place place = PlaceOfValue(); place.message != nullptr) {
      level = LevelIn(place, {.type = type});
    }
    levels_.push_back(std::move(level));
    return true;
  }

  static Level LevelOf(Message* message) {
    Level level;
    level.kind = Level::Kind::kMessage;
    level.message = message;
    level.seen.resize(static_cast<size_t>(message->GetDescriptor()->field_count()));
    return level;
  }

  // Level of an array or object at this place. It is passed over if the field does not take it.
  Level LevelIn(const Place& place, const JsonValue& value) {
    Level level;
    const FieldDescriptor& field = *place.field;
    const bool is_object = value.type == JsonValue::Type::kObject;
    if (field.is_repeated() && !place.is_element) {
      if (is_object != field.is_map()) {
        Expected(field.is_map() ? "an object" : "an array", value);
        return level;
      }
      level.kind = is_object ? Level::Kind::kMap : Level::Kind::kArray;
      if (is_object) Take(kTableBytes);
      level.message = place.message;
      level.field = &field;
      return level;
    }
    if (field.cpp_type() != FieldDescriptor::CPPTYPE_MESSAGE || !is_object) {
      SetValue(place, value);
      return level;
    }
    const Reflection& reflection = *place.message->GetReflection();
    Message* const added = place.is_element ? reflection.AddMessage(place.message, &field)
                                            : reflection.MutableMessage(place.message, &field);
    Take(BytesOf(*added));
    return LevelOf(added);
  }

  // Memory of a text, which has an allocation of its own once it is long.
  static size_t BytesOf(const std::string& text) {
    constexpr size_t kShort = 15;
    return sizeof(std::string) + kAllocationBytes +
           (text.size() > kShort ? text.capacity() + kAllocationBytes : 0);
  }

  // Memory of an empty message and of the pointers to it.
  size_t BytesOf(const Message& message) {
    const auto [known, is_new] = bytes_of_.try_emplace(message.GetDescriptor());
    if (is_new) known->second = message.SpaceUsedLong() + 2 * sizeof(void*) + kAllocationBytes;
    return known->second;
  }

  // Arrays grow by doubling.
  template <typename Value>
  void TakeNumber(const Place& place) {
    if (place.is_element) Take(2 * sizeof(Value));
  }

  template <typename Integer>
  std::optional<Integer> TakeInteger(const Place& place, const JsonValue& value) {
    constexpr auto kMost = static_cast<uint64_t>(std::numeric_limits<Integer>::max());
    constexpr uint64_t kMostNegative = std::is_signed_v<Integer> ? kMost + 1 : 0;
    const std::optional<Integer> integer = IntegerOf<Integer>(value, kMostNegative, kMost);
    if (!integer) {
      Expected(absl::StrCat("an integer in [", kMostNegative > 0 ? "-" : "", kMostNegative, ", ",
                            kMost, "]"),
               value);
    }
    TakeNumber<Integer>(place);
    return integer;
  }

  // Sets the field, or adds to it, if the value is valid for the field.
  void SetValue(const Place& place, const JsonValue& value) {
    Message* const message = place.message;
    const FieldDescriptor* const field = place.field;
    const Reflection& reflection = *message->GetReflection();
    const bool add = place.is_element;
    switch (field->cpp_type()) {
      case FieldDescriptor::CPPTYPE_MESSAGE:
        return ExpectedObject(*field->message_type(), value);
      case FieldDescriptor::CPPTYPE_ENUM:
        return SetEnum(place, value);
      case FieldDescriptor::CPPTYPE_STRING:
        return SetText(place, value);
      case FieldDescriptor::CPPTYPE_BOOL:
        if (value.type != JsonValue::Type::kBool) return Expected("true or false", value);
        TakeNumber<bool>(place);
        return add ? reflection.AddBool(message, field, value.flag)
                   : reflection.SetBool(message, field, value.flag);
      // proto3 JSON would also take "NaN", "Infinity" and numbers in quotes.
      case FieldDescriptor::CPPTYPE_FLOAT: {
        if (!value.IsNumber() || std::abs(value.number) > std::numeric_limits<float>::max()) {
          return Expected("a finite number", value);
        }
        TakeNumber<float>(place);
        const auto number = static_cast<float>(value.number);
        return add ? reflection.AddFloat(message, field, number)
                   : reflection.SetFloat(message, field, number);
      }
      case FieldDescriptor::CPPTYPE_DOUBLE: {
        const bool infinite = value.type == JsonValue::Type::kString && value.text == "Infinity" &&
                              MayBeInfinite(*field);
        if (!infinite && (!value.IsNumber() || !std::isfinite(value.number))) {
          return Expected(MayBeInfinite(*field) ? "a number or \"Infinity\"" : "a finite number",
                          value);
        }
        const double number = infinite ? std::numeric_limits<double>::infinity() : value.number;
        TakeNumber<double>(place);
        return add ? reflection.AddDouble(message, field, number)
                   : reflection.SetDouble(message, field, number);
      }
      case FieldDescriptor::CPPTYPE_INT32:
        if (const auto integer = TakeInteger<int32_t>(place, value)) {
          return add ? reflection.AddInt32(message, field, *integer)
                     : reflection.SetInt32(message, field, *integer);
        }
        return;
      case FieldDescriptor::CPPTYPE_INT64:
        if (const auto integer = TakeInteger<int64_t>(place, value)) {
          return add ? reflection.AddInt64(message, field, *integer)
                     : reflection.SetInt64(message, field, *integer);
        }
        return;
      case FieldDescriptor::CPPTYPE_UINT32:
        if (const auto integer = TakeInteger<uint32_t>(place, value)) {
          return add ? reflection.AddUInt32(message, field, *integer)
                     : reflection.SetUInt32(message, field, *integer);
        }
        return;
      case FieldDescriptor::CPPTYPE_UINT64:
        if (const auto integer = TakeInteger<uint64_t>(place, value)) {
          return add ? reflection.AddUInt64(message, field, *integer)
                     : reflection.SetUInt64(message, field, *integer);
        }
        return;
    }
  }

  void SetText(const Place& place, const JsonValue& value) {
    if (value.type != JsonValue::Type::kString) return Expected("a string", value);
    std::string text;
    if (place.field->type() != FieldDescriptor::TYPE_BYTES) {
      text = std::string(value.text);
    } else if (!absl::Base64Unescape(value.text, &text) &&
               !absl::WebSafeBase64Unescape(value.text, &text)) {
      return Expected("bytes in Base64", value);
    }
    Take(BytesOf(text) + (place.is_element ? 2 * sizeof(void*) : 0));
    const Reflection& reflection = *place.message->GetReflection();
    place.is_element ? reflection.AddString(place.message, place.field, std::move(text))
                     : reflection.SetString(place.message, place.field, std::move(text));
  }

  void SetEnum(const Place& place, const JsonValue& value) {
    const EnumDescriptor& type = *place.field->enum_type();
    if (value.type != JsonValue::Type::kString) {
      return Expected(absl::StrCat("one of ", absl::StrJoin(NamesOf(type), ", ")), value);
    }
    const std::string name(value.text);
    const auto* found = type.FindValueByName(name);
    if (found == nullptr) {
      const std::vector<std::string> known = NamesOf(type);
      return Error(absl::StrCat("unknown value ", Describe(value), "; the nearest known name is \"",
                                NearestName(name, known), "\" (known: ", absl::StrJoin(known, ", "),
                                ")"));
    }
    TakeNumber<int>(place);
    const Reflection& reflection = *place.message->GetReflection();
    place.is_element ? reflection.AddEnum(place.message, place.field, found)
                     : reflection.SetEnum(place.message, place.field, found);
  }

  const std::string file_;
  const size_t most_bytes_;
  Message* const root_;
  std::string error_;
  std::optional<size_t> error_byte_;
  ErrorList errors_;
  size_t errors_found_ = 0;
  std::vector<Level> levels_;
  size_t values_ = 0;
  size_t used_bytes_ = 0;
  std::map<const Descriptor*, size_t> bytes_of_;
};

// JSON has no NaN or infinity; the strings are proto3 JSON's and are refused when read back, except
// where infinity has a meaning (MayBeInfinite).
std::string JsonNumber(double value) {
  const std::string text = NumberText(value);
  return std::isfinite(value) ? text : absl::StrCat("\"", text, "\"");
}

std::string JsonNumber(float value) {
  const std::string text = FloatText(value);
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

size_t MostMessageBytes(size_t text_bytes) {
  return std::min(kMessageBytesPerTextByte * text_bytes + kFreeMessageBytes,
                  text_bytes + kMostBytesBeyondText);
}

absl::Status ParseStrictJson(std::string json, const std::string& file, Message* message) {
  const absl::StatusOr<std::string_view> marked = WithoutByteOrderMark(json);
  if (!marked.ok())
    return absl::InvalidArgumentError(absl::StrCat(file, ": ", marked.status().message()));
  const std::string_view text = WithoutEndMarks(*marked);
  const auto begin = static_cast<size_t>(text.data() - json.data());
  json.resize(begin + text.size());
  json.erase(0, begin);
  json = BlankLineComments(std::move(json));
  const auto failure = [&](size_t byte, const std::string& reason) {
    const TextPosition position = PositionOf(json, byte);
    return absl::InvalidArgumentError(
        absl::StrCat(file, ": line ", position.line, ", column ", position.column, ": ", reason));
  };
  // The parser takes NUL for the end of the text.
  if (const size_t nul = json.find('\0'); nul != std::string::npos) {
    return failure(nul, "NUL byte in the text");
  }
  const std::unique_ptr<Message> read(message->New());
  MessageReader reader(file, MostMessageBytes(json.size()), read.get());
  if (!nlohmann::json::sax_parse(json, &reader)) {
    if (reader.error_byte()) return failure(*reader.error_byte(), reader.error());
    return absl::InvalidArgumentError(absl::StrCat(file, ": ", reader.error()));
  }
  SIGHTLINE_RETURN_IF_ERROR(reader.FieldErrors());
  message->GetReflection()->Swap(message, read.get());
  return absl::OkStatus();
}

absl::StatusOr<std::string> ReadJsonText(const std::string& path) {
  return ReadRegularFile(path, kMaxFileBytes);
}

absl::Status ReadStrictJsonFile(const std::string& path, Message* message) {
  SIGHTLINE_ASSIGN_OR_RETURN(std::string text, ReadJsonText(path));
  return ParseStrictJson(std::move(text), path, message);
}

std::string ToJson(const Message& message) {
  std::string out;
  AppendMessage(message, 0, &out);
  out += '\n';
  return out;
}

}  // namespace sightline
