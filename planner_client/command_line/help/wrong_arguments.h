// SPDX-License-Identifier: Apache-2.0
// What is wrong with a command line, in words that help.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace sightline {

// Of `arguments` that `app` has refused with `error` (without the program's name): which command or
// option is not known, and the one that is most like it. Ends with a line break.
std::string ExplainWrongArguments(const CLI::App& app, const std::vector<std::string>& arguments,
                                  const CLI::ParseError& error);

}  // namespace sightline
