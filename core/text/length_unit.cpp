// SPDX-License-Identifier: Apache-2.0
#include "core/text/length_unit.h"

#include <algorithm>
#include <array>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "core/text/number.h"

namespace sightline {
namespace {

struct LengthUnit {
  const char* name;
  double metres;
  // In lower case. Capitals are another spelling of words and of `MM`, `CM`, `IN`; no unit here has
  // a prefix that a capital letter would change, as in `Mm`, which is refused.
  std::array<const char*, 7> spellings;
};

constexpr std::array<LengthUnit, 5> kLengthUnits = {{
    {"m", 1, {"meter", "metre", "meters", "metres"}},
    {"cm", 1e-2, {"centimeter", "centimetre", "centimeters", "centimetres"}},
    {"mm", 1e-3, {"millimeter", "millimetre", "millimeters", "millimetres"}},
    {"um",
     1e-6,
     {"\u00b5m" /* micro sign */, "\u03bcm" /* Greek mu */, "micron", "microns", "micrometer",
      "micrometre", "micrometers"}},
    {"inch", 0.0254, {"in", "inches", "\"", "''", "\u2033" /* double prime */}},
}};

const LengthUnit* FindLengthUnit(std::string_view text) {
  const std::string given(text);
  const std::string lower = absl::AsciiStrToLower(given);
  // `Mm` would be a megametre: short symbols have one case throughout.
  if (given.size() == 2 && given != lower && given != absl::AsciiStrToUpper(given)) return nullptr;
  const auto* const found =
      std::find_if(kLengthUnits.begin(), kLengthUnits.end(), [&](const LengthUnit& unit) {
        return lower == unit.name ||
               std::any_of(unit.spellings.begin(), unit.spellings.end(), [&](const char* spelling) {
                 return spelling != nullptr && lower == spelling;
               });
      });
  return found == kLengthUnits.end() ? nullptr : found;
}

}  // namespace

absl::StatusOr<std::string> LengthUnitNamed(std::string_view text) {
  const LengthUnit* const unit = FindLengthUnit(text);
  if (unit != nullptr) return unit->name;
  return absl::InvalidArgumentError(
      absl::StrCat("must be m, cm, mm, um or inch (also in or \"), is ", QuotedExcerpt(text)));
}

std::optional<double> MetresPerUnit(std::string_view text) {
  const LengthUnit* const unit = FindLengthUnit(text);
  if (unit == nullptr) return std::nullopt;
  return unit->metres;
}

}  // namespace sightline
