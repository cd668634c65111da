// SPDX-License-Identifier: Apache-2.0
#include "planner_client/command_line/help/help_format.h"

#include "absl/strings/str_replace.h"
#include "planner_client/command_line/help/terminal.h"

namespace sightline {
std::string HelpFormat::make_description(const CLI::App* app) const {
  return WrapText(Formatter::make_description(app), kHelpColumns);
}

std::string HelpFormat::make_option_name(const CLI::Option* option, bool is_positional) const {
  std::string name = Formatter::make_option_name(option, is_positional);
  // "--no-pictures{false}": the part in braces is not typed by the user.
  for (size_t open = name.find('{'); open != std::string::npos; open = name.find('{', open)) {
    const size_t close = name.find('}', open);
    name.erase(open, close == std::string::npos ? close : close - open + 1);
  }
  return name;
}

std::string HelpFormat::make_option_opts(const CLI::Option* option) const {
  // Empty lists have no default worth showing.
  return absl::StrReplaceAll(Formatter::make_option_opts(option), {{"=[]", ""}, {"={}", ""}});
}

std::string HelpFormat::make_option_desc(const CLI::Option* option) const {
  return WrapText(Formatter::make_option_desc(option), kHelpColumns - get_column_width());
}

std::string HelpFormat::make_subcommand(const CLI::App* command) const {
  std::ostringstream out;
  CLI::detail::format_help(out, command->get_display_name(true),
                           WrapText(command->get_description(), kHelpColumns - get_column_width()),
                           get_column_width());
  return out.str();
}

}  // namespace sightline
