#include "render_worker/diagnosis/charge_spread.h"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/integrated_speckle.h"

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
  for (int i = 0; i < kSize; ++i) {
    for (int j = 0; j < kSize; ++j) {
      Image<double> changed = around;
      changed.At(i, j) *= 1 + kStep;
      shares.At(i, j) = (middle_after(std::move(changed)) - after) / (kStep * after);
      sum += shares.At(i, j);
    }
  }
  return std::isfinite(sum) ? shares : Image<double>();
}

// Of the pixels at one place of a cell, 0 to 3 by rows.
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

bool SpreadsCharge(const Effect& effect) {
  const std::string_view id = effect.description().id;
  return id == "sensor.crosstalk" || id == "sensor.brighter_fatter" ||
         id == "unknown.charge_spread";
}

bool SpreadsByCharge(const Effect& effect) {
  return effect.description().id == "sensor.brighter_fatter";
}

Image<double> SpreadGivenLevel(const Image<double>& electrons, const StripLevel& level,
                               const ActiveEffect& effect, const FrameSetup& frame) {
  const int rows = electrons.rows_px, columns = electrons.columns_px;
  constexpr int kLevels = 8;
  constexpr double kLeastContrast = 1e-6;  // squared
  const auto neighbour = [&](int row, int column, double correlation) {
    const double f = level.factor.At(row, column), rest = 1 - correlation;
    const double mean = rest + correlation * f;
    const double variance = level.contrast_squared[row] * rest * (rest + 2 * correlation * f);
    const double contrast_squared = std::clamp(variance / (mean * mean), kLeastContrast, 1.0);
    double square = 0;
    for (const double other : SpeckleLevels(contrast_squared, kLevels)) {
      const double charge =
          std::min(level.full_electrons,
                   level.steady.At(row, column) + level.laser.At(row, column) * mean * other);
      square += charge * charge / kLevels;
    }
    return std::sqrt(square);
  };
  Image<double> spread = electrons;
  for (int column = 0; column < columns; ++column) {
    const int beside = columns > 1 ? column ^ 1 : 0;
    for (int parity = 0; parity < 2; ++parity) {
      // Every second row is looked at, in the middle; the rest are neighbours.
      Image<double> around(3, rows);
      for (int row = 0; row < rows; ++row) {
        const bool looked_at = row % 2 == parity;
        around.At(row, 1) =
            looked_at ? electrons.At(row, column) : neighbour(row, column, level.across_line[row]);
        around.At(row, 0) = neighbour(row, beside, level.along_line[row]);
        around.At(row, 2) = around.At(row, 0);
      }
      effect.effect->OnElectrons(around, frame, effect.parameters);
      for (int row = parity; row < rows; row += 2) spread.At(row, column) = around.At(row, 1);
    }
  }
  return spread;
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
    if (SpreadsCharge(*active.effect)) spreading.push_back(active);
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
