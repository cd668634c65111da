// SPDX-License-Identifier: Apache-2.0
// Values of options, read in one way by all programs.
//
// CLI11 converts numbers with strtoll, strtoull and strtold: `010` becomes 8, numbers beyond 64
// bits become the largest, and `nan` passes every range check. A program therefore calls
//
//   RequireStrictNumbers(app);
//
// once all its options are added and before it parses; no option can be forgotten.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "absl/status/status.h"

namespace sightline {

// Adds a check to every option of the program and of its commands that is read into a number.
// Whole numbers are decimal digits; real numbers are finite and decimal, with or without an
// exponent; neither has leading zeros. CLI::ValidationError names the option and the text.
void RequireStrictNumbers(CLI::App& app);

// Refuses `options`, which have an effect only beside `needed`, where that is not given.
void NeedOption(CLI::App& app, const std::vector<std::string>& options, const std::string& needed);

// INVALID_ARGUMENT if `option` is given beside any of `others`, which then have no effect. Called
// when the command runs: CLI11 would list what excludes what in --help, at both options.
absl::Status CheckExcluded(const CLI::App& app, const std::string& option,
                           const std::vector<std::string>& others);

// A transform of texts that name a length unit (core/text/length_unit.h) into the unit's name.
CLI::Validator NameOfLengthUnit();

// Makes `option`, which is read into a whole number, take sizes such as 512MB; kB is 1024 bytes.
void TakeSizes(CLI::Option& option);

}  // namespace sightline
