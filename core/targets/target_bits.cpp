// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cassert>
#include <cstring>

#include "core/targets/target_set.h"

namespace sightline {

int64_t TargetBits::Count() const {
  int64_t count = 0;
  for (uint64_t word : words_) count += std::popcount(word);
  return count;
}

TargetBits& TargetBits::operator|=(const TargetBits& other) {
  assert(size_ == other.size_);
  for (size_t i = 0; i < words_.size(); ++i) words_[i] |= other.words_[i];
  return *this;
}

TargetBits& TargetBits::operator&=(const TargetBits& other) {
  assert(size_ == other.size_);
  for (size_t i = 0; i < words_.size(); ++i) words_[i] &= other.words_[i];
  return *this;
}

TargetBits& TargetBits::Subtract(const TargetBits& other) {
  assert(size_ == other.size_);
  for (size_t i = 0; i < words_.size(); ++i) words_[i] &= ~other.words_[i];
  return *this;
}

int64_t TargetBits::CountNotIn(const TargetBits& covered) const {
  assert(size_ == covered.size_);
  int64_t count = 0;
  for (size_t i = 0; i < words_.size(); ++i) count += std::popcount(words_[i] & ~covered.words_[i]);
  return count;
}

std::string TargetBits::ToBytes() const {
  std::string bytes((size_ + 7) / 8, '\0');
  for (size_t i = 0; i < bytes.size(); ++i) {
    bytes[i] = static_cast<char>((words_[i / 8] >> (8 * (i % 8))) & 0xff);
  }
  return bytes;
}

TargetBits TargetBits::FromBytes(size_t size, const std::string& bytes) {
  TargetBits bits(size);
  const size_t count = std::min(bytes.size(), (size + 7) / 8);
  for (size_t i = 0; i < count; ++i) {
    bits.words_[i / 8] |= uint64_t{static_cast<unsigned char>(bytes[i])} << (8 * (i % 8));
  }
  if (size % 64 != 0 && !bits.words_.empty()) {
    bits.words_.back() &= (uint64_t{1} << (size % 64)) - 1;
  }
  return bits;
}

}  // namespace sightline
