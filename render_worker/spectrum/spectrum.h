// SPDX-License-Identifier: Apache-2.0
// Spectra of incoherent light in bins of 10 nm from 360 to 830 nm.
#pragma once

#include <array>
#include <vector>

#include "absl/status/statusor.h"
#include "core/sensor/sensor.h"
#include "sightline/v1/lighting.pb.h"
#include "sightline/v1/material.pb.h"

namespace sightline {

inline constexpr int kSpectralBins = 47;
inline constexpr double kSpectrumStart_m = 360e-9;
inline constexpr double kBinWidth_m = 10e-9;

// Value per bin (mean over the bin).
using Spectrum = std::array<float, kSpectralBins>;

inline double BinCentre_m(int bin) { return kSpectrumStart_m + (bin + 0.5) * kBinWidth_m; }

// Relative spectral power per bin; sums to 1. INVALID_ARGUMENT names `context`: unknown illuminant,
// temperature outside [500, 50 000] K, table outside the range, ...
absl::StatusOr<Spectrum> ParseSourceSpectrum(const v1::SourceSpectrum& message,
                                             const std::string& context);

// Piecewise linear table, constant beyond its ends; all 1 if empty.
absl::StatusOr<Spectrum> ParseReflectanceSpectrum(
    const google::protobuf::RepeatedPtrField<v1::SpectrumPoint>& points,
    const std::string& context);

// Photo-electrons per joule at the pixel, eta(lambda) lambda / (h c), mean over every bin.
Spectrum ElectronsPerJoule(const QuantumEfficiencyCurve& curve);

// Sum over the bins of light (W) times weight (1/J).
double Integrate(const Spectrum& light, const Spectrum& weight);

}  // namespace sightline
