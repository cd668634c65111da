// SPDX-License-Identifier: Apache-2.0
#include "core/command_options/option_values.h"

#include <algorithm>
#include <cstddef>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "core/text/length_unit.h"
#include "core/text/number.h"

namespace sightline {
namespace {

// Type that CLI11 shows for an option changed by TakeSizes.
constexpr char kSizeType[] = "SIZE";

// The type alone: CLI11 puts descriptions of checks behind it, as in "INT:INT in [0 - 9]".
std::string BaseType(const CLI::Option& option) {
  const std::string name = option.get_type_name();
  return name.substr(0, name.find(':'));
}

std::string Message(const absl::Status& status) { return std::string(status.message()); }

std::string WholeNumberError(std::string& text) { return Message(ParseWhole(text).status()); }

std::string UnsignedNumberError(std::string& text) { return Message(ParseUnsigned(text).status()); }

std::string RealNumberError(std::string& text) {
  const auto value = ParseReal(text);
  if (!value.ok()) return Message(value.status());
  if (!HasLeadingZeros(text)) return "";
  return "must be a decimal number without leading zeros, is " + QuotedExcerpt(text);
}

std::string SizeError(std::string& text) {
  const std::string_view all = text;
  // Digits, then the letters of a unit; CLI11 would read 0x8 as 8.
  const size_t unit = std::min(all.find_first_not_of("+-.0123456789"), all.size());
  const bool letters = std::all_of(all.begin() + static_cast<std::ptrdiff_t>(unit), all.end(),
                                   [](unsigned char c) { return absl::ascii_isalpha(c); });
  if (letters && ParseUnsigned(all.substr(0, unit)).ok()) return "";
  return "must be a whole number with or without a unit, as 512MB, is " + QuotedExcerpt(text);
}

void AddFirst(CLI::Option& option, std::string (*error_of)(std::string& text)) {
  // A transform is asked before the range checks that were added earlier.
  option.transform(CLI::Validator(error_of, /*validator_desc=*/""));
}

}  // namespace

void RequireStrictNumbers(CLI::App& app) {
  for (CLI::Option* option : app.get_options()) {
    const std::string type = BaseType(*option);
    if (type == "INT") AddFirst(*option, WholeNumberError);
    if (type == "UINT") AddFirst(*option, UnsignedNumberError);
    if (type == "FLOAT") AddFirst(*option, RealNumberError);
  }
  for (CLI::App* command : app.get_subcommands([](CLI::App*) { return true; })) {
    RequireStrictNumbers(*command);
  }
}

void NeedOption(CLI::App& app, const std::vector<std::string>& options, const std::string& needed) {
  for (const std::string& option : options) app.get_option(option)->needs(app.get_option(needed));
}

absl::Status CheckExcluded(const CLI::App& app, const std::string& option,
                           const std::vector<std::string>& others) {
  for (const std::string& other : others) {
    if (app.count(option) == 0 || app.count(other) == 0) continue;
    return absl::InvalidArgumentError(absl::StrCat(option, " and ", other, " exclude each other"));
  }
  return absl::OkStatus();
}

CLI::Validator NameOfLengthUnit() {
  return CLI::Validator(
      [](std::string& text) -> std::string {
        const auto name = LengthUnitNamed(text);
        if (!name.ok()) return Message(name.status());
        text = *name;
        return "";
      },
      /*validator_desc=*/"");
}

void TakeSizes(CLI::Option& option) {
  option.type_name(kSizeType);
  option.transform(CLI::AsSizeValue(/*kb_is_1000=*/false));
  AddFirst(option, SizeError);
}

}  // namespace sightline
