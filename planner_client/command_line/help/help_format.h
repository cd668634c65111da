// SPDX-License-Identifier: Apache-2.0
// The form of --help: at most 80 columns, defaults shown, flags as they are typed.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace sightline {

class HelpFormat : public CLI::Formatter {
 public:
  std::string make_description(const CLI::App* app) const override;
  std::string make_option_name(const CLI::Option* option, bool is_positional) const override;
  std::string make_option_opts(const CLI::Option* option) const override;
  std::string make_option_desc(const CLI::Option* option) const override;
  std::string make_subcommand(const CLI::App* command) const override;
};

}  // namespace sightline
