// SPDX-License-Identifier: Apache-2.0
#include "core/text/step_length_unit.h"

#include "absl/strings/ascii.h"

namespace sightline {
namespace {

constexpr size_t kMostKept = 100'000;
// Longer words are none of those that are looked for.
constexpr size_t kMostWordCharacters = 200;
constexpr int64_t kMostReference = int64_t{1} << 58;

bool IsStepWordCharacter(char c) {
  return absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '-' || c == '!';
}

}  // namespace

void StepLengthUnitScan::Add(std::string_view bytes) {
  for (size_t at = 0; at < bytes.size(); ++at) {
    if (inside_ == Inside::kString) {
      // A doubled quote ends the string and begins it again.
      at = bytes.find('\'', at);
      if (at == std::string_view::npos) return;
    }
    const char c = bytes[at];
    switch (inside_) {
      case Inside::kText:
        AddText(c);
        if (inside_ == Inside::kComment) {
          before_ = '\0';  // the star that opens a comment does not close it as well
          continue;
        }
        break;
      case Inside::kString:
        inside_ = Inside::kText;
        break;
      case Inside::kBinary:
        if (c == '"') inside_ = Inside::kText;
        break;
      case Inside::kComment:
        if (c == '/' && before_ == '*') {
          inside_ = Inside::kText;
          before_ = '\0';
          continue;
        }
        break;
    }
    before_ = c;
  }
}

void StepLengthUnitScan::AddText(char c) {
  if (in_reference_ && absl::ascii_isdigit(static_cast<unsigned char>(c))) {
    if (reference_ < kMostReference) reference_ = 10 * reference_ + (c - '0');
    return;
  }
  if (in_reference_ && reference_ == 0 && absl::ascii_isspace(static_cast<unsigned char>(c))) {
    return;
  }
  if (IsStepWordCharacter(c)) {
    if (word_.size() <= kMostWordCharacters) {
      word_ += absl::ascii_toupper(static_cast<unsigned char>(c));
    }
    return;
  }
  EndWord();
  if (c == '#') {
    in_reference_ = true;
  } else if (c == ';') {
    EndInstance();
  } else if (c == '\'') {
    inside_ = Inside::kString;
  } else if (c == '"') {
    inside_ = Inside::kBinary;
  } else if (c == '*' && before_ == '/') {
    inside_ = Inside::kComment;
  }
}

void StepLengthUnitScan::EndWord() {
  if (in_reference_) {
    if (references_.size() < kMostKept) references_.push_back(reference_);
    in_reference_ = false;
    reference_ = 0;
  }
  has_length_ |= word_ == "LENGTH_UNIT" || word_ == "METRE";
  is_context_ |= word_ == "GLOBAL_UNIT_ASSIGNED_CONTEXT";
  word_.clear();
}

// The first reference of an instance is its own name; references of a context beyond its units do
// no harm, since they are no units.
void StepLengthUnitScan::EndInstance() {
  if (!references_.empty()) {
    has_instance_ = true;
    const int64_t id = references_.front();
    if (has_length_) {
      lengths_.insert(id);
      found_ |= assigned_.contains(id);
    }
    if (is_context_) {
      too_many_ |= references_.size() >= kMostKept;
      for (const int64_t unit : references_) {
        assigned_.insert(unit);
        found_ |= lengths_.contains(unit);
      }
    }
    too_many_ |= lengths_.size() > kMostKept || assigned_.size() > kMostKept;
    if (too_many_) {
      lengths_.clear();
      assigned_.clear();
    }
  }
  references_.clear();
  has_length_ = is_context_ = false;
}

bool StepLengthUnitScan::StatesNone() const {
  return has_instance_ && !found_ && !too_many_ && inside_ == Inside::kText;
}

}  // namespace sightline
