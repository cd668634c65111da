// SPDX-License-Identifier: Apache-2.0
// MERL 100 BRDF binary (Matusik et al., "A data-driven reflectance model", SIGGRAPH 2003): three
// 32-bit sizes (90 half angles theta_h in steps growing as a square, 90 theta_d, 180 phi_d), then
// three colours of that many doubles. The file holds phi_d in [0, pi), which is Helmholtz
// reciprocity; here also phi_d and pi - phi_d are averaged (mirror symmetry of an isotropic
// surface). Linear between the centres of the cells. Negative numbers mark unmeasured values: 0.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "core/file/read_file.h"
#include "render_worker/material/measured/tabulated_material.h"
#include "render_worker/material/models.h"
#include "render_worker/material/single_precision_pi.h"

namespace sightline {
namespace {

constexpr int kHalfAngles = 90;
constexpr int kDifferenceAngles = 90;
constexpr int kAzimuths = 180;
constexpr int kCells = kHalfAngles * kDifferenceAngles * kAzimuths;
// Scale from the file's numbers to the BRDF, red, green, blue (Matusik's BRDFRead).
constexpr float kScale[3] = {1.0F / 1500, 1.15F / 1500, 1.66F / 1500};
// Wavelengths of the three colours; linear in between.
constexpr double kWavelength_m[3] = {620e-9, 550e-9, 460e-9};

struct Cell {
  int below, above;
  float share;

  // `place` in cells, centres at + 1/2; held at the ends.
  Cell(float place, int cells) {
    const float centred = std::clamp(place - 0.5F, 0.0F, static_cast<float>(cells - 1));
    below = std::min(static_cast<int>(centred), cells - 2);
    above = below + 1;
    share = centred - static_cast<float>(below);
  }
};

float MerlBrdf(const std::vector<float>& table, float cos_out, float cos_in, float azimuth_rad) {
  const float sin_out = std::sqrt(std::max(0.0F, 1 - cos_out * cos_out));
  const float sin_in = std::sqrt(std::max(0.0F, 1 - cos_in * cos_in));
  const float dot =
      std::clamp(cos_out * cos_in + sin_out * sin_in * std::cos(azimuth_rad), -1.0F, 1.0F);
  const float cos_difference = std::sqrt(0.5F * (1 + dot));
  const float sin_difference = std::sqrt(0.5F * (1 - dot));
  const float cos_half =
      std::min(1.0F, 0.5F * (cos_out + cos_in) / std::max(cos_difference, 1e-6F));
  const float sin_half = std::sqrt(1 - cos_half * cos_half);
  // cos(out) - cos(in) = 2 sin(theta_h) sin(theta_d) cos(phi_d)
  const float product = 2 * sin_half * sin_difference;
  const float cos_azimuth =
      product > 1e-7F ? std::min(1.0F, std::abs(cos_out - cos_in) / product) : 0.0F;

  const Cell half(std::sqrt(std::acos(cos_half) * (180 / kPi) * kHalfAngles), kHalfAngles);
  const Cell difference(std::acos(std::min(1.0F, cos_difference)) * (180 / kPi), kDifferenceAngles);
  float sum = 0;
  const float phi_deg = std::acos(cos_azimuth) * (180 / kPi);
  for (const float phi : {phi_deg, 180 - phi_deg}) {
    // Period 180 degrees.
    const float centred = phi - 0.5F + kAzimuths;
    const int first = static_cast<int>(centred);
    const float phi_share = centred - static_cast<float>(first);
    for (int i = 0; i < 2; ++i) {
      for (int j = 0; j < 2; ++j) {
        const size_t row =
            (static_cast<size_t>(i == 0 ? half.below : half.above) * kDifferenceAngles +
             (j == 0 ? difference.below : difference.above)) *
            kAzimuths;
        const float weight = (i == 0 ? 1 - half.share : half.share) *
                             (j == 0 ? 1 - difference.share : difference.share);
        sum += weight * ((1 - phi_share) * table[row + first % kAzimuths] +
                         phi_share * table[row + (first + 1) % kAzimuths]);
      }
    }
  }
  return 0.5F * sum;
}

// Shares of red, green, blue at a wavelength.
std::array<float, 3> ColourShares(double wavelength_m) {
  if (wavelength_m >= kWavelength_m[0]) return {1, 0, 0};
  if (wavelength_m <= kWavelength_m[2]) return {0, 0, 1};
  const int upper = wavelength_m >= kWavelength_m[1] ? 0 : 1;
  const double share =
      (wavelength_m - kWavelength_m[upper + 1]) / (kWavelength_m[upper] - kWavelength_m[upper + 1]);
  std::array<float, 3> shares = {0, 0, 0};
  shares[upper] = static_cast<float>(share);
  shares[upper + 1] = static_cast<float>(1 - share);
  return shares;
}

}  // namespace

absl::StatusOr<std::shared_ptr<const Material>> ReadMerl(DetailedMaterial::Common common,
                                                         const std::string& path,
                                                         double laser_wavelength_m,
                                                         const std::string& context) {
  constexpr uint64_t kMaxFileBytes = uint64_t{64} << 20;
  const absl::StatusOr<std::string> bytes = ReadRegularFile(path, kMaxFileBytes);
  if (!bytes.ok()) {
    return absl::Status(bytes.status().code(),
                        absl::StrCat(context, ": ", bytes.status().message()));
  }
  std::istringstream file(*bytes);
  int32_t sizes[3] = {0, 0, 0};
  file.read(reinterpret_cast<char*>(sizes), sizeof(sizes));
  if (!file || sizes[0] != kHalfAngles || sizes[1] != kDifferenceAngles || sizes[2] != kAzimuths) {
    return absl::InvalidArgumentError(absl::StrCat(context, ": ", path, " has the sizes ", sizes[0],
                                                   " x ", sizes[1], " x ", sizes[2],
                                                   ", must be 90 x 90 x 180 (MERL BRDF)"));
  }
  const std::array<float, 3> laser = ColourShares(laser_wavelength_m);
  std::vector<TabulatedMaterial::Channel> channels;
  std::vector<double> numbers(kCells);
  for (int colour = 0; colour < 3; ++colour) {
    file.read(reinterpret_cast<char*>(numbers.data()),
              static_cast<std::streamsize>(numbers.size() * sizeof(double)));
    if (!file) {
      return absl::InvalidArgumentError(
          absl::StrCat(context, ": ", path, " ends early, must hold 3 x ", kCells, " doubles"));
    }
    auto table = std::make_shared<std::vector<float>>(kCells);
    for (int i = 0; i < kCells; ++i) {
      (*table)[i] = std::max(0.0F, static_cast<float>(numbers[i]) * kScale[colour]);
    }
    TabulatedMaterial::Channel channel;
    channel.brdf = [table](float cos_out, float cos_in, float azimuth_rad) {
      return MerlBrdf(*table, cos_out, cos_in, azimuth_rad);
    };
    for (int bin = 0; bin < kSpectralBins; ++bin) {
      channel.share[bin] = ColourShares(BinCentre_m(bin))[colour];
    }
    channel.laser_share = laser[colour];
    channels.push_back(std::move(channel));
  }
  if (file.peek() != std::istringstream::traits_type::eof()) {
    return absl::InvalidArgumentError(absl::StrCat(context, ": ", path, " has ", bytes->size(),
                                                   " bytes, more than 3 x ", kCells,
                                                   " doubles need: left over"));
  }
  return std::make_shared<TabulatedMaterial>(std::move(common), std::move(channels), std::nullopt);
}

}  // namespace sightline
