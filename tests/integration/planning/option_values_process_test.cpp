// SPDX-License-Identifier: Apache-2.0
// Options of all programs: each that is a number refuses what is none, each without effect is
// named.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "planner_client/command_line/command_table.h"
#include "tests/integration/run_process.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;

// Programs that are no commands of `sightline`. A new one joins here.
constexpr const char* kOtherPrograms[] = {"coverage_server", "render_worker",
                                          "sightline_step_import"};

// Texts that are no value of an option, by the option's type in --help. An empty list: any text is
// a value.
const std::map<std::string, std::vector<std::string>>& WrongValues() {
  static const std::map<std::string, std::vector<std::string>> values = {
      {"INT", {"010", "0x8", "1e3", "nan", "inf", "18446744073709551617"}},
      {"UINT", {"010", "0x8", "1e3", "nan", "inf", "-1", "18446744073709551617"}},
      {"FLOAT", {"010", "0x8", "nan", "-nan", "inf", "1e999"}},
      {"SIZE", {"010MB", "0x8", "1e3", "nan", "inf", "-1", "18446744073709551617"}},
      {"TEXT", {}}};
  return values;
}

struct OptionInHelp {
  std::string name, type;
};

// Options with values and the commands that a --help lists.
struct Help {
  std::vector<OptionInHelp> options;
  std::vector<std::string> commands;
};

Help HelpOf(const std::string& words) {
  static const std::regex option(
      "  (?:-[a-zA-Z],)?(--[a-z][a-z0-9-]*)(?:,--?[a-z0-9-]+)* ([A-Z]+)"
      "(?:[:= ].*)?");
  static const std::regex command("  ([a-z][a-z-]*)  .*");
  const ProcessResult result = RunProcess(words + " --help");
  EXPECT_EQ(result.exit_code, 0) << words << "\n" << result.output;
  Help help;
  std::istringstream lines(result.output);
  bool in_commands = false;
  for (std::string line; std::getline(lines, line);) {
    if (!line.empty() && line[0] != ' ') in_commands = line == "Subcommands:";
    std::smatch match;
    if (std::regex_match(line, match, option)) help.options.push_back({match[1], match[2]});
    if (in_commands && std::regex_match(line, match, command)) help.commands.push_back(match[1]);
  }
  return help;
}

// Tries all numbers among the options of the program and of its commands; returns how many.
int TryNumbers(const std::string& words) {
  const Help help = HelpOf(words);
  int numbers = 0;
  for (const OptionInHelp& option : help.options) {
    const auto wrong = WrongValues().find(option.type);
    if (wrong == WrongValues().end()) {
      ADD_FAILURE() << words << " " << option.name << ": the type " << option.type
                    << " is new; say what is no value of it";
      continue;
    }
    numbers += wrong->second.empty() ? 0 : 1;
    for (const std::string& value : wrong->second) {
      const std::string line = absl::StrCat(words, " ", option.name, "=", value);
      const ProcessResult result = RunProcess(line);
      EXPECT_EQ(result.exit_code, 2) << line << "\n" << result.output;
      EXPECT_THAT(result.output, HasSubstr(option.name)) << line;
    }
  }
  for (const std::string& command : help.commands) numbers += TryNumbers(words + " " + command);
  return numbers;
}

TEST(OptionValues, NumbersOfCommandsAreDecimalAndFinite) {
  int numbers = 0;
  for (const std::string_view program : {kPlanProgram, kRenderProgram, kServeProgram}) {
    numbers += TryNumbers(absl::StrCat(BinFolder(), "/", std::string(program)));
  }
  // So many there are at least; fewer would say that --help is not understood here.
  EXPECT_GE(numbers, 60);
}

TEST(OptionValues, NumbersOfOtherProgramsAreDecimalAndFinite) {
  for (const char* program : kOtherPrograms) {
    // Builds may leave out the renderer and the STEP importer.
    if (!std::filesystem::exists(BinFolder() + "/" + program)) continue;
    EXPECT_GE(TryNumbers(absl::StrCat(BinFolder(), "/", program)), 2) << program;
  }
}

TEST(OptionValues, OptionsWithoutEffectAreRefusedByName) {
  struct Case {
    const char* words;
    const char* option;
  };
  for (const Case& given : {
           Case{"plan i.json --out o --pose-prior-mm 1", "--pose-prior-mm"},
           Case{"plan i.json --out o --optics-rounds 2", "--optics-rounds"},
           Case{"plan i.json --out o --pick 1 --seed 3", "--seed"},
           Case{"plan i.json --out o --pick-scans 1 --goal 0.5", "--goal"},
           Case{"render i.json --out o --draft-pixels 800", "--draft-pixels"},
           Case{"optics i.json --out o --max-price 10", "--max-price"},
           Case{"effects optics.coma --json", "--json"},
           Case{"part x.stl --qif-schema f", "--qif-schema"},
           Case{"serve --listen unix:s --data d --mqtt-prefix p", "--mqtt-prefix"},
           Case{"serve --listen unix:s --data d --webhook-ca p", "--webhook-ca"},
           Case{"serve --listen unix:s --data d --http-host h", "--http-host"},
           Case{"serve --listen unix:s --data d --slurm-partition p", "--slurm-partition"},
           Case{"serve --listen unix:s --data d --runner kubernetes --slurm-partition p",
                "--slurm-partition"},
           Case{"serve --listen unix:s --data d --metrics-host h", "--metrics-host"},
       }) {
    const ProcessResult result = RunProcess(absl::StrCat(BinFolder(), "/sightline ", given.words));
    EXPECT_EQ(result.exit_code, 2) << given.words << "\n" << result.output;
    EXPECT_THAT(result.output, HasSubstr(given.option)) << given.words;
  }
}

}  // namespace
}  // namespace sightline
