// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "core/triangulation/error_model.h"
#include "core/triangulation/triangulation.h"

namespace sightline {
namespace {

// Taylor series in one variable up to its third power.
struct Series {
  Series() = default;
  explicit Series(double constant) : c{constant, 0, 0, 0} {}
  Series(double constant, double slope) : c{constant, slope, 0, 0} {}

  std::array<double, 4> c = {};

  friend Series operator+(Series a, const Series& b) {
    for (int i = 0; i < 4; ++i) a.c[i] += b.c[i];
    return a;
  }
  friend Series operator-(Series a, const Series& b) {
    for (int i = 0; i < 4; ++i) a.c[i] -= b.c[i];
    return a;
  }
  friend Series operator*(const Series& a, const Series& b) {
    Series product;
    for (int i = 0; i < 4; ++i) {
      for (int j = 0; j <= i; ++j) product.c[i] += a.c[j] * b.c[i - j];
    }
    return product;
  }
  friend Series operator/(const Series& a, const Series& b) {
    Series quotient;
    for (int i = 0; i < 4; ++i) {
      double rest = a.c[i];
      for (int j = 0; j < i; ++j) rest -= quotient.c[j] * b.c[i - j];
      quotient.c[i] = rest / b.c[0];
    }
    return quotient;
  }
  friend Series operator+(Series a, double b) {
    a.c[0] += b;
    return a;
  }
  friend Series operator*(Series a, double b) {
    for (double& value : a.c) value *= b;
    return a;
  }
};

// The point [m, camera axes] as a series in s, with the errors s `direction`. Column i: factor of
// s^i.
Eigen::Matrix<double, 3, 4> PointSeries(const ErrorModel& model,
                                        const TriangulationErrors& direction) {
  std::array<Series, kTriangulationVariables> errors;
  for (int i = 0; i < kTriangulationVariables; ++i) errors[i] = Series(0, direction[i]);
  const TriangulatedPoint<Series> point = TriangulateWithErrors<Series>(model, errors);
  Eigen::Matrix<double, 3, 4> result;
  for (int i = 0; i < 3; ++i) {
    for (int power = 0; power < 4; ++power) result(i, power) = point.in_camera[i].c[power];
  }
  return result;
}

// Columns L_k with Sigma = sum_k L_k L_k': errors are sum_k L_k xi_k with independent standard
// normal xi_k. As many as the rank. On the correlation matrix, since variances of radians and
// pixels are of different magnitude.
std::vector<TriangulationErrors> Factor(const TriangulationCovariance& covariance) {
  const TriangulationErrors deviation = covariance.diagonal().cwiseMax(0).cwiseSqrt();
  TriangulationCovariance correlation;
  for (int i = 0; i < kTriangulationVariables; ++i) {
    for (int j = 0; j < kTriangulationVariables; ++j) {
      const double scale = deviation[i] * deviation[j];
      correlation(i, j) = scale > 0 ? 0.5 * (covariance(i, j) + covariance(j, i)) / scale : 0;
    }
  }
  const Eigen::LDLT<TriangulationCovariance> ldlt(correlation);
  const TriangulationCovariance lower = ldlt.matrixL();
  const TriangulationCovariance factor = ldlt.transpositionsP().transpose() * lower;
  std::vector<TriangulationErrors> columns;
  for (int k = 0; k < kTriangulationVariables; ++k) {
    // Rounding of 14 operations on numbers up to 1.
    if (!(ldlt.vectorD()[k] > 1e-14)) continue;
    columns.emplace_back(std::sqrt(ldlt.vectorD()[k]) * factor.col(k).cwiseProduct(deviation));
  }
  return columns;
}

// Largest |u_2/u_1 - 1| of the standard deviations u = (a' C a)^1/2 along any direction a, from the
// generalised eigenvalues of C_2 a = lambda C_1 a.
double LargestDifference(const Eigen::Matrix3d& first, const Eigen::Matrix3d& second) {
  const double largest =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(first, Eigen::EigenvaluesOnly)
          .eigenvalues()[2];
  if (!(largest > 0)) return 0;
  // A point that detection errors alone move stays on the sheet: both covariances are singular.
  const Eigen::Matrix3d floor = 1e-6 * largest * Eigen::Matrix3d::Identity();
  // Divided by the largest variance, so that small lengths do not matter to the solver.
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::Matrix3d> solver(
      (second + floor) / largest, (first + floor) / largest, Eigen::EigenvaluesOnly);
  double difference = 0;
  for (const double lambda : solver.eigenvalues()) {
    difference = std::max(difference, std::abs(std::sqrt(std::max(lambda, 0.0)) - 1));
  }
  return difference;
}

}  // namespace

// Along standard normal xi, X = X_0 + a_k xi_k + 1/2 h_kl xi_k xi_l + 1/6 t_klm xi_k xi_l xi_m. The
// mixed derivatives come from series along sums and differences of two columns: with c_2, c_3 the
// second and third coefficients,
//   h_kl  = (c_2(k+l) - c_2(k-l)) / 2
//   t_kkl = c_3(k+l) - c_3(k-l) - 2 c_3(l),   t_kll = c_3(k+l) + c_3(k-l) - 2 c_3(k).
// This is exact: no step has to be chosen.
PointUncertainty PropagateUncertainty(const TriangulationSetup& setup,
                                      const Eigen::Vector2d& image_px,
                                      const TriangulationCovariance& covariance) {
  PointUncertainty result;
  result.covariance_m2 = FirstOrderCovariance(setup, image_px, covariance);
  if (!result.covariance_m2.allFinite()) {
    constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
    result.second_order_shift_m.setConstant(kNan);
    result.second_order_covariance_m2.setConstant(kNan);
    result.second_order_difference = std::numeric_limits<double>::infinity();
    return result;
  }
  const ErrorModel model(setup, image_px);
  const std::vector<TriangulationErrors> columns = Factor(covariance);
  const size_t count = columns.size();
  std::vector<Eigen::Matrix<double, 3, 4>> own(count);
  for (size_t k = 0; k < count; ++k) own[k] = PointSeries(model, columns[k]);

  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  Eigen::Matrix3d curvature = Eigen::Matrix3d::Zero();   // 1/2 sum_kl h_kl h_kl'
  std::vector<Eigen::Vector3d> contracted_third(count);  // sum_k t_kkl
  for (size_t k = 0; k < count; ++k) {
    const Eigen::Vector3d h = 2 * own[k].col(2);
    shift += 0.5 * h;
    curvature += 0.5 * h * h.transpose();
    contracted_third[k] = 6 * own[k].col(3);
  }
  for (size_t k = 0; k < count; ++k) {
    for (size_t l = k + 1; l < count; ++l) {
      const Eigen::Matrix<double, 3, 4> sum = PointSeries(model, columns[k] + columns[l]);
      const Eigen::Matrix<double, 3, 4> difference = PointSeries(model, columns[k] - columns[l]);
      const Eigen::Vector3d h = 0.5 * (sum.col(2) - difference.col(2));
      curvature += h * h.transpose();
      contracted_third[l] += sum.col(3) - difference.col(3) - 2 * own[l].col(3);
      contracted_third[k] += sum.col(3) + difference.col(3) - 2 * own[k].col(3);
    }
  }
  Eigen::Matrix3d correction = curvature;
  for (size_t k = 0; k < count; ++k) {
    const Eigen::Matrix3d product = 0.5 * own[k].col(1) * contracted_third[k].transpose();
    correction += product + product.transpose();
  }
  const Eigen::Matrix3d to_setup = model.to_camera.transpose();
  result.second_order_shift_m = to_setup * shift;
  result.second_order_covariance_m2 =
      result.covariance_m2 + to_setup * correction * model.to_camera;
  const Eigen::Vector3d ray = model.Ray();
  const double depth_m = model.sheet_normal.dot(model.source) / model.sheet_normal.dot(ray);
  const double depth_variance_m2 =
      setup.camera.z_axis.dot(result.covariance_m2 * setup.camera.z_axis);
  const bool in_front = depth_m * depth_m >= 9 * depth_variance_m2;
  result.second_order_difference =
      in_front && result.second_order_covariance_m2.allFinite()
          ? LargestDifference(result.covariance_m2, result.second_order_covariance_m2)
          : std::numeric_limits<double>::infinity();
  return result;
}

}  // namespace sightline
