// SPDX-License-Identifier: Apache-2.0
#include "render_worker/spectrum/spectrum.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "absl/strings/str_cat.h"
#include "core/json/strict_json.h"
#include "core/physics/constants.h"
#include "core/status/status_macros.h"
#include "core/text/number_text.h"
#include "render_worker/spectrum/illuminants.h"

namespace sightline {
namespace {

constexpr double kSpectrumEnd_m = kSpectrumStart_m + kSpectralBins * kBinWidth_m;

struct Table {
  std::vector<double> wavelength_m;
  std::vector<double> value;

  double At(double wavelength) const {
    if (wavelength <= wavelength_m.front()) return value.front();
    if (wavelength >= wavelength_m.back()) return value.back();
    const size_t above =
        static_cast<size_t>(std::upper_bound(wavelength_m.begin(), wavelength_m.end(), wavelength) -
                            wavelength_m.begin());
    const double share =
        (wavelength - wavelength_m[above - 1]) / (wavelength_m[above] - wavelength_m[above - 1]);
    return value[above - 1] + share * (value[above] - value[above - 1]);
  }
  // Exact integral of the piecewise linear function.
  double Integral(double from_m, double to_m) const {
    double sum = 0;
    double left = from_m;
    double left_value = At(from_m);
    for (const double knot : wavelength_m) {
      if (knot <= from_m || knot >= to_m) continue;
      const double knot_value = At(knot);
      sum += 0.5 * (left_value + knot_value) * (knot - left);
      left = knot;
      left_value = knot_value;
    }
    return sum + 0.5 * (left_value + At(to_m)) * (to_m - left);
  }
};

// Integral of every bin, the table being 0 beyond its ends.
std::array<double, kSpectralBins> BinIntegrals(const Table& table) {
  std::array<double, kSpectralBins> bins = {};
  for (int i = 0; i < kSpectralBins; ++i) {
    const double from = std::max(kSpectrumStart_m + i * kBinWidth_m, table.wavelength_m.front());
    const double to = std::min(kSpectrumStart_m + (i + 1) * kBinWidth_m, table.wavelength_m.back());
    if (to > from) bins[i] = table.Integral(from, to);
  }
  return bins;
}

// Gauss-Legendre, 5 points: exact to rounding for smooth spectra over 10 nm.
std::array<double, kSpectralBins> BinIntegrals(const std::function<double(double)>& power) {
  constexpr std::array<double, 5> kNode = {-0.906179845938664, -0.538469310105683, 0,
                                           0.538469310105683, 0.906179845938664};
  constexpr std::array<double, 5> kWeight = {0.236926885056189, 0.478628670499366,
                                             0.568888888888889, 0.478628670499366,
                                             0.236926885056189};
  std::array<double, kSpectralBins> bins = {};
  for (int i = 0; i < kSpectralBins; ++i) {
    for (size_t j = 0; j < kNode.size(); ++j) {
      bins[i] += 0.5 * kWeight[j] * power(BinCentre_m(i) + 0.5 * kBinWidth_m * kNode[j]);
    }
  }
  return bins;
}

Spectrum Normalised(const std::array<double, kSpectralBins>& bins) {
  double sum = 0;
  for (const double bin : bins) sum += bin;
  Spectrum spectrum;
  for (int i = 0; i < kSpectralBins; ++i) spectrum[i] = static_cast<float>(bins[i] / sum);
  return spectrum;
}

absl::StatusOr<Table> ParseTable(
    const google::protobuf::RepeatedPtrField<v1::SpectrumPoint>& points,
    const std::string& context) {
  Table table;
  for (int i = 0; i < points.size(); ++i) {
    const double wavelength = points[i].wavelength_m();
    if (!(wavelength >= 100e-9 && wavelength <= 3e-6)) {
      return absl::InvalidArgumentError(absl::StrCat(context, "[", i, "].wavelength_m is ",
                                                     NumberText(wavelength),
                                                     ", must be in [1e-7, 3e-6]"));
    }
    if (i > 0 && wavelength <= table.wavelength_m.back()) {
      return absl::InvalidArgumentError(
          absl::StrCat(context, "[", i, "].wavelength_m is ", NumberText(wavelength),
                       ", must be above the one before, ", NumberText(table.wavelength_m.back())));
    }
    if (!(points[i].value() >= 0) || !std::isfinite(points[i].value())) {
      return absl::InvalidArgumentError(absl::StrCat(
          context, "[", i, "].value is ", NumberText(points[i].value()), ", must be 0 or more"));
    }
    table.wavelength_m.push_back(wavelength);
    table.value.push_back(points[i].value());
  }
  return table;
}

absl::StatusOr<Spectrum> ParseIlluminant(const std::string& name, const std::string& context) {
  if (name == "equal_energy") return Normalised(BinIntegrals([](double) { return 1.0; }));
  if (name == "led_4000k") return Normalised(BinIntegrals(LedWhite4000K));
  if (name == "d65" || name == "fluorescent_f2") {
    const TabulatedIlluminant source = name == "d65" ? StandardIlluminantD65() : FluorescentF2();
    Table table;
    for (size_t i = 0; i < source.values.size(); ++i) {
      table.wavelength_m.push_back(source.start_m + static_cast<double>(i) * source.step_m);
      table.value.push_back(source.values[i]);
    }
    return Normalised(BinIntegrals(table));
  }
  return absl::InvalidArgumentError(
      absl::StrCat(context, ".illuminant is \"", name,
                   "\", must be equal_energy, d65, led_4000k or fluorescent_f2"));
}

}  // namespace

absl::StatusOr<Spectrum> ParseSourceSpectrum(const v1::SourceSpectrum& message,
                                             const std::string& context) {
  switch (message.kind_case()) {
    case v1::SourceSpectrum::KIND_NOT_SET:
      return ParseIlluminant("equal_energy", context);
    case v1::SourceSpectrum::kIlluminant:
      return ParseIlluminant(message.illuminant(), context);
    case v1::SourceSpectrum::kBlackbodyK: {
      const double temperature_k = message.blackbody_k();
      if (!(temperature_k >= 500 && temperature_k <= 50000)) {
        return absl::InvalidArgumentError(absl::StrCat(
            context, ".blackbody_k is ", NumberText(temperature_k), ", must be in [500, 50000]"));
      }
      return Normalised(BinIntegrals(
          [&](double wavelength_m) { return PlanckRadiance(wavelength_m, temperature_k); }));
    }
    case v1::SourceSpectrum::kTable: {
      const std::string field = absl::StrCat(context, ".table.points");
      SIGHTLINE_ASSIGN_OR_RETURN(Table table, ParseTable(message.table().points(), field));
      if (table.value.size() < 2) {
        return absl::InvalidArgumentError(
            absl::StrCat(field, " has ", table.value.size(), " points, must have at least 2"));
      }
      const std::array<double, kSpectralBins> bins = BinIntegrals(table);
      if (std::all_of(bins.begin(), bins.end(), [](double bin) { return bin <= 0; })) {
        return absl::InvalidArgumentError(
            absl::StrCat(field, " has no power between 360 and 830 nm"));
      }
      return Normalised(bins);
    }
    case v1::SourceSpectrum::kLine: {
      const double wavelength = message.line().wavelength_m();
      if (!(wavelength >= kSpectrumStart_m && wavelength < kSpectrumEnd_m)) {
        return absl::InvalidArgumentError(absl::StrCat(context, ".line.wavelength_m is ",
                                                       NumberText(wavelength),
                                                       ", must be in [3.6e-7, 8.3e-7)"));
      }
      const int bin = static_cast<int>((wavelength - kSpectrumStart_m) / kBinWidth_m);
      Spectrum spectrum = {};
      spectrum[std::min(bin, kSpectralBins - 1)] = 1;
      return spectrum;
    }
  }
  return absl::InvalidArgumentError(absl::StrCat(context, " has an unknown kind of spectrum"));
}

absl::StatusOr<Spectrum> ParseReflectanceSpectrum(
    const google::protobuf::RepeatedPtrField<v1::SpectrumPoint>& points,
    const std::string& context) {
  Spectrum spectrum;
  spectrum.fill(1);
  if (points.empty()) return spectrum;
  SIGHTLINE_ASSIGN_OR_RETURN(Table table, ParseTable(points, context));
  for (int i = 0; i < kSpectralBins; ++i) {
    const double from = kSpectrumStart_m + i * kBinWidth_m;
    spectrum[i] = static_cast<float>(table.Integral(from, from + kBinWidth_m) / kBinWidth_m);
  }
  return spectrum;
}

Spectrum ElectronsPerJoule(const QuantumEfficiencyCurve& curve) {
  // The curve may bend inside a bin: many equal steps instead of a rule for smooth functions.
  constexpr int kSteps = 20;
  Spectrum spectrum;
  for (int i = 0; i < kSpectralBins; ++i) {
    double sum = 0;
    for (int j = 0; j < kSteps; ++j) {
      const double wavelength = kSpectrumStart_m + (i + (j + 0.5) / kSteps) * kBinWidth_m;
      sum += curve.At(wavelength) * wavelength / (kPlanck_j_s * kSpeedOfLight_m_per_s);
    }
    spectrum[i] = static_cast<float>(sum / kSteps);
  }
  return spectrum;
}

double Integrate(const Spectrum& light, const Spectrum& weight) {
  double sum = 0;
  for (int i = 0; i < kSpectralBins; ++i) {
    sum += static_cast<double>(light[i]) * static_cast<double>(weight[i]);
  }
  return sum;
}

}  // namespace sightline
