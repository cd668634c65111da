// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor_diagnosis/fixed_pattern/smooth_course.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <vector>

namespace sightline {
namespace {

// Degree of the polynomial. Chosen to describe light that falls off towards the corners.
constexpr int kDegree = 4;
// Ridge relative to the largest diagonal element. Two by two cells of the smallest images do not
// determine all coefficients; the ridge keeps the others at zero.
constexpr double kRidge = 1e-9;

// Products of Legendre polynomials of coordinates in [-1, 1], up to the degree.
Eigen::VectorXd LegendreBasis(double x, double y) {
  double px[kDegree + 1] = {1, x}, py[kDegree + 1] = {1, y};
  for (int n = 1; n < kDegree; ++n) {
    px[n + 1] = ((2 * n + 1) * x * px[n] - n * px[n - 1]) / (n + 1);
    py[n + 1] = ((2 * n + 1) * y * py[n] - n * py[n - 1]) / (n + 1);
  }
  Eigen::VectorXd basis((kDegree + 1) * (kDegree + 2) / 2);
  Eigen::Index k = 0;
  for (int i = 0; i <= kDegree; ++i) {
    for (int j = 0; i + j <= kDegree; ++j) basis[k++] = px[i] * py[j];
  }
  return basis;
}

double Coordinate(double place_px, int size_px) { return 2 * (place_px + 0.5) / size_px - 1; }

// Pixels of a cell, the last ones excluded.
struct Cell {
  int first_row, last_row, first_column, last_column;
};

// Interquartile mean: nearly as precise as the mean, and robust against outliers. `values` is
// scratch space.
double InterquartileMean(const Image<double>& image, const Cell& cell,
                         std::vector<double>* values) {
  values->clear();
  for (int row = cell.first_row; row < cell.last_row; ++row) {
    for (int column = cell.first_column; column < cell.last_column; ++column) {
      values->push_back(image.At(row, column));
    }
  }
  std::sort(values->begin(), values->end());
  const size_t low = values->size() / 4, high = values->size() - low;
  double sum = 0;
  for (size_t k = low; k < high; ++k) sum += (*values)[k];
  return sum / static_cast<double>(high - low);
}

Eigen::VectorXd FitCoefficients(const Image<double>& image) {
  const int cells_down = std::min(kCellsPerSide, image.rows_px / 4);
  const int cells_across = std::min(kCellsPerSide, image.columns_px / 4);
  const Eigen::Index size = LegendreBasis(0, 0).size();
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(size, size);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(size);
  std::vector<double> values;
  for (int i = 0; i < cells_down; ++i) {
    for (int j = 0; j < cells_across; ++j) {
      const Cell cell{i * image.rows_px / cells_down, (i + 1) * image.rows_px / cells_down,
                      j * image.columns_px / cells_across,
                      (j + 1) * image.columns_px / cells_across};
      const Eigen::VectorXd basis = LegendreBasis(
          Coordinate(0.5 * (cell.first_column + cell.last_column - 1), image.columns_px),
          Coordinate(0.5 * (cell.first_row + cell.last_row - 1), image.rows_px));
      normal += basis * basis.transpose();
      right += basis * InterquartileMean(image, cell, &values);
    }
  }
  normal.diagonal().array() += kRidge * normal(0, 0);
  return normal.ldlt().solve(right);
}

}  // namespace

Image<double> SmoothCourse(const Image<double>& image) {
  const Eigen::VectorXd coefficients = FitCoefficients(image);
  Image<double> smooth(image.columns_px, image.rows_px);
  for (int row = 0; row < image.rows_px; ++row) {
    const double y = Coordinate(row, image.rows_px);
    for (int column = 0; column < image.columns_px; ++column) {
      smooth.At(row, column) =
          coefficients.dot(LegendreBasis(Coordinate(column, image.columns_px), y));
    }
  }
  return smooth;
}

}  // namespace sightline
