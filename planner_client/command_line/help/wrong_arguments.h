// SPDX-License-Identifier: Apache-2.0
// Explains errors of a command line and suggests corrections.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace sightline {

// Explains why `app` rejected `arguments` (without the program's name) with `error`: names the
// unknown command or option and the most similar known one. Ends with a line break.
std::string ExplainWrongArguments(const CLI::App& app, const std::vector<std::string>& arguments,
                                  const CLI::ParseError& error);

}  // namespace sightline
