// SPDX-License-Identifier: Apache-2.0
#include "core/text/number_table.h"

#include <algorithm>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "core/status/status_macros.h"
#include "core/text/number.h"
#include "core/text/text_encoding.h"

namespace sightline {
namespace {

constexpr size_t kNumbersPerStopCheck = 1 << 16;

bool IsBlank(char c) { return c == ' ' || c == '\t'; }

std::string_view WithoutBlanks(std::string_view text) {
  while (!text.empty() && IsBlank(text.front())) text.remove_prefix(1);
  while (!text.empty() && IsBlank(text.back())) text.remove_suffix(1);
  return text;
}

// Lines of a table one after the other, without those that hold no numbers.
class TableLines {
 public:
  TableLines(std::string_view text, const NumberTableRules& rules) : text_(text), rules_(rules) {}

  // False at the end. Blanks at the end of the line are gone, a tab or blank in front is not.
  bool Next(std::string_view* line) {
    while (at_ < text_.size()) {
      const size_t end = std::min(text_.find_first_of("\r\n", at_), text_.size());
      std::string_view found = text_.substr(at_, end - at_);
      at_ = end + (text_.substr(end, 2) == "\r\n" ? 2 : 1);
      ++number_;
      while (!found.empty() && IsBlank(found.back())) found.remove_suffix(1);
      if (found.empty() || (rules_.comments && WithoutBlanks(found).front() == '#')) continue;
      const bool is_first = is_first_;
      is_first_ = false;
      if (is_first && IsHeader(found)) continue;
      *line = found;
      return true;
    }
    return false;
  }
  int number() const { return number_; }

 private:
  bool IsHeader(std::string_view line) const {
    if (rules_.columns.empty()) return false;
    const std::vector<std::string> names = absl::StrSplit(
        absl::string_view(line.data(), line.size()), absl::ByAnyChar(",; \t"), absl::SkipEmpty());
    return names == rules_.columns;
  }

  const std::string_view text_;
  const NumberTableRules& rules_;
  size_t at_ = 0;
  int number_ = 0;
  bool is_first_ = true;
};

bool IsDigit(std::string_view text, size_t place) {
  return place < text.size() && absl::ascii_isdigit(static_cast<unsigned char>(text[place]));
}

size_t DigitsAt(std::string_view text, size_t place) {
  size_t digits = 0;
  while (IsDigit(text, place + digits)) ++digits;
  return digits;
}

// Whether `line` can be one number with signs between thousands: 1.234.567,8 or 12,345. Numbers
// below a thousand have none. Nobody writes thousands behind a leading zero, nor measures more
// digits than a double holds.
bool IsOneGroupedNumber(std::string_view line, char thousands, char decimal) {
  const std::string_view text = WithoutBlanks(line);
  size_t at = !text.empty() && (text[0] == '-' || text[0] == '+') ? 1 : 0;
  const bool zero = at < text.size() && text[at] == '0';
  constexpr size_t kMostDigits = 15;
  size_t digits = DigitsAt(text, at), all_digits = digits;
  if (digits == 0) return false;
  at += digits;
  while (digits <= 3 && !zero && at < text.size() && text[at] == thousands) {
    digits = DigitsAt(text, at + 1);
    all_digits += digits;
    if (digits != 3 || all_digits > kMostDigits) return false;
    at += 1 + digits;
  }
  if (at < text.size() && text[at] == decimal) at += 1 + DigitsAt(text, at + 1);
  if (at < text.size() && (text[at] == 'e' || text[at] == 'E')) {
    ++at;
    if (at < text.size() && (text[at] == '-' || text[at] == '+')) ++at;
    at += DigitsAt(text, at);
  }
  return at == text.size();
}

// The separators that the lines of a table use.
struct Punctuation {
  bool semicolons = false, tabs = false, points = false;
  bool blanks_separate = false;    // blanks or tabs between two values, no comma beside them
  bool commas_in_numbers = false;  // a comma with digits on both sides
  bool commas_beside = false;      // any other comma
  bool several_in_a_word = false;  // 1,234,567
  bool decimal_commas = false;     // a comma that no thousands could have: 0,5  12,3456
  bool padded_integers = false;    // 0,05 or -0,5: as two whole numbers nobody writes them so
  bool one_comma_in_each_line = true;
  // Each line can be one number, with points or with commas between thousands.
  bool points_group = true, commas_group = true;

  void Add(std::string_view line) {
    points_group = points_group && IsOneGroupedNumber(line, '.', ',');
    commas_group = commas_group && IsOneGroupedNumber(line, ',', '.');
    size_t commas = 0, commas_of_word = 0;
    for (size_t i = 0; i < line.size(); ++i) {
      const char c = line[i];
      semicolons |= c == ';';
      tabs |= c == '\t';
      points |= c == '.';
      if (IsBlank(c) || c == ';') {
        commas_of_word = 0;
        if (c != ';' && i > 0 && !IsBlank(line[i - 1])) AddBlanks(line, i);
      }
      if (c != ',') continue;
      ++commas;
      if (AddComma(line, i)) several_in_a_word |= ++commas_of_word > 1;
    }
    one_comma_in_each_line &= commas == 1;
  }

 private:
  void AddBlanks(std::string_view line, size_t first) {
    size_t next = first;
    while (next < line.size() && IsBlank(line[next])) ++next;
    const auto separates = [](char c) { return c == ',' || c == ';'; };
    blanks_separate |= next < line.size() && !separates(line[first - 1]) && !separates(line[next]);
  }

  // Returns whether digits are on both sides.
  bool AddComma(std::string_view line, size_t comma) {
    size_t first = comma, behind = comma + 1;
    while (first > 0 && IsDigit(line, first - 1)) --first;
    while (IsDigit(line, behind)) ++behind;
    const size_t before = comma - first, after = behind - comma - 1;
    if (before == 0 || after == 0) {
      commas_beside = true;
      return false;
    }
    commas_in_numbers = true;
    const bool zero = before == 1 && line[first] == '0';
    decimal_commas |= after != 3 || before > 3 || line[first] == '0';
    padded_integers |=
        (after > 1 && line[comma + 1] == '0') || (zero && first > 0 && line[first - 1] == '-');
    return true;
  }
};

absl::Status TwoWays(const std::string& ways) {
  return absl::InvalidArgumentError(
      absl::StrCat("the table can be read in two ways: ", ways,
                   "; write decimal points, and tabs or semicolons between values"));
}

absl::Status WrongCell(const std::string& where, int line, size_t column, const std::string& what) {
  return absl::InvalidArgumentError(
      absl::StrCat(where, ", line ", line, ", column ", column + 1, ": ", what));
}

// Splits a line into cells; false if one but the last is empty, `cells` then ends before it.
bool SplitCells(std::string_view line, char separator, std::vector<std::string_view>* cells) {
  cells->clear();
  if (separator != ' ') {
    for (size_t at = 0; at <= line.size();) {
      const size_t end = std::min(line.find(separator, at), line.size());
      cells->push_back(WithoutBlanks(line.substr(at, end - at)));
      at = end + 1;
    }
    // Many programs end lines with a separator.
    if (cells->size() > 1 && cells->back().empty()) cells->pop_back();
    const auto empty = std::find(cells->begin(), cells->end(), std::string_view());
    const bool full = empty == cells->end();
    cells->erase(empty, cells->end());
    return full;
  }
  size_t at = 0;
  while (at < line.size()) {
    size_t tabs = 0, begin = at;
    while (begin < line.size() && IsBlank(line[begin])) tabs += line[begin++] == '\t';
    if (begin == line.size()) break;
    if (tabs > (at == 0 ? 0U : 1U)) return false;
    at = std::min(line.find_first_of(" \t", begin), line.size());
    cells->push_back(line.substr(begin, at - begin));
  }
  return true;
}

}  // namespace

absl::StatusOr<NumberTableForm> FormOfNumberTable(std::string_view text,
                                                  const NumberTableRules& rules) {
  Punctuation seen;
  TableLines lines(text, rules);
  for (std::string_view line; lines.Next(&line);) seen.Add(line);
  const bool commas = seen.commas_in_numbers || seen.commas_beside;
  // Commas as decimal signs, where another character separates.
  const auto decimal_commas = [&](char separator) -> absl::StatusOr<NumberTableForm> {
    if (seen.points) {
      return absl::InvalidArgumentError("the table has both points and commas in its numbers");
    }
    if (seen.several_in_a_word) {
      return absl::InvalidArgumentError(
          "the table has several commas in a number or mixes separators");
    }
    if (!seen.decimal_commas) return TwoWays("its commas may separate thousands or decimals");
    return NumberTableForm{separator, ','};
  };
  if (seen.semicolons) {
    if (seen.blanks_separate || seen.commas_beside) {
      return absl::InvalidArgumentError("the table mixes semicolons with other separators");
    }
    return commas ? decimal_commas(';') : NumberTableForm{';', '.'};
  }
  if (!commas) return NumberTableForm{' ', '.'};
  if (seen.blanks_separate) {
    if (seen.commas_beside) {
      return absl::InvalidArgumentError("the table mixes commas with blanks or tabs as separators");
    }
    if (!seen.tabs) {
      return TwoWays("its commas may separate values, as its blanks do, or be decimal signs");
    }
    return decimal_commas(' ');
  }
  // Nothing but commas is between values. Points do not decide it: 1.234,567 and 1,234.5 can be
  // one number or two. Whole numbers of three digits with commas between them are columns.
  if (rules.columns.empty() && seen.points && (seen.points_group || seen.commas_group)) {
    return TwoWays(
        "its commas may separate values, or stand in one number per line, before decimals or "
        "between thousands");
  }
  if (seen.points) return NumberTableForm{',', '.'};
  if (seen.commas_in_numbers && seen.commas_beside && rules.columns.empty() &&
      !seen.several_in_a_word) {
    return TwoWays("only some of its commas have blanks behind them");
  }
  if (rules.columns.empty() && seen.commas_in_numbers &&
      (seen.padded_integers || seen.one_comma_in_each_line)) {
    return TwoWays("its commas may separate whole numbers or be decimal signs");
  }
  return NumberTableForm{',', '.'};
}

absl::Status ReadNumberTable(
    std::string_view text, const NumberTableRules& rules, const std::string& where,
    const StopCheck& stop,
    absl::FunctionRef<absl::Status(int line, const std::vector<double>& values)> row) {
  const auto wrong = [&](const absl::Status& status) {
    return absl::InvalidArgumentError(absl::StrCat(where, ": ", status.message()));
  };
  const absl::StatusOr<std::string_view> unmarked = WithoutByteOrderMark(text);
  if (!unmarked.ok()) return wrong(unmarked.status());
  text = WithoutEndMarks(*unmarked);
  const absl::StatusOr<NumberTableForm> form = FormOfNumberTable(text, rules);
  if (!form.ok()) {
    // Words say more than the punctuation around them.
    TableLines lines(text, rules);
    for (std::string_view line; lines.Next(&line);) {
      if (line.find_first_not_of("0123456789+-.,;eE \t") == std::string_view::npos) continue;
      return absl::InvalidArgumentError(absl::StrCat(where, ", line ", lines.number(),
                                                     ": not numbers, is ", QuotedExcerpt(line)));
    }
    return wrong(form.status());
  }
  size_t numbers = 0, columns = rules.columns.size();
  std::vector<std::string_view> cells;
  std::vector<double> values;
  std::string point;
  TableLines lines(text, rules);
  for (std::string_view line; lines.Next(&line);) {
    if (!SplitCells(line, form->separator, &cells)) {
      return WrongCell(where, lines.number(), cells.size(), "is empty");
    }
    values.clear();
    for (const std::string_view cell : cells) {
      if (numbers++ % kNumbersPerStopCheck == 0) {
        SIGHTLINE_RETURN_IF_ERROR(CheckStop(stop));
      }
      if (numbers > rules.max_numbers) {
        return absl::InvalidArgumentError(
            absl::StrCat(where, " has more than ", rules.max_numbers, " numbers"));
      }
      absl::StatusOr<double> value = 0.0;
      if (form->decimal == ',' && cell.find(',') != std::string_view::npos) {
        point.assign(cell);
        std::replace(point.begin(), point.end(), ',', '.');
        value = ParseReal(point);
      } else {
        value = ParseReal(cell);
      }
      if (!value.ok()) {
        return WrongCell(
            where, lines.number(), values.size(),
            absl::StrCat("not a number, is ", QuotedExcerpt(cell),
                         rules.columns.empty() ? std::string()
                                               : absl::StrCat("; the columns are ",
                                                              absl::StrJoin(rules.columns, ","))));
      }
      values.push_back(*value);
    }
    if (columns == 0) columns = values.size();
    if (values.size() != columns) {
      return absl::InvalidArgumentError(absl::StrCat(
          where, ", line ", lines.number(), " has ", values.size(), " values, ",
          rules.columns.empty() ? absl::StrCat("the lines before have ", columns)
                                : absl::StrCat("must have ", absl::StrJoin(rules.columns, ","))));
    }
    SIGHTLINE_RETURN_IF_ERROR(row(lines.number(), values));
  }
  if (numbers == 0) return absl::InvalidArgumentError(absl::StrCat(where, " holds no values"));
  return absl::OkStatus();
}

}  // namespace sightline
