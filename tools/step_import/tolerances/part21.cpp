// SPDX-License-Identifier: Apache-2.0
#include "tools/step_import/tolerances/part21.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <fstream>
#include <optional>
#include <utility>

#include "tools/step_import/step_input_error.h"

namespace sightline {
namespace {

constexpr std::streamoff kMaxBytes = std::streamoff{1} << 31;
// Aggregates and typed values inside one another; schemas nest a handful.
constexpr int kMaxDepth = 64;
// Values of one instance, which take 80 bytes each once they are parsed, whatever they say. A set
// of all faces of a part has some ten thousand.
constexpr size_t kMaxValues = 1'000'000;
// Types of one instance and characters of a type, which are looked at wherever the instance is
// referred to; those of the standard have less than ten and less than 80.
constexpr size_t kMaxTypes = 100;
constexpr size_t kMaxTypeCharacters = 200;

bool IsWordStart(char c) { return std::isupper(static_cast<unsigned char>(c)) || c == '_'; }
bool IsWord(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '-' || c == '!';
}

// Past white space and comments.
size_t SkipSpace(std::string_view text, size_t at) {
  while (at < text.size()) {
    if (std::isspace(static_cast<unsigned char>(text[at]))) {
      ++at;
    } else if (text.substr(at, 2) == "/*") {
      const size_t end = text.find("*/", at + 2);
      at = end == std::string_view::npos ? text.size() : end + 2;
    } else {
      break;
    }
  }
  return at;
}

// Past a string that starts at `at` with its quote; doubled quotes inside belong to it.
size_t SkipQuoted(std::string_view text, size_t at) {
  const char quote = text[at];
  for (++at; at < text.size(); ++at) {
    if (text[at] != quote) continue;
    if (at + 1 < text.size() && text[at + 1] == quote) {
      ++at;
    } else {
      return at + 1;
    }
  }
  return at;
}

// The semicolon that ends the statement, or the end of the text.
size_t StatementEnd(std::string_view text, size_t at) {
  while (at < text.size() && text[at] != ';') {
    if (text[at] == '\'' || text[at] == '"') {
      at = SkipQuoted(text, at);
    } else if (text.substr(at, 2) == "/*") {
      at = SkipSpace(text, at);
    } else {
      ++at;
    }
  }
  return at;
}

void AppendUtf8(std::string& out, uint32_t code) {
  const auto byte = [&](uint32_t value) { out.push_back(static_cast<char>(value)); };
  if (code > 0x10ffff || (code >= 0xd800 && code < 0xe000)) code = 0xfffd;
  if (code < 0x80) {
    byte(code);
  } else if (code < 0x800) {
    byte(0xc0 | code >> 6), byte(0x80 | (code & 0x3f));
  } else if (code < 0x10000) {
    byte(0xe0 | code >> 12), byte(0x80 | (code >> 6 & 0x3f)), byte(0x80 | (code & 0x3f));
  } else {
    byte(0xf0 | code >> 18), byte(0x80 | (code >> 12 & 0x3f));
    byte(0x80 | (code >> 6 & 0x3f)), byte(0x80 | (code & 0x3f));
  }
}

std::optional<uint32_t> Hex(std::string_view digits) {
  uint32_t value = 0;
  const auto [end, error] =
      std::from_chars(digits.data(), digits.data() + digits.size(), value, 16);
  if (error != std::errc() || end != digits.data() + digits.size()) return std::nullopt;
  return value;
}

// Whether every byte >= 0x80 belongs to a multi-byte sequence of UTF-8.
bool IsUtf8(std::string_view text) {
  for (size_t i = 0; i < text.size();) {
    const auto c = static_cast<unsigned char>(text[i]);
    const size_t length = c < 0x80                ? 1
                          : c >= 0xc2 && c < 0xe0 ? 2
                          : c >= 0xe0 && c < 0xf0 ? 3
                          : c >= 0xf0 && c < 0xf5 ? 4
                                                  : 0;
    if (length == 0 || i + length > text.size()) return false;
    for (size_t k = 1; k < length; ++k) {
      if ((static_cast<unsigned char>(text[i + k]) & 0xc0) != 0x80) return false;
    }
    i += length;
  }
  return true;
}

// Strings of ISO 10303-21, 6.4.3: a doubled quote is one, \S\ announces a shifted character; \X\,
// \X2\ and \X4\ announce hexadecimal ones. What does not follow these rules is kept as it is.
std::string DecodeText(std::string_view raw) {
  std::string out;
  // Edition 3 writes UTF-8; older programs write bytes of ISO 8859-1 although they should not.
  const bool utf8 = IsUtf8(raw);
  for (size_t i = 0; i < raw.size();) {
    if (raw.substr(i, 2) == "''") {
      out.push_back('\'');
      i += 2;
    } else if (raw.substr(i, 2) == "\\\\") {
      out.push_back('\\');
      i += 2;
    } else if (raw.substr(i, 3) == "\\S\\" && i + 3 < raw.size()) {
      AppendUtf8(out, static_cast<unsigned char>(raw[i + 3]) + 128u);
      i += 4;
    } else if (raw.substr(i, 3) == "\\X\\" && Hex(raw.substr(i + 3, 2))) {
      AppendUtf8(out, *Hex(raw.substr(i + 3, 2)));
      i += 5;
    } else if (raw.substr(i, 4) == "\\X2\\" || raw.substr(i, 4) == "\\X4\\") {
      const size_t width = raw[i + 2] == '2' ? 4 : 8;
      size_t end = raw.find("\\X0\\", i);
      if (end == std::string_view::npos) end = raw.size();
      for (size_t k = i + 4; k + width <= end; k += width) {
        AppendUtf8(out, Hex(raw.substr(k, width)).value_or(0xfffd));
      }
      i = std::min(raw.size(), end + 4);
    } else {
      const auto byte = static_cast<unsigned char>(raw[i++]);
      if (utf8) {
        out.push_back(static_cast<char>(byte));
      } else {
        AppendUtf8(out, byte);
      }
    }
  }
  return out;
}

class Parser {
 public:
  Parser(std::string_view text, std::string where) : text_(text), where_(std::move(where)) {}

  std::vector<Part21Record> Records() {
    std::vector<Part21Record> records;
    Skip();
    if (Peek() == '(') {
      ++at_;
      for (Skip(); Peek() != ')'; Skip()) records.push_back(Record());
      ++at_;
    } else {
      records.push_back(Record());
    }
    Skip();
    if (at_ != text_.size()) Fail("has text after its end");
    return records;
  }

 private:
  [[noreturn]] void Fail(const std::string& why) const { throw StepInputError(where_ + " " + why); }
  void Skip() { at_ = SkipSpace(text_, at_); }
  char Peek() const { return at_ < text_.size() ? text_[at_] : '\0'; }

  Part21Record Record() {
    Part21Record record;
    record.type = Word();
    Skip();
    if (Peek() != '(') Fail("lacks a bracket after " + record.type);
    record.values = List(0);
    return record;
  }

  std::string Word() {
    const size_t begin = at_;
    while (at_ < text_.size() && IsWord(text_[at_])) ++at_;
    if (at_ == begin) Fail("is malformed");
    return std::string(text_.substr(begin, at_ - begin));
  }

  std::vector<Part21Value> List(int depth) {
    if (depth > kMaxDepth) Fail("nests too deeply");
    std::vector<Part21Value> values;
    ++at_;
    Skip();
    if (Peek() == ')') {
      ++at_;
      return values;
    }
    while (true) {
      if (++value_count_ > kMaxValues) {
        Fail("has more than " + std::to_string(kMaxValues) + " values");
      }
      values.push_back(Value(depth));
      Skip();
      const char c = Peek();
      ++at_;
      if (c == ')') return values;
      if (c != ',') Fail("lacks a comma or bracket");
      Skip();
    }
  }

  Part21Value Value(int depth) {
    using Kind = Part21Value::Kind;
    Part21Value value;
    Skip();
    const char c = Peek();
    if (c == '$' || c == '*') {
      value.kind = c == '$' ? Kind::kUnset : Kind::kDerived;
      ++at_;
    } else if (c == '#') {
      value.kind = Kind::kReference;
      ++at_;
      Number(value.reference);
    } else if (c == '\'' || c == '"') {
      value.kind = Kind::kText;
      const size_t end = SkipQuoted(text_, at_);
      if (end < at_ + 2) Fail("has a string without end");
      value.text = DecodeText(text_.substr(at_ + 1, end - at_ - 2));
      at_ = end;
    } else if (c == '.') {
      value.kind = Kind::kEnum;
      ++at_;
      value.text = Word();
      if (Peek() != '.') Fail("has an enumeration value without end");
      ++at_;
    } else if (c == '(') {
      value.kind = Kind::kList;
      value.list = List(depth + 1);
    } else if (IsWordStart(c)) {
      value.kind = Kind::kTyped;
      value.text = Word();
      Skip();
      if (Peek() != '(') Fail("lacks a bracket after " + value.text);
      value.list = List(depth + 1);
    } else {
      value.kind = Kind::kNumber;
      if (c == '+') ++at_;
      Number(value.number);
    }
    return value;
  }

  template <typename T>
  void Number(T& out) {
    const auto [end, error] = std::from_chars(text_.data() + at_, text_.data() + text_.size(), out);
    if (error != std::errc()) Fail("is malformed");
    at_ = static_cast<size_t>(end - text_.data());
  }

  std::string_view text_;
  std::string where_;
  size_t at_ = 0;
  size_t value_count_ = 0;
};

// Types of the right-hand side of an instance: words followed by a bracket at the outermost level.
std::vector<std::string_view> OuterTypes(std::string_view text) {
  std::vector<std::string_view> types;
  size_t at = SkipSpace(text, 0);
  const bool complex = at < text.size() && text[at] == '(';
  int depth = 0;
  while (at < text.size()) {
    const char c = text[at];
    if (c == '\'' || c == '"') {
      at = SkipQuoted(text, at);
    } else if (text.substr(at, 2) == "/*") {
      at = SkipSpace(text, at);
    } else if (c == '(' || c == ')') {
      depth += c == '(' ? 1 : -1;
      ++at;
    } else if (depth == (complex ? 1 : 0) && IsWordStart(c)) {
      const size_t begin = at;
      while (at < text.size() && IsWord(text[at])) ++at;
      types.push_back(text.substr(begin, at - begin));
      // One more than there may be is enough to tell.
      if (!complex || types.size() > kMaxTypes) break;
    } else {
      ++at;
    }
  }
  return types;
}

}  // namespace

Part21File Part21File::Read(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw StepInputError(file.string() + ": cannot be opened for reading");
  in.seekg(0, std::ios::end);
  const std::streamoff size = in.tellg();
  if (size < 0 || size > kMaxBytes) {
    throw StepInputError(file.string() + ": larger than 2 GiB");
  }
  std::string text(static_cast<size_t>(size), '\0');
  in.seekg(0);
  in.read(text.data(), size);
  if (!in) throw StepInputError(file.string() + ": cannot be read");
  return Part21File(std::move(text), file.string());
}

Part21File::Part21File(std::string text, std::string name)
    : text_(std::move(text)), name_(std::move(name)) {
  const std::string_view all = text_;
  for (size_t at = SkipSpace(all, 0); at < all.size();) {
    const size_t end = StatementEnd(all, at);
    const std::string_view statement = all.substr(at, end - at);
    if (statement.starts_with("FILE_SCHEMA")) {
      const size_t quote = statement.find('\'');
      if (quote != std::string_view::npos) {
        const size_t past = SkipQuoted(statement, quote);
        schema_ = DecodeText(statement.substr(quote + 1, past - quote - 2));
      }
    } else if (statement.starts_with('#')) {
      int64_t id = 0;
      const char* last = statement.data() + statement.size();
      const auto [after, error] = std::from_chars(statement.data() + 1, last, id);
      const size_t equals = SkipSpace(all, static_cast<size_t>(after - all.data()));
      if (error != std::errc() || equals >= end || all[equals] != '=') {
        throw StepInputError(name_ +
                             ": malformed instance: " + std::string(statement.substr(0, 40)));
      }
      Instance instance;
      instance.begin = equals + 1;
      instance.end = end;
      instance.types = OuterTypes(all.substr(equals + 1, end - equals - 1));
      if (instance.types.size() > kMaxTypes ||
          std::ranges::any_of(instance.types, [](std::string_view type) {
            return type.size() > kMaxTypeCharacters;
          })) {
        throw StepInputError(name_ + ": #" + std::to_string(id) + " has more than " +
                             std::to_string(kMaxTypes) + " types, or a type of more than " +
                             std::to_string(kMaxTypeCharacters) + " characters");
      }
      if (!instances_.emplace(id, std::move(instance)).second) {
        throw StepInputError(name_ + ": #" + std::to_string(id) + " is there twice");
      }
      order_.push_back(id);
    }
    at = SkipSpace(all, end + 1);
  }
  if (order_.empty()) throw StepInputError(name_ + ": no instance in it");
}

std::vector<std::string_view> Part21File::Types(int64_t id) const {
  const auto found = instances_.find(id);
  return found == instances_.end() ? std::vector<std::string_view>() : found->second.types;
}

bool Part21File::IsA(int64_t id, std::string_view type) const {
  const auto found = instances_.find(id);
  if (found == instances_.end()) return false;
  return std::find(found->second.types.begin(), found->second.types.end(), type) !=
         found->second.types.end();
}

size_t Part21File::Bytes(int64_t id) const {
  const auto found = instances_.find(id);
  return found == instances_.end() ? 0 : found->second.end - found->second.begin;
}

std::vector<Part21Record> Part21File::Records(int64_t id) const {
  const std::string where = name_ + ": #" + std::to_string(id);
  const auto found = instances_.find(id);
  if (found == instances_.end()) throw StepInputError(where + " is missing");
  const Instance& instance = found->second;
  return Parser(std::string_view(text_).substr(instance.begin, instance.end - instance.begin),
                where)
      .Records();
}

}  // namespace sightline
