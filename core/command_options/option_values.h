// SPDX-License-Identifier: Apache-2.0
// Reads values of options, in the same way in all programs.
//
// CLI11 converts numbers with strtoll, strtoull and strtold: `010` becomes 8, numbers beyond 64
// bits become the largest, and `nan` passes every range check. A program therefore calls
//
//   RequireStrictNumbers(app);
//
// after all its options are added and before it parses, so that no option is forgotten.
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

// Refuses `options` without `needed`, because they have an effect only together with it.
void NeedOption(CLI::App& app, const std::vector<std::string>& options, const std::string& needed);

// INVALID_ARGUMENT if `option` is given together with any of `others`, which then have no effect.
// Called when the command runs: CLI11's own exclusion would clutter --help at both options.
absl::Status CheckExcluded(const CLI::App& app, const std::string& option,
                           const std::vector<std::string>& others);

// A transform of texts that name a length unit (core/text/length_unit.h) into the unit's name.
CLI::Validator NameOfLengthUnit();

// Lets `option`, which is read into a whole number, accept sizes such as 512MB; kB is 1024 bytes.
void TakeSizes(CLI::Option& option);

}  // namespace sightline
