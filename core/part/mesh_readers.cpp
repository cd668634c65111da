// SPDX-License-Identifier: Apache-2.0
#include "core/part/mesh_readers.h"

#include <algorithm>
#include <charconv>
#include <cmath>

namespace sightline {
namespace {

bool IsBlank(char c) { return c == ' ' || c == '\t' || c == '\v' || c == '\f'; }

}  // namespace

void RawMesh::SetMaterialOfNewTriangles(const std::string& name) {
  if (triangle_material.size() == triangles.size()) return;
  const auto known = material_of_name_.find(name);
  size_t index = material_names.size();
  if (known != material_of_name_.end()) {
    index = known->second;
  } else {
    // More names than an index can tell apart: the rest has no material of its own.
    constexpr size_t kMaxMaterials = 65'535;
    if (index < kMaxMaterials) {
      material_names.push_back(name);
      material_of_name_.emplace(name, static_cast<uint16_t>(index));
    } else {
      material_names.back().clear();
      --index;
    }
  }
  triangle_material.resize(triangles.size(), static_cast<uint16_t>(index));
}

size_t TextScanner::LineEndAt(size_t at) const {
  if (at >= text_.size()) return 0;
  if (text_[at] == '\n') return 1;
  if (text_[at] != '\r') return 0;
  return at + 1 < text_.size() && text_[at + 1] == '\n' ? 2 : 1;
}

size_t TextScanner::ContinuationAt(size_t at) const {
  if (!continued_ || at >= text_.size() || text_[at] != '\\') return 0;
  size_t end = at + 1;
  while (end < text_.size() && IsBlank(text_[end])) ++end;
  const size_t line_end = LineEndAt(end);
  return line_end == 0 ? 0 : end + line_end - at;
}

std::string_view TextScanner::WordInLine() {
  while (position_ < text_.size()) {
    if (IsBlank(text_[position_])) {
      ++position_;
    } else if (const size_t joined = ContinuationAt(position_); joined > 0) {
      position_ += joined;
      ++line_;
    } else {
      break;
    }
  }
  const size_t start = position_;
  while (position_ < text_.size() && !IsBlank(text_[position_]) && LineEndAt(position_) == 0 &&
         ContinuationAt(position_) == 0) {
    ++position_;
  }
  return text_.substr(start, position_ - start);
}

bool TextScanner::NextLine(bool of_comment) {
  while (position_ < text_.size()) {
    if (const size_t end = LineEndAt(position_); end > 0) {
      position_ += end;
      ++line_;
      return true;
    }
    const size_t joined = of_comment ? 0 : ContinuationAt(position_);
    line_ += joined > 0;
    position_ += std::max<size_t>(1, joined);
  }
  return false;
}

std::string_view TextScanner::Word() {
  while (true) {
    const std::string_view word = WordInLine();
    if (!word.empty() || !NextLine()) return word;
  }
}

std::string Excerpt(std::string_view word) { return std::string(word.substr(0, 40)); }

bool ParseNumber(std::string_view word, double* value) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  const char* end = word.data() + word.size();
  const auto result = std::from_chars(word.data(), end, *value);
  if (result.ec == std::errc::result_out_of_range && result.ptr == end) {
    // Too small for a double counts as zero; too large is the caller's infinity.
    const size_t exponent = word.find_first_of("eE");
    const bool tiny = exponent != std::string_view::npos && word.substr(exponent + 1, 1) == "-";
    *value = tiny ? 0 : HUGE_VAL;
    return true;
  }
  return result.ec == std::errc() && result.ptr == end;
}

bool ParseInteger(std::string_view word, int64_t* value) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  const char* end = word.data() + word.size();
  const auto result = std::from_chars(word.data(), end, *value);
  return result.ec == std::errc() && result.ptr == end;
}

}  // namespace sightline
