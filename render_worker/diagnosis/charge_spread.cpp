#include "render_worker/diagnosis/charge_spread.h"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>
#include <vector>

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
