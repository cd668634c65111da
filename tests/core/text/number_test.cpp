// SPDX-License-Identifier: Apache-2.0
#include "core/text/number.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <string>

namespace sightline {
namespace {

using ::testing::HasSubstr;

TEST(Number, WholeNumbersAreDecimalDigits) {
  EXPECT_EQ(ParseWhole("0").value(), 0);
  EXPECT_EQ(ParseWhole("-0").value(), 0);
  EXPECT_EQ(ParseWhole("9223372036854775807").value(), std::numeric_limits<int64_t>::max());
  EXPECT_EQ(ParseWhole("-9223372036854775808").value(), std::numeric_limits<int64_t>::min());
  EXPECT_EQ(ParseUnsigned("18446744073709551615").value(), std::numeric_limits<uint64_t>::max());
  for (const char* text : {"",
                           "-",
                           "+5",
                           "010",
                           "-010",
                           "00",
                           "0x8",
                           "0b1",
                           "1e3",
                           "1.0",
                           "1,000",
                           "1_000",
                           " 1",
                           "1 ",
                           "1\n",
                           "nan",
                           "inf",
                           "9223372036854775808",
                           "18446744073709551617",
                           "\u0661"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(ParseWhole(text).status())) << text;
  }
  for (const char* text : {"-1", "-0", "010", "0x8", "1e3", "18446744073709551616", "nan"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(ParseUnsigned(text).status())) << text;
  }
  EXPECT_FALSE(ParseWhole(std::string("1\0", 2)).ok());
}

TEST(Number, RealNumbersAreFiniteAndDecimal) {
  EXPECT_EQ(ParseReal("0.1").value(), 0.1);
  EXPECT_EQ(ParseReal("-2.").value(), -2);
  EXPECT_EQ(ParseReal("+.5").value(), 0.5);
  EXPECT_EQ(ParseReal("1e3").value(), 1000);
  EXPECT_EQ(ParseReal("1E+06").value(), 1e6);
  EXPECT_EQ(ParseReal("007.50").value(), 7.5);  // padded, as in columns of files
  EXPECT_EQ(ParseReal("1e-400").value(), 0);
  EXPECT_EQ(ParseReal("0." + std::string(400, '0') + "1").value(), 0);
  EXPECT_EQ(ParseReal("4.9406564584124654e-324").value(),
            std::numeric_limits<double>::denorm_min());
  for (const char* text :
       {"",       "-",     "+",     ".",    "e5",     "1e",  "++1",  "+-1",      "--1",
        "0x8",    "0x1p3", "nan",   "-nan", "nan(1)", "inf", "-inf", "infinity", "1e999",
        "-1e999", "1,5",   "1.2.3", "1 ",   " 1",     "1m",  "1f"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(ParseReal(text).status())) << text;
  }
}

TEST(Number, LeadingZerosAreThoseOfOctal) {
  for (const char* text : {"010", "-010", "+00", "00.5"})
    EXPECT_TRUE(HasLeadingZeros(text)) << text;
  for (const char* text : {"0", "-0", "0.5", "0e3", "10", "", "-"}) {
    EXPECT_FALSE(HasLeadingZeros(text)) << text;
  }
}

TEST(Number, MessagesQuoteTheText) {
  EXPECT_THAT(ParseWhole("1e3").status().message(), HasSubstr("whole number, is \"1e3\""));
  EXPECT_THAT(ParseReal(std::string(1000, '9') + "x").status().message(), HasSubstr("999...\""));
  EXPECT_THAT(ParseReal("\x1b[2J").status().message(), HasSubstr("\\x1b[2J"));
  EXPECT_LT(ParseReal(std::string(1 << 20, 'x')).status().message().size(), 200u);
}

}  // namespace
}  // namespace sightline
