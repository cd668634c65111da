// SPDX-License-Identifier: Apache-2.0
#include "report/page/number_text.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"

namespace sightline {
namespace {

constexpr char kDash[] = "\u2013";
constexpr char kThinSpace[] = "\u202f";

std::string WithMinusSign(std::string text) {
  return text[0] == '-' ? absl::StrCat("\u2212", text.substr(1)) : text;
}

std::string PowerOfTen(int exponent) {
  constexpr const char* kDigits[] = {"\u2070", "\u00b9", "\u00b2", "\u00b3", "\u2074",
                                     "\u2075", "\u2076", "\u2077", "\u2078", "\u2079"};
  std::string text = "10";
  if (exponent < 0) text += "\u207b";
  for (const char digit : absl::StrCat(std::abs(exponent))) text += kDigits[digit - '0'];
  return text;
}

// Unit to print, and the factor from the unit in the name to it.
struct Unit {
  double per_named = 1;
  std::string text;  // with the space before it
};

struct Prefix {
  double from;  // smallest magnitude it is used for, in the named unit
  double per_named;
  const char* text;
};

Unit Prefixed(double magnitude, const std::vector<Prefix>& prefixes) {
  for (const Prefix& prefix : prefixes) {
    if (magnitude >= prefix.from) return {prefix.per_named, absl::StrCat(kThinSpace, prefix.text)};
  }
  return {prefixes.back().per_named, absl::StrCat(kThinSpace, prefixes.back().text)};
}

enum class UnitKind { kMetre, kSecond, kWatt, kRadiance, kSpeed, kPlain };

struct Suffix {
  const char* suffix;
  UnitKind kind;
  double per_named;
  const char* text;
};

// A suffix that ends in another one comes first.
constexpr Suffix kSuffixes[] = {
    {"_electrons2_per_s", UnitKind::kPlain, 1, "\u202f(e\u207b)\u00b2/s"},
    {"_electrons2", UnitKind::kPlain, 1, "\u202f(e\u207b)\u00b2"},
    {"_electrons_per_s", UnitKind::kPlain, 1, "\u202fe\u207b/s"},
    {"_per_electron", UnitKind::kPlain, 1, "\u202f/\u202fe\u207b"},
    {"_per_tangent_m", UnitKind::kMetre, 1, ""},
    {"_w_m2_sr", UnitKind::kRadiance, 1, ""},
    {"_per_m", UnitKind::kPlain, 1, "\u202f/\u202fm"},
    {"_m_s", UnitKind::kSpeed, 1, ""},
    {"_relative", UnitKind::kPlain, 100, "\u202f%"},
    {"_fraction", UnitKind::kPlain, 100, "\u202f%"},
    {"_electrons", UnitKind::kPlain, 1, "\u202fe\u207b"},
    {"_waves", UnitKind::kPlain, 1, "\u202f\u03bb"},
    {"_deg", UnitKind::kPlain, 1, "\u00b0"},
    {"_rad", UnitKind::kPlain, 1e3, "\u202fmrad"},
    {"_hz", UnitKind::kPlain, 1, "\u202fHz"},
    {"_px", UnitKind::kPlain, 1, "\u202fpx"},
    {"_dn2", UnitKind::kPlain, 1, "\u202fDN\u00b2"},
    {"_dn", UnitKind::kPlain, 1, "\u202fDN"},
    {"_w", UnitKind::kWatt, 1, ""},
    {"_s", UnitKind::kSecond, 1, ""},
    {"_m", UnitKind::kMetre, 1, ""},
};

const Suffix* FindSuffix(const std::string& name) {
  for (const Suffix& suffix : kSuffixes) {
    if (absl::EndsWith(name, suffix.suffix)) return &suffix;
  }
  return nullptr;
}

Unit UnitOf(const std::string& name, double value) {
  const Suffix* suffix = FindSuffix(name);
  if (suffix == nullptr) return {};
  const double magnitude = std::abs(value);
  switch (suffix->kind) {
    case UnitKind::kMetre:
      return magnitude == 0
                 ? Prefixed(1e-3, {{0, 1e3, "mm"}})
                 : Prefixed(
                       magnitude,
                       {{1, 1, "m"}, {1e-4, 1e3, "mm"}, {1e-6, 1e6, "\u00b5m"}, {0, 1e9, "nm"}});
    case UnitKind::kSecond:
      return Prefixed(magnitude == 0 ? 1 : magnitude,
                      {{1, 1, "s"}, {1e-4, 1e3, "ms"}, {1e-6, 1e6, "\u00b5s"}, {0, 1e9, "ns"}});
    case UnitKind::kWatt:
      return Prefixed(magnitude == 0 ? 1 : magnitude,
                      {{1, 1, "W"}, {1e-3, 1e3, "mW"}, {0, 1e6, "\u00b5W"}});
    case UnitKind::kRadiance:
      return Prefixed(magnitude == 0 ? 1 : magnitude, {{1, 1, "W/(m\u00b2 sr)"},
                                                       {1e-3, 1e3, "mW/(m\u00b2 sr)"},
                                                       {0, 1e6, "\u00b5W/(m\u00b2 sr)"}});
    case UnitKind::kSpeed:
      return Prefixed(magnitude == 0 ? 1 : magnitude,
                      {{1, 1, "m/s"}, {1e-3, 1e3, "mm/s"}, {0, 1e6, "\u00b5m/s"}});
    case UnitKind::kPlain:
      return {suffix->per_named, suffix->text};
  }
  return {};
}

// Words of names with a text of their own.
std::string Words(const std::string& name) {
  static const std::vector<std::pair<std::string, std::string>> kSpelling = {
      {"prnu", "PRNU"},
      {"dsnu", "DSNU"},
      {"adc", "ADC"},
      {"inl", "INL"},
      {"qe", "quantum efficiency"},
      {"brdf", "BRDF"},
      {"f0", "F0"},
      {"ggx", "GGX"},
      {"m2", "M\u00b2"},
      {"rms", "RMS"},
      {"dn", "DN"}};
  std::vector<std::string> words = absl::StrSplit(name, '_', absl::SkipEmpty());
  for (std::string& word : words) {
    for (const auto& [plain, spelt] : kSpelling) {
      if (word == plain) word = spelt;
    }
  }
  return absl::StrReplaceAll(absl::StrJoin(words, " "), {{"f number", "f-number"}});
}

// Number of decimals that show two digits of the standard error.
int DecimalsFor(double standard_error) {
  const int decimals = 1 - static_cast<int>(std::floor(std::log10(standard_error)));
  return std::clamp(decimals, 0, 9);
}

}  // namespace

std::string Number(double value, int significant) {
  if (std::isnan(value)) return kDash;
  if (std::isinf(value)) return value < 0 ? "\u2212\u221e" : "\u221e";
  if (value == 0) return "0";
  // The rounded value counts: 9.999 is 10.
  const double rounded =
      std::strtod(absl::StrFormat("%.*e", significant - 1, value).c_str(), nullptr);
  const int exponent = static_cast<int>(std::floor(std::log10(std::abs(rounded)) + 1e-12));
  if (exponent < -4 || exponent >= 6) {
    const std::string mantissa =
        absl::StrFormat("%.*g", significant, rounded / std::pow(10, exponent));
    return absl::StrCat(mantissa == "1" ? "" : absl::StrCat(WithMinusSign(mantissa), "\u00b7"),
                        PowerOfTen(exponent));
  }
  // All digits before the point are written: 12345, not 1.23e4.
  return WithMinusSign(absl::StrFormat("%.*f", std::max(0, significant - 1 - exponent), rounded));
}

std::string FixedNumber(double value, int decimals) {
  if (!std::isfinite(value)) return Number(value);
  const std::string text = absl::StrFormat("%.*f", decimals, value);
  // No "-0.0".
  if (std::strtod(text.c_str(), nullptr) == 0) return absl::StrFormat("%.*f", decimals, 0.0);
  return WithMinusSign(text);
}

std::string ShortNumber(double value) {
  std::string text = Number(value, 6);
  if (text.find('.') == std::string::npos || text.find("\u00b7") != std::string::npos) return text;
  while (text.back() == '0') text.pop_back();
  if (text.back() == '.') text.pop_back();
  return text;
}

std::string ProbabilityText(double probability) {
  if (!std::isfinite(probability)) return kDash;
  if (probability < 0.001) return absl::StrCat("<", kThinSpace, "0.1", kThinSpace, "%");
  if (probability > 0.999) return absl::StrCat(">", kThinSpace, "99.9", kThinSpace, "%");
  const int decimals = probability < 0.1 || probability > 0.9 ? 1 : 0;
  return absl::StrCat(FixedNumber(100 * probability, decimals), kThinSpace, "%");
}

std::string PValueText(double p_value) {
  if (!std::isfinite(p_value)) return absl::StrCat("p = ", kDash);
  if (p_value < 1e-6) return absl::StrCat("p < ", PowerOfTen(-6));
  if (p_value < 1e-3) return absl::StrCat("p = ", Number(p_value, 1));
  return absl::StrCat("p = ", Number(p_value, 2));
}

std::string QuantityName(const std::string& name) {
  const Suffix* suffix = FindSuffix(name);
  // "fraction" and "electrons" name the quantity itself, unlike a unit.
  if (suffix != nullptr && !absl::EndsWith(name, "_fraction")) {
    return Words(name.substr(0, name.size() - std::string(suffix->suffix).size()));
  }
  return Words(name);
}

std::string EffectTitle(const std::string& id) {
  if (id == "none") return "Nothing left out";
  if (id == "unknown") return "Something not in the vocabulary";
  const size_t dot = id.find('.');
  std::string title = Words(dot == std::string::npos ? id : id.substr(dot + 1));
  if (!title.empty() && absl::ascii_isalpha(static_cast<unsigned char>(title[0])) &&
      !absl::StartsWith(title, "f-number")) {
    title[0] = absl::ascii_toupper(static_cast<unsigned char>(title[0]));
  }
  return title;
}

std::string QuantityText(const std::string& name, double value, int significant) {
  if (!std::isfinite(value)) return Number(value);
  const Unit unit = UnitOf(name, value);
  return absl::StrCat(Number(unit.per_named * value, significant), unit.text);
}

std::string SettingText(const std::string& name, double value) {
  if (!std::isfinite(value)) return Number(value);
  const Unit unit = UnitOf(name, value);
  // Six digits hide the rounding of 1e3 * 0.0051.
  return absl::StrCat(ShortNumber(unit.per_named * value), unit.text);
}

std::string QuantityWithError(const std::string& name, double value,
                              std::optional<double> standard_error) {
  if (!standard_error.has_value() || !std::isfinite(*standard_error) || *standard_error <= 0 ||
      !std::isfinite(value)) {
    return QuantityText(name, value);
  }
  const Unit unit = UnitOf(name, std::max(std::abs(value), *standard_error));
  const double shown = unit.per_named * value, error = unit.per_named * *standard_error;
  const bool fits = error >= 1e-6 && std::max(std::abs(shown), error) < 1e6;
  const std::string numbers =
      fits ? absl::StrCat(FixedNumber(shown, DecimalsFor(error)), "\u202f\u00b1\u202f",
                          FixedNumber(error, DecimalsFor(error)))
           : absl::StrCat(Number(shown), "\u202f\u00b1\u202f", Number(error, 2));
  // "(3.0 ± 0.2) %" would be stricter; tables read better without.
  return absl::StrCat(numbers, unit.text);
}

ShownUnit ShownUnitOf(const std::string& name, double magnitude) {
  const Unit unit = UnitOf(name, magnitude);
  return {unit.per_named, absl::StrReplaceAll(unit.text, {{kThinSpace, ""}})};
}

std::string QuantityInterval(const std::string& name, double lower, double upper) {
  const double magnitude = std::max(std::isfinite(lower) ? std::abs(lower) : 0.0,
                                    std::isfinite(upper) ? std::abs(upper) : 0.0);
  const Unit unit = UnitOf(name, magnitude);
  const double width = unit.per_named * (upper - lower);
  const auto text = [&](double value) {
    if (!std::isfinite(value)) return Number(value);
    if (!std::isfinite(width) || width < 1e-6 || unit.per_named * magnitude >= 1e6) {
      return Number(unit.per_named * value);
    }
    // A quarter of a 95 % interval is about the standard error.
    return FixedNumber(unit.per_named * value, DecimalsFor(0.25 * width));
  };
  return absl::StrCat(text(lower), "\u202f\u2026\u202f", text(upper), unit.text);
}

}  // namespace sightline
