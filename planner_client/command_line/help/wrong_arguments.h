// SPDX-License-Identifier: Apache-2.0
// Explains errors of a command line, in words that help.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace sightline {

// Explains why `app` refused `arguments` (without the program's name) with `error`: which command
// or option is not known, and the one that is most like it. Ends with a line break.
std::string ExplainWrongArguments(const CLI::App& app, const std::vector<std::string>& arguments,
                                  const CLI::ParseError& error);

}  // namespace sightline
