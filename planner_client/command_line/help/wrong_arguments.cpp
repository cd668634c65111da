// SPDX-License-Identifier: Apache-2.0
#include "planner_client/command_line/help/wrong_arguments.h"

#include <algorithm>
#include <sstream>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/spelling/nearest_name.h"
#include "planner_client/command_line/help/terminal.h"

namespace sightline {
namespace {

std::vector<const CLI::App*> CommandsBelow(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App* command) { return !command->get_name().empty(); });
}

// The option of `app` that an argument names, "--seed" or "--seed=3"; null if there is none.
const CLI::Option* OptionOf(const CLI::App& app, const std::string& argument) {
  return app.get_option_no_throw(argument.substr(0, argument.find('=')));
}

// Result of following the words of a command line: the command that they name, and the first word
// that names none.
struct Reached {
  const CLI::App* command;
  std::string words;         // "sightline recordings"
  std::string unknown_word;  // in place of a command; empty: none
  std::string unknown_option;
};

Reached Follow(const CLI::App& app, const std::vector<std::string>& arguments) {
  Reached reached{&app, app.get_name(), "", ""};
  for (size_t i = 0; i < arguments.size(); ++i) {
    const std::string& argument = arguments[i];
    if (argument == "--") break;
    if (absl::StartsWith(argument, "-") && argument.size() > 1) {
      const CLI::Option* option = OptionOf(*reached.command, argument);
      // Options of commands above count too.
      for (const CLI::App* above = reached.command->get_parent(); option == nullptr && above;
           above = above->get_parent()) {
        option = OptionOf(*above, argument);
      }
      const bool negative_number =
          argument.find_first_not_of("-+.0123456789eE") == std::string::npos;
      if (option == nullptr && !negative_number && reached.unknown_option.empty()) {
        reached.unknown_option = argument.substr(0, argument.find('='));
      }
      const bool takes_value = option != nullptr && option->get_type_size() > 0;
      if (takes_value && !absl::StrContains(argument, '=')) ++i;
      continue;
    }
    const std::vector<const CLI::App*> below = CommandsBelow(*reached.command);
    const auto found = std::find_if(below.begin(), below.end(), [&](const CLI::App* command) {
      return command->check_name(argument);
    });
    if (found != below.end()) {
      reached.command = *found;
      absl::StrAppend(&reached.words, " ", argument);
    } else if (!below.empty() && reached.unknown_word.empty() && reached.unknown_option.empty()) {
      // After an unknown option it may be that option's value.
      reached.unknown_word = argument;
    }
  }
  return reached;
}

// All required options of a command that are missing.
std::string Missing(const CLI::App& command) {
  std::vector<std::string> missing;
  for (const CLI::Option* option : command.get_options()) {
    if (option->get_required() && option->count() == 0) missing.push_back(option->get_name());
  }
  if (missing.empty() && !CommandsBelow(command).empty()) {
    std::vector<std::string> names;
    for (const CLI::App* below : CommandsBelow(command)) names.push_back(below->get_name());
    return absl::StrCat("one of the commands ", absl::StrJoin(names, ", "));
  }
  return absl::StrJoin(missing, ", ");
}

std::string DidYouMean(const std::string& name) {
  return name.empty() ? "" : absl::StrCat("; did you mean ", name, "?");
}

}  // namespace

std::string ExplainWrongArguments(const CLI::App& app, const std::vector<std::string>& arguments,
                                  const CLI::ParseError& error) {
  const Reached reached = Follow(app, arguments);
  const std::string more = absl::StrCat("`", reached.words, " --help` says more.\n");
  std::string text;
  if (!reached.unknown_word.empty()) {
    std::vector<std::string> names;
    for (const CLI::App* command : CommandsBelow(*reached.command)) {
      names.push_back(command->get_name());
    }
    absl::StrAppend(&text, "\"", reached.unknown_word, "\" is no command of ", reached.words,
                    DidYouMean(LikelyName(reached.unknown_word, names)),
                    "\ncommands: ", absl::StrJoin(names, ", "), "\n");
  } else if (!reached.unknown_option.empty()) {
    std::vector<std::string> names;
    for (const CLI::Option* option : reached.command->get_options()) {
      for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
      // "--no-pictures" of a flag that is true otherwise.
      for (const std::string& name : option->get_fnames()) {
        if (name.size() > 1) names.push_back("--" + name);
      }
    }
    absl::StrAppend(&text, reached.unknown_option, " is no option of ", reached.words,
                    DidYouMean(LikelyName(reached.unknown_option, names)), "\n");
  } else if (const std::string missing = Missing(*reached.command);
             dynamic_cast<const CLI::RequiredError*>(&error) != nullptr && !missing.empty()) {
    absl::StrAppend(&text, reached.words, " needs ", missing, "\n");
  } else {
    absl::StrAppend(&text, error.what(), "\n");
  }
  return WrapText(absl::StrCat(app.get_name(), ": ", text, more), kHelpColumns, "  ");
}

}  // namespace sightline
