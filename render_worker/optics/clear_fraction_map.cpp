// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optics/clear_fraction_map.h"

#include "render_worker/optics/parallel_rows.h"

namespace sightline {
namespace {

constexpr int kStep_px = 16;

double Fraction(const OpticsModel& optics, double u_m, double v_m) {
  const Pupil pupil = optics.pupil(u_m, v_m);
  const double ratio = pupil.radius_m / optics.reference_pupil_radius_m;
  return ClearFraction(pupil) * ratio * ratio;
}

}  // namespace

ClearFractionMap::ClearFractionMap(const OpticsModel& optics, const SubPixelGrid& grid,
                                   int threads) {
  if (!optics.field_dependent) {
    value_ = static_cast<float>(Fraction(optics, 0, 0));
    return;
  }
  step_ = kStep_px * grid.sub_pixels;
  nodes_ = Image<float>(grid.columns() / step_ + 2, grid.rows() / step_ + 2);
  ForIndexRanges(threads, nodes_.rows_px, [&](int begin, int end) {
    for (int row = begin; row < end; ++row) {
      for (int column = 0; column < nodes_.columns_px; ++column) {
        nodes_.At(row, column) =
            static_cast<float>(Fraction(optics, grid.U(column * step_), grid.V(row * step_)));
      }
    }
  });
}

float ClearFractionMap::At(int row, int column) const {
  if (step_ == 0) return value_;
  const int i = row / step_;
  const int j = column / step_;
  const float a = static_cast<float>(column % step_) / static_cast<float>(step_);
  const float b = static_cast<float>(row % step_) / static_cast<float>(step_);
  return (nodes_.At(i, j) * (1 - a) + nodes_.At(i, j + 1) * a) * (1 - b) +
         (nodes_.At(i + 1, j) * (1 - a) + nodes_.At(i + 1, j + 1) * a) * b;
}

}  // namespace sightline
