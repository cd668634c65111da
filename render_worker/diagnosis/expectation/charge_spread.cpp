// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/expectation/charge_spread.h"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>
#include <vector>

#include "render_worker/speckle/integrated_speckle.h"

namespace sightline {

namespace {

double ColumnSum(const Image<double>& image, int first_row, int column) {
  double sum = 0;
  for (int row = first_row; row < image.rows_px; row += 2) sum += image.At(row, column);
  return sum;
}

// Shares of the pixels around in what a pixel gets, after charge has spread: the relative change of
// its charge with theirs. Empty where there is no charge.
Image<double> ChargeShares(const Image<double>& electrons, int row, int column,
                           const FrameSetup& frame, std::span<const ActiveEffect> spreading) {
  constexpr int kReach = 2, kSize = 2 * kReach + 1;
  constexpr double kStep = 1e-3;
  Image<double> around(kSize, kSize);
  for (int i = 0; i < kSize; ++i) {
    for (int j = 0; j < kSize; ++j) {
      const int other = std::clamp(row + i - kReach, 0, electrons.rows_px - 1);
      around.At(i, j) = electrons.At(other, electrons.columns_px < 2 ? 0 : (column + j) % 2);
    }
  }
  const auto middle_after = [&](Image<double> image) {
    for (const ActiveEffect& active : spreading) {
      active.effect->OnMeanElectrons(image, nullptr, frame, active.parameters);
      active.effect->OnElectrons(image, frame, active.parameters);
    }
    return image.At(kReach, kReach);
  };
  const double after = middle_after(around);
  Image<double> shares(kSize, kSize, 0.0);
  if (!(after > 0)) return {};
  double sum = 0;
  // Each effect moves charge to the next pixel only.
  const int reach = std::min(kReach, static_cast<int>(spreading.size()));
  for (int i = 0; i < kSize; ++i) {
    for (int j = 0; j < kSize; ++j) {
      if (std::abs(i - kReach) + std::abs(j - kReach) > reach) continue;
      Image<double> changed = around;
      changed.At(i, j) *= 1 + kStep;
      shares.At(i, j) = (middle_after(std::move(changed)) - after) / (kStep * after);
      sum += shares.At(i, j);
    }
  }
  return std::isfinite(sum) ? shares : Image<double>();
}

// Speckle of the pixels at one place of a cell, 0 to 3 by rows.
std::shared_ptr<const LineSpeckle> OfCell(const LineSpeckle& speckle, int cell,
                                          const Image<double>& electrons, const FrameSetup& frame,
                                          std::span<const ActiveEffect> spreading) {
  std::vector<SpecklePixelCovariance> covariances;
  for (int place = 0; place < speckle.places(); ++place) {
    const double middle =
        speckle.PlaceCentre_m(place) / frame.sensor.pixel_pitch_m - frame.roi.row_px;
    int row = std::clamp(static_cast<int>(std::lround(middle)), 0, electrons.rows_px - 1);
    if (row % 2 != cell / 2) row = row > 0 ? row - 1 : std::min(1, electrons.rows_px - 1);
    const Image<double> shares = ChargeShares(electrons, row, cell % 2, frame, spreading);
    covariances.push_back(shares.empty() ? speckle.At(place) : speckle.At(place).Shared(shares));
  }
  return std::make_shared<const LineSpeckle>(speckle.With(std::move(covariances)));
}

}  // namespace

NeighboursOfLevel::NeighboursOfLevel(Image<double> laser, Image<double> steady,
                                     const LineSpeckle& speckle, const FrameSetup& frame,
                                     double pattern_share, double full_electrons)
    : laser_(std::move(laser)), steady_(std::move(steady)), full_electrons_(full_electrons) {
  for (int row = 0; row < laser_.rows_px; ++row) {
    const double v_m = (frame.roi.row_px + row) * frame.sensor.pixel_pitch_m;
    const SpecklePixelCovariance& here = speckle.At(speckle.PlaceOf(v_m));
    const double one = std::max(kLeastContrastSquared, here.At(0, 0));
    contrast_squared_.push_back(std::clamp(one * pattern_share, kLeastContrastSquared, 1.0));
    across_line_.push_back(std::clamp(here.At(1, 0) / one, 0.0, 1.0));
    along_line_.push_back(std::clamp(here.At(0, 1) / one, 0.0, 1.0));
  }
}

double NeighboursOfLevel::RootMeanSquare(int row, int column, double correlation, double f) const {
  constexpr int kLevels = 8;
  constexpr double kBrightest = 3;  // of these, in standard deviations above the mean
  const double rest = 1 - correlation;
  const double mean = rest + correlation * f;
  const double variance = contrast_squared_[row] * rest * (rest + 2 * correlation * f);
  const double other = steady_.At(row, column), light = laser_.At(row, column) * mean;
  const double contrast_squared = std::clamp(variance / (mean * mean), kLeastContrastSquared, 1.0);
  if (other + light * (1 + kBrightest * std::sqrt(contrast_squared)) < full_electrons_) {
    return std::sqrt(other * (other + 2 * light) + light * light * (1 + contrast_squared));
  }
  double sum = 0;
  for (const double level : SpeckleLevels(contrast_squared, kLevels)) {
    const double charge = std::min(full_electrons_, other + light * level);
    sum += charge * charge / kLevels;
  }
  return std::sqrt(sum);
}

Image<double> NeighboursOfLevel::After(const ActiveEffect& effect, const FrameSetup& frame,
                                       const Image<double>& electrons,
                                       const Image<double>& factor) const {
  Image<double> after = electrons;
  for (int column = 0; column < electrons.columns_px; ++column) {
    const int beside = electrons.columns_px > 1 ? column ^ 1 : 0;
    for (int parity = 0; parity < 2; ++parity) {
      // Evaluates every second row, in the middle; the other rows are its neighbours.
      Image<double> around(3, electrons.rows_px);
      for (int row = 0; row < around.rows_px; ++row) {
        around.At(row, 1) = row % 2 == parity ? std::min(full_electrons_, electrons.At(row, column))
                                              : RootMeanSquare(row, column, across_line_[row],
                                                               factor.At(row, column));
        around.At(row, 0) = around.At(row, 2) =
            RootMeanSquare(row, beside, along_line_[row], factor.At(row, beside));
      }
      const Image<double> before = around;
      effect.effect->OnElectrons(around, frame, effect.parameters);
      for (int row = parity; row < around.rows_px; row += 2) {
        after.At(row, column) += around.At(row, 1) - before.At(row, 1);
      }
    }
  }
  return after;
}

int BrightestCell(const Image<double>& electrons) {
  int brightest = 0;
  for (int cell = 1; cell < 4 && electrons.columns_px > 1; ++cell) {
    const auto light_of = [&](int c) { return ColumnSum(electrons, c / 2, c % 2); };
    if (light_of(cell) > light_of(brightest)) brightest = cell;
  }
  return brightest;
}

std::array<std::shared_ptr<const LineSpeckle>, 4> AfterChargeSpread(
    const LineSpeckle& speckle, const Image<double>& electrons, const FrameSetup& frame,
    std::span<const ActiveEffect> effects) {
  std::array<std::shared_ptr<const LineSpeckle>, 4> of_cell;
  std::vector<ActiveEffect> spreading;
  for (const ActiveEffect& active : effects) {
    if (active.effect->description().MovesCharge()) spreading.push_back(active);
  }
  if (spreading.empty()) return of_cell;
  const bool colour = frame.sensor.colour_filter != ColourFilter::kMono;
  for (int cell = 0; cell < 4; ++cell) {
    of_cell[cell] =
        cell > 0 && !colour ? of_cell[0] : OfCell(speckle, cell, electrons, frame, spreading);
  }
  return of_cell;
}

}  // namespace sightline
