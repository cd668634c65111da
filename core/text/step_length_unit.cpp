// SPDX-License-Identifier: Apache-2.0
#include "core/text/step_length_unit.h"

#include <algorithm>

#include "absl/strings/ascii.h"

namespace sightline {
namespace {

constexpr size_t kMostKept = 100'000;
// Longer words are none of those that are looked for.
constexpr size_t kMostWordCharacters = 200;
constexpr size_t kMostHeadBytes = 4096;
// Numbers of instances whose presence is checked: 4 MiB of memory for each of two sets.
constexpr int64_t kMostInstanceNumber = int64_t{1} << 25;
constexpr int64_t kMostReference = int64_t{1} << 58;

bool IsStepWordCharacter(char c) {
  return absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '-' || c == '!';
}

}  // namespace

void StepLengthUnitScan::Add(std::string_view bytes) {
  head_.append(bytes.substr(0, kMostHeadBytes - head_.size()));
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
  is_shape_context_ |= word_ == "GEOMETRIC_REPRESENTATION_CONTEXT";
  is_parametric_ |= word_ == "PARAMETRIC_REPRESENTATION_CONTEXT";
  has_end_mark_ |= word_ == "END-ISO-10303-21";
  word_.clear();
}

// The first reference of an instance is its own name; references of a context beyond its units do
// no harm, since they are no units.
void StepLengthUnitScan::EndInstance() {
  if (!references_.empty()) {
    has_instance_ = true;
    const int64_t id = references_.front();
    for (const int64_t reference : references_) {
      if (reference > kMostInstanceNumber) {
        too_many_ = true;
        continue;
      }
      const size_t number = static_cast<size_t>(reference);
      if (number >= referred_to_.size()) {
        referred_to_.resize(2 * number + 1);
        instances_.resize(2 * number + 1);
      }
      referred_to_[number] = true;
      if (reference == id) instances_[number] = true;
    }
    too_many_ |= references_.size() >= kMostKept;
    if (has_length_) {
      lengths_.insert(id);
      found_ |= assigned_.contains(id);
    }
    if (is_context_) {
      for (const int64_t unit : references_) {
        assigned_.insert(unit);
        found_ |= lengths_.contains(unit);
      }
    }
    if (is_shape_context_ && !is_parametric_) {
      has_shape_context_ = true;
      if (!is_context_) references_.clear();
      open_contexts_.push_back(references_);
    }
    too_many_ |= lengths_.size() > kMostKept || assigned_.size() > kMostKept ||
                 open_contexts_.size() > kMostKept;
    if (too_many_) {
      lengths_.clear();
      assigned_.clear();
      open_contexts_.clear();
    }
  }
  references_.clear();
  has_length_ = is_context_ = is_shape_context_ = is_parametric_ = false;
}

bool StepLengthUnitScan::IsWhole() const {
  return IsStep() && has_end_mark_ && has_instance_ && !too_many_ && inside_ == Inside::kText &&
         instances_ == referred_to_;
}

bool StepLengthUnitScan::StatesNone() const { return !found_ && IsWhole(); }

bool StepLengthUnitScan::StatesAll() const {
  return has_shape_context_ && IsWhole() &&
         std::ranges::all_of(open_contexts_, [this](const std::vector<int64_t>& context) {
           return std::ranges::any_of(context,
                                      [this](int64_t unit) { return lengths_.contains(unit); });
         });
}

}  // namespace sightline
