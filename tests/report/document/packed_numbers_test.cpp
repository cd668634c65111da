// SPDX-License-Identifier: Apache-2.0
#include "report/document/packed_numbers.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/report/unpacked_numbers.h"

namespace sightline {
namespace {

TEST(PackedNumbers, ComeBackWhateverTheStride) {
  const std::vector<uint32_t> numbers = {0, 4294967295U, 1, 70000, 69999, 256, 0};
  const std::vector<uint16_t> short_numbers = {65535, 0, 1, 65534, 300};
  const std::vector<uint8_t> small_numbers = {255, 0, 128, 127};
  for (const size_t stride : {1U, 3U, 100U}) {
    EXPECT_EQ(UnpackNumbers<uint32_t>(PackNumbers(numbers, stride), stride), numbers);
    EXPECT_EQ(UnpackNumbers<uint16_t>(PackNumbers(short_numbers, stride), stride), short_numbers);
    EXPECT_EQ(UnpackNumbers<uint8_t>(PackNumbers(small_numbers, stride), stride), small_numbers);
  }
  EXPECT_TRUE(UnpackNumbers<uint32_t>(PackNumbers(std::vector<uint32_t>())).empty());
}

TEST(PackedNumbers, NeighboursThatAreAlikeCostLittle) {
  std::vector<uint32_t> numbers;
  for (uint32_t i = 0; i < 100000; ++i) numbers.push_back(1000000 + 3 * i);
  EXPECT_LT(PackNumbers(numbers).size(), 2000U);
}

TEST(PackedNumbers, ALongTextComesBack) {
  std::string bytes;
  for (int i = 0; i < 300000; ++i) bytes += static_cast<char>(i * i % 251);
  EXPECT_EQ(UnpackBytes(PackBytes(bytes)), bytes);
}

}  // namespace
}  // namespace sightline
