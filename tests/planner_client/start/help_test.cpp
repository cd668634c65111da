// SPDX-License-Identifier: Apache-2.0
// Tests of --help, and of messages about wrong command lines.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <sstream>

#include "planner_client/command_line/help/help_format.h"
#include "planner_client/command_line/help/terminal.h"
#include "planner_client/command_line/help/wrong_arguments.h"
#include "planner_client/commands/commands.h"
#include "planner_client/commands/recordings/time_left.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class HelpTest : public ::testing::Test {
 protected:
  HelpTest() {
    app_.formatter(std::make_shared<HelpFormat>());
    app_.option_defaults()->always_capture_default();
    app_.require_subcommand(1);
    commands_.push_back(AddPlanCommand(*app_.add_subcommand("plan", "plans")));
    commands_.push_back(AddRecordingsCommand(*app_.add_subcommand("recordings", "records")));
  }

  std::string Help(const std::string& command) { return app_.get_subcommand(command)->help(); }

  std::string Wrong(const std::vector<std::string>& arguments) {
    std::vector<std::string> reversed(arguments.rbegin(), arguments.rend());
    try {
      app_.parse(reversed);
    } catch (const CLI::ParseError& error) {
      return ExplainWrongArguments(app_, arguments, error);
    }
    return "";
  }

  CLI::App app_{"does things", "sightline"};
  // They hold what the options are read into.
  std::vector<Command> commands_;
};

TEST_F(HelpTest, FitsEightyColumnsAndShowsDefaults) {
  const std::string help = Help("plan");
  std::istringstream lines(help);
  for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 80u) << line;
  EXPECT_THAT(help,
              AllOf(HasSubstr("--strategy TEXT=refined"), HasSubstr("=10000"),
                    HasSubstr("--no-pictures "), Not(HasSubstr("{false}")), Not(HasSubstr("=[]"))));
}

TEST_F(HelpTest, UnknownCommandsAreToldTheNearest) {
  EXPECT_THAT(Wrong({"planz"}), AllOf(HasSubstr("\"planz\" is no command of sightline"),
                                      HasSubstr("did you mean plan?"), HasSubstr("recordings")));
  EXPECT_THAT(Wrong({"recordings", "chek"}), AllOf(HasSubstr("\"chek\" is no command of sightline"),
                                                   HasSubstr("did you mean check?")));
  EXPECT_THAT(Wrong({"xylophone"}), Not(HasSubstr("did you mean")));
}

TEST_F(HelpTest, UnknownOptionsAreToldTheNearest) {
  EXPECT_THAT(Wrong({"plan", "i.json", "--out", "o", "--stratgy", "matrix"}),
              AllOf(HasSubstr("--stratgy is no option of sightline plan"),
                    HasSubstr("did you mean --strategy?")));
  EXPECT_THAT(Wrong({"plan", "i.json", "--out=o", "--no-picture"}),
              AllOf(HasSubstr("did you mean"), HasSubstr("--no-pictures?")));
}

TEST_F(HelpTest, AllThatIsMissingIsNamed) {
  EXPECT_THAT(Wrong({"plan"}), AllOf(HasSubstr("sightline plan needs"), HasSubstr("inspection"),
                                     HasSubstr("--out")));
  EXPECT_THAT(Wrong({"recordings"}), HasSubstr("one of the commands new, check"));
}

TEST_F(HelpTest, ValuesOutOfRangeAreNamed) {
  EXPECT_THAT(Wrong({"plan", "i.json", "--out", "o", "--goal", "2"}),
              AllOf(HasSubstr("--goal"), HasSubstr("2")));
}

TEST(TerminalTest, BreaksLinesBetweenWords) {
  EXPECT_EQ(WrapText("one two three", 7), "one two\nthree");
  EXPECT_EQ(WrapText("one two three\nfour", 9, "  "), "one two\n  three\nfour");
  EXPECT_EQ(WrapText("extraordinarily long", 5), "extraordinarily\nlong");
  EXPECT_EQ(WrapText("  indented words stay", 12), "  indented\nwords stay");
  EXPECT_EQ(WrapText("", 5), "");
  EXPECT_EQ(WrapText("fits", 4), "fits");
}

TEST(TimeLeft, FollowsFromWhatHasPassed) {
  using std::chrono::seconds;
  EXPECT_EQ(TimeLeftText(seconds(5), 0.5), "");
  EXPECT_EQ(TimeLeftText(seconds(60), 0.01), "");
  EXPECT_EQ(TimeLeftText(seconds(60), 1), "");
  EXPECT_EQ(TimeLeftText(seconds(60), 0.5), ", about 60 s left");
  EXPECT_EQ(TimeLeftText(seconds(60), 0.1), ", about 9 min left");
  EXPECT_EQ(TimeLeftText(seconds(3600), 0.25), ", about 3.0 h left");
}

}  // namespace
}  // namespace sightline
