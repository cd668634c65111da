// SPDX-License-Identifier: Apache-2.0
// Tables of numbers as text: heights, refractive indices, measured BRDFs.
//
// Instruments write such tables with tabs, blanks, semicolons or commas between values and with
// points or commas as decimal signs. FormOfNumberTable decides both from the whole text. A table
// that can be read in two ways is refused, because a wrong guess changes every number:
//
//   1.5,2.5     commas separate           0,5<tab>1,5   tabs separate, commas are decimal signs
//   1 2 3       blanks separate           0,5;1,5       semicolons separate, likewise
//   0,5 1,5     refused                   1,500<tab>2,000   refused: thousands or decimals
//   1.234,567   refused: one or two values, if each line is such; likewise 1,234.5 and 1,234,567
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/status/stop_check.h"

namespace sightline {

struct NumberTableRules {
  // Names of the columns, which a first line may repeat. Empty: any number of columns, without
  // names, the same in every line.
  std::vector<std::string> columns = {};
  bool comments = false;  // lines that begin with # are skipped
  size_t max_numbers = size_t{1} << 26;
};

struct NumberTableForm {
  char separator = ' ';  // ' ' stands for blanks and tabs
  char decimal = '.';
};

// INVALID_ARGUMENT: the table can be read in two ways, or mixes separators. The message is the
// reason alone.
absl::StatusOr<NumberTableForm> FormOfNumberTable(std::string_view text,
                                                  const NumberTableRules& rules);

// Calls `row` with the number of each line and its values, in the order of the text; an error that
// it returns ends the reading. Line ends may be LF, CR LF or CR; a byte order mark of
// UTF-8 is skipped. INVALID_ARGUMENT begins with `where` (the file) and names line and column: not
// a finite decimal number, an empty cell, another number of values than before, more than
// `max_numbers`, no values at all. `stop` ends it early.
absl::Status ReadNumberTable(
    std::string_view text, const NumberTableRules& rules, const std::string& where,
    const StopCheck& stop,
    absl::FunctionRef<absl::Status(int line, const std::vector<double>& values)> row);

}  // namespace sightline
