// SPDX-License-Identifier: Apache-2.0
#include "core/tolerance/qif/qif_units.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>

#include "absl/strings/ascii.h"
#include "absl/strings/cord.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"
#include "core/text/number.h"

namespace sightline {
namespace {

struct NamedUnit {
  const char* name;  // lower case
  double factor;     // to metres or radians
};

// Length conversion of UnitConversionType (Units.xsd): foot, inch, millimeter. The others are the
// names that files of the QIF community define, SI prefixes, and both spellings.
constexpr std::array<NamedUnit, 35> kLengthUnits = {{
    {"m", 1},
    {"meter", 1},
    {"metre", 1},
    {"meters", 1},
    {"metres", 1},
    {"mm", 1e-3},
    {"millimeter", 1e-3},
    {"millimetre", 1e-3},
    {"millimeters", 1e-3},
    {"millimetres", 1e-3},
    {"cm", 1e-2},
    {"centimeter", 1e-2},
    {"centimetre", 1e-2},
    {"centimeters", 1e-2},
    {"centimetres", 1e-2},
    {"um", 1e-6},
    {"\u00b5m", 1e-6},  // micro sign
    {"\u03bcm", 1e-6},  // Greek small letter mu
    {"micron", 1e-6},
    {"microns", 1e-6},
    {"micrometer", 1e-6},
    {"micrometre", 1e-6},
    {"micrometers", 1e-6},
    {"micrometres", 1e-6},
    {"km", 1e3},
    {"kilometer", 1e3},
    {"kilometre", 1e3},
    {"in", 0.0254},
    {"inch", 0.0254},
    {"inches", 0.0254},
    {"\"", 0.0254},
    {"ft", 0.3048},
    {"foot", 0.3048},
    {"feet", 0.3048},
    {"uin", 0.0254e-6},
}};

constexpr double kDegree = std::numbers::pi / 180;
constexpr std::array<NamedUnit, 15> kAngleUnits = {{
    {"rad", 1},
    {"radian", 1},
    {"radians", 1},
    {"mrad", 1e-3},
    {"milliradian", 1e-3},
    {"deg", kDegree},
    {"degree", kDegree},
    {"degrees", kDegree},
    {"\u00b0", kDegree},
    {"arcmin", kDegree / 60},
    {"arcminute", kDegree / 60},
    {"arcsec", kDegree / 3600},
    {"arcsecond", kDegree / 3600},
    {"gon", std::numbers::pi / 200},
    {"revolution", 2 * std::numbers::pi},
}};

// The standard's own table rounds a degree to 0.017453293; a factor of the file may do the same.
constexpr double kConversionRounding = 1e-4;
// Shorter names are symbols, in which a capital letter may be a prefix.
constexpr size_t kShortestWord = 4;

// Key of a payload of errors about the unit of lengths, for those who ask whose fault it is.
constexpr char kAboutLengthUnit[] = "sightline/qif_length_unit";

absl::Status AboutLengthUnit(absl::Status error) {
  error.SetPayload(kAboutLengthUnit, absl::Cord("1"));
  return error;
}

std::optional<double> FactorOf(std::span<const NamedUnit> units, const std::string& name) {
  // "MM" and "Inch" are other spellings of "mm" and "inch"; "Mm" would be a megametre.
  const std::string lower = absl::AsciiStrToLower(name);
  const bool capitalised = name.size() >= kShortestWord && name.substr(1) == lower.substr(1);
  if (name != lower && name != absl::AsciiStrToUpper(name) && !capitalised) return std::nullopt;
  const auto* const found = std::find_if(units.data(), units.data() + units.size(),
                                         [&](const NamedUnit& unit) { return lower == unit.name; });
  if (found == units.data() + units.size()) return std::nullopt;
  return found->factor;
}

}  // namespace

std::optional<double> MetresOfQifUnit(const std::string& name) {
  return FactorOf(kLengthUnits, name);
}

std::optional<double> RadiansOfQifUnit(const std::string& name) {
  return FactorOf(kAngleUnits, name);
}

bool IsAboutQifLengthUnit(const absl::Status& status) {
  return status.GetPayload(kAboutLengthUnit).has_value();
}

absl::Status QifUnits::ErrorAt(int64_t line, const std::string& reason) const {
  return absl::InvalidArgumentError(absl::StrCat(file_, ":", line, ": ", reason));
}

absl::StatusOr<QifUnits> QifUnits::Read(const QifElement& document, const std::string& file,
                                        const std::string& stated_length_unit) {
  QifUnits units;
  units.file_ = file;
  if (!stated_length_unit.empty()) {
    units.stated_length_ = MetresOfQifUnit(stated_length_unit);
    if (!units.stated_length_) {
      return AboutLengthUnit(absl::InvalidArgumentError(
          absl::StrCat(file, ": the length unit given for it is ",
                       QuotedExcerpt(stated_length_unit), ", must be m, cm, mm, um or inch")));
    }
  }
  const QifElement* file_units = document.Child("FileUnits");
  for (const char* list_name : {"PrimaryUnits", "OtherUnits"}) {
    const QifElement* list = file_units == nullptr ? nullptr : file_units->Child(list_name);
    if (list == nullptr) continue;
    const bool primary = list_name == std::string_view("PrimaryUnits");
    std::map<std::string, int64_t> lines;  // of the primary units, by the names of their elements
    for (const QifElement& unit : list->children) {
      const bool linear = absl::EndsWith(unit.name, "LinearUnit");
      if (!linear && !absl::EndsWith(unit.name, "AngularUnit")) continue;
      if (primary) {
        const auto [first, is_new] = lines.emplace(unit.name, unit.line);
        if (!is_new) throw QifRepeated{list->name, unit.name, first->second, unit.line};
      }
      SIGHTLINE_RETURN_IF_ERROR(units.Add(unit, !linear, primary));
    }
  }
  const auto& primary = units.primary_linear_;
  if (units.stated_length_ && primary && primary->factor) {
    return AboutLengthUnit(units.ErrorAt(
        primary->line, absl::StrCat("<LinearUnit>: the file states its unit, ", primary->name,
                                    "; none may be given besides (--unit of `sightline part`, "
                                    "tolerances.unit of an inspection)")));
  }
  return units;
}

absl::Status QifUnits::Add(const QifElement& unit, bool angle, bool primary) {
  const std::string tag = absl::StrCat("<", unit.name, ">: ");
  // The optional SIUnitName is fixed by the schema.
  const char* const si_name = angle ? "radian" : "meter";
  if (const QifElement* si = unit.Child("SIUnitName"); si != nullptr && si->text != si_name) {
    return ErrorAt(si->line, absl::StrCat(tag, "SIUnitName is ", QuotedExcerpt(si->text),
                                          "; must be ", si_name));
  }
  Unit read;
  read.name = unit.ChildText("UnitName");
  read.line = unit.line;
  if (read.name.empty()) return ErrorAt(unit.line, tag + "<UnitName> is missing");
  read.factor = angle ? RadiansOfQifUnit(read.name) : MetresOfQifUnit(read.name);
  if (const QifElement* conversion = unit.Child("UnitConversion")) {
    const QifElement* element = conversion->Child("Factor");
    if (element == nullptr) return ErrorAt(conversion->line, tag + "<Factor> is missing");
    const auto factor = ParseReal(element->text);
    if (!factor.ok() || !(*factor > 0)) {
      return ErrorAt(element->line, absl::StrCat(tag, "<Factor> is ", QuotedExcerpt(element->text),
                                                 "; must be a finite number > 0"));
    }
    const QifElement* offset = conversion->Child("Offset");
    if (offset != nullptr && !(ParseReal(offset->text).value_or(1) == 0)) {
      return ErrorAt(offset->line, absl::StrCat(tag, "<Offset> is ", QuotedExcerpt(offset->text),
                                                "; a length or an angle has none but 0"));
    }
    if (read.factor && std::abs(*factor / *read.factor - 1) > kConversionRounding) {
      return ErrorAt(element->line,
                     absl::StrCat(tag, "<Factor> ", element->text, " contradicts the UnitName ",
                                  read.name, ", which is ", *read.factor, " ", si_name));
    }
    read.factor = *factor;
  }
  auto& table = angle ? angular_ : linear_;
  const auto [entry, is_new] = table.emplace(read.name, read);
  if (!is_new && entry->second.factor != read.factor) {
    return ErrorAt(unit.line, absl::StrCat(tag, "unit ", QuotedExcerpt(read.name),
                                           " is another one in line ", entry->second.line));
  }
  if (!primary) return absl::OkStatus();
  const bool pmi = absl::StartsWith(unit.name, "PMI");
  if (!pmi) (angle ? geometry_angular_ : geometry_linear_) = read;
  auto& standard = angle ? primary_angular_ : primary_linear_;
  if (!standard || pmi) standard = std::move(read);
  return absl::OkStatus();
}

QifUnits QifUnits::ForGeometry() const {
  QifUnits units = *this;
  if (geometry_linear_) units.primary_linear_ = geometry_linear_;
  units.primary_angular_ = geometry_angular_.value_or(Unit{"radian", 0, 1.0});
  return units;
}

absl::StatusOr<double> QifUnits::Scale(const QifElement& value, bool angle) const {
  const std::string tag = absl::StrCat("<", value.name, ">: ");
  const char* const help =
      angle
          ? "; the file must define it in <FileUnits>"
          : "; the file must define it in <FileUnits>, or tolerances.unit of the inspection state "
            "the unit of its lengths (--unit of `sightline part`, --tolerances-unit of `sightline "
            "new`): m, cm, mm, um, inch";
  const auto& table = angle ? angular_ : linear_;
  const auto named = value.attributes.find(angle ? "angularUnit" : "linearUnit");
  const Unit* unit = nullptr;
  if (named != value.attributes.end()) {
    const auto found = table.find(named->second);
    if (found == table.end()) {
      return ErrorAt(value.line, absl::StrCat(tag, "unit ", QuotedExcerpt(named->second),
                                              " is not defined in <FileUnits>"));
    }
    unit = &found->second;
  } else if (const auto& primary = angle ? primary_angular_ : primary_linear_; primary) {
    unit = &*primary;
  }
  if (unit != nullptr && unit->factor) return *unit->factor;
  // The stated unit stands for the one unit that the file leaves open, never for a further one.
  const bool is_primary =
      unit == nullptr || (primary_linear_ && unit->name == primary_linear_->name);
  if (!angle && stated_length_ && is_primary) return *stated_length_;
  const absl::Status error =
      unit == nullptr
          ? ErrorAt(value.line, absl::StrCat(tag, "has no unit, and <FileUnits> has no primary ",
                                             angle ? "angular" : "linear", " unit", help))
          : ErrorAt(value.line,
                    absl::StrCat(tag, "its unit ", QuotedExcerpt(unit->name), " (line ", unit->line,
                                 ") has no <UnitConversion> and is no known name", help));
  return angle ? error : AboutLengthUnit(error);
}

}  // namespace sightline
