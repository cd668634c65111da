// SPDX-License-Identifier: Apache-2.0
#include "core/command_options/option_values.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// A program with an option of every type that programs have.
struct Program {
  Program() {
    app.add_option("--whole", whole)->check(CLI::Range(-100, 100));
    app.add_option("--narrow", narrow);
    app.add_option("--unsigned", not_negative);
    app.add_option("--real", real)->check(CLI::NonNegativeNumber);
    app.add_option("--reals", reals)->delimiter(',');
    app.add_option("--text", text);
    app.add_option("--unit", unit)->transform(NameOfLengthUnit());
    CLI::Option* size_option = app.add_option("--size", size);
    size_option->check(CLI::Range(1.0, 1e15));
    TakeSizes(*size_option);
    CLI::App* below = app.add_subcommand("below", "");
    below->add_option("--deep", deep);
    RequireStrictNumbers(app);
  }

  // The error of a command line; empty: none.
  std::string Error(std::vector<std::string> words) {
    try {
      app.parse(std::vector<std::string>(words.rbegin(), words.rend()));
    } catch (const CLI::ParseError& error) {
      return error.what();
    }
    return "";
  }

  CLI::App app;
  int whole = 0;
  std::optional<int16_t> narrow;
  uint64_t not_negative = 0;
  std::optional<double> real;
  std::vector<double> reals;
  std::string text, unit;
  int64_t size = 0;
  float deep = 0;
};

std::string ErrorOf(const std::vector<std::string>& words) { return Program().Error(words); }

TEST(OptionValues, NumbersAreReadAsWritten) {
  Program program;
  ASSERT_EQ(program.Error({"--whole", "-7", "--narrow", "12", "--unsigned", "18446744073709551615",
                           "--real", "1e-3", "--reals", "1,0.5,-2e1", "--text", "010", "--unit",
                           "in", "--size", "8MB", "below", "--deep", "0.25"}),
            "");
  EXPECT_EQ(program.whole, -7);
  EXPECT_EQ(program.narrow, 12);
  EXPECT_EQ(program.not_negative, UINT64_MAX);
  EXPECT_EQ(program.real, 1e-3);
  EXPECT_THAT(program.reals, ElementsAre(1, 0.5, -20));
  EXPECT_EQ(program.text, "010");
  EXPECT_EQ(program.unit, "inch");
  EXPECT_EQ(program.size, 8 << 20);
  EXPECT_EQ(program.deep, 0.25f);
}

TEST(OptionValues, NothingElseIsANumber) {
  for (const char* name : {"--whole", "--narrow", "--unsigned", "--real", "--reals", "--size"}) {
    for (const char* value : {"010", "0x8", "nan", "-nan", "inf", "-inf", "1e999", "", "7 "}) {
      EXPECT_THAT(ErrorOf({std::string(name) + "=" + value}), HasSubstr(name)) << value;
    }
  }
  for (const char* name : {"--whole", "--narrow", "--unsigned", "--size"}) {
    for (const char* value : {"1e3", "1.0", "18446744073709551617"}) {
      EXPECT_THAT(ErrorOf({std::string(name) + "=" + value}), HasSubstr(name)) << value;
    }
  }
  EXPECT_THAT(ErrorOf({"--narrow=70000"}), HasSubstr("--narrow"));
  EXPECT_THAT(ErrorOf({"--reals=1,nan"}), HasSubstr("\"nan\""));
  EXPECT_THAT(ErrorOf({"--size=010MB"}), HasSubstr("\"010MB\""));
  EXPECT_THAT(ErrorOf({"--size=1.5GB"}), HasSubstr("512MB"));
  EXPECT_THAT(ErrorOf({"--unit=yard"}), AllOf(HasSubstr("--unit"), HasSubstr("inch")));
  EXPECT_THAT(ErrorOf({"below", "--deep=nan"}), HasSubstr("--deep"));
}

TEST(OptionValues, OptionsWithoutEffectAreRefused) {
  const auto error = [](const std::vector<std::string>& words) {
    CLI::App app;
    std::string a, b, c;
    app.add_option("--cache", a);
    app.add_option("--cache-size", b);
    app.add_option("--uncached", c);
    NeedOption(app, {"--cache-size"}, "--cache");
    try {
      app.parse(std::vector<std::string>(words.rbegin(), words.rend()));
    } catch (const CLI::ParseError& e) {
      return std::string(e.what());
    }
    return std::string(CheckExcluded(app, "--uncached", {"--cache"}).message());
  };
  EXPECT_EQ(error({"--cache=a", "--cache-size=1"}), "");
  EXPECT_EQ(error({"--uncached=slow"}), "");
  EXPECT_THAT(error({"--cache-size=1"}), AllOf(HasSubstr("--cache-size"), HasSubstr("--cache")));
  EXPECT_EQ(error({"--cache=a", "--uncached=slow"}), "--uncached and --cache exclude each other");
}

}  // namespace
}  // namespace sightline
