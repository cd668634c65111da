// SPDX-License-Identifier: Apache-2.0
// `sightline`: finds the program of a command and executes it (exec) with the same arguments.
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/process/out_of_memory.h"
#include "core/process/program_path.h"
#include "planner_client/command_line/command_table.h"
#include "planner_client/command_line/global_options.h"
#include "planner_client/command_line/process/error_line.h"
#include "planner_client/command_line/process/exit_code.h"
#include "planner_client/command_line/process/progress_line.h"

namespace sightline {
namespace {

// The command-line words up to the command, the first that is neither an option nor an option's
// value. The command's program parses the rest.
std::vector<std::string> WordsToCommand(const CLI::App& app,
                                        const std::vector<std::string>& words) {
  for (size_t i = 0; i < words.size(); ++i) {
    const std::string& word = words[i];
    if (word.empty() || word[0] != '-') {
      return {words.begin(), words.begin() + static_cast<std::ptrdiff_t>(i) + 1};
    }
    const size_t equals = word.find('=');
    const CLI::Option* const option = app.get_option_no_throw(word.substr(0, equals));
    const bool takes_value = option != nullptr && option->get_type_size() > 0;
    if (takes_value && equals == std::string::npos) ++i;
  }
  return words;
}

// Executes the program; returns the exit code with a message if that is impossible.
int Become(const CommandEntry& command, char** argv) {
  const std::string program(command.program);
  const std::string path = FindProgram(program).string();
  std::vector<char*> words;
  std::string own_name = path;
  words.push_back(own_name.data());
  for (char** word = argv + 1; *word != nullptr; ++word) words.push_back(*word);
  words.push_back(nullptr);
  execv(path.c_str(), words.data());
  const int error = errno;
  if (error == ENOENT) {
    PrintError(
        "NOT_FOUND", "",
        absl::StrCat("`sightline ", std::string(command.name), "` is carried out by the program ",
                     program, ", and there is no executable ", path, "; install the package ",
                     program == kPlanProgram ? "sightline" : program,
                     ", or in a source folder run deploy/add-program ",
                     program.substr(std::strlen("sightline-"))));
  } else {
    PrintError("INTERNAL", "", absl::StrCat(path, ": ", std::strerror(error)));
  }
  return kExitFailed;
}

int Dispatch(int argc, char** argv) {
  ReportOutOfMemory("sightline");
  CLI::App app;
  GlobalOptions options;
  SetUpCommandLine(app, "sightline", &options);
  for (const CommandEntry& command : kCommands) {
    // Its own program has its --help.
    app.add_subcommand(std::string(command.name), std::string(command.description))
        ->set_help_flag();
  }
  AddHelpExamples(app);
  if (argc < 2) {
    std::fputs(ShortHelp().c_str(), stderr);
    return kExitWrongInput;
  }
  const std::vector<std::string> words = WordsToCommand(app, {argv + 1, argv + argc});
  if (const int code = ParseCommandLine(app, words); code >= 0) return code;
  if (options.progress == "json") UseJsonProgress();
  for (const CommandEntry& command : kCommands) {
    if (words.back() == command.name) return Become(command, argv);
  }
  return kExitWrongInput;
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) { return sightline::Dispatch(argc, argv); }
