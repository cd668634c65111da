// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Eigenvalues>
#include <cmath>
#include <string>
#include <string_view>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "core/json/strict_json.h"
#include "core/text/number_text.h"
#include "core/triangulation/triangulation.h"

namespace sightline {
namespace {

constexpr double kTolerance = 1e-9;

std::string EntryName(int i, int j) {
  return i == j ? absl::StrCat("variance of ", kTriangulationVariableNames[i])
                : absl::StrCat("covariance of ", kTriangulationVariableNames[i], " with ",
                               kTriangulationVariableNames[j]);
}

}  // namespace

TriangulationCovariance MakeTriangulationCovariance(const TriangulationStandardDeviations& s) {
  TriangulationErrors deviation;
  deviation[kImageX] = s.detection_x_px;
  deviation[kImageY] = s.detection_y_px;
  deviation.segment<3>(kCameraAlpha).setConstant(s.camera_rotation_rad);
  deviation.segment<3>(kCameraX).setConstant(s.camera_position_m);
  deviation[kSheetTiltX] = deviation[kSheetTiltZ] = s.laser_tilt_rad;
  deviation[kSheetOffset] = s.laser_offset_m;
  deviation[kFocalLengthError] = s.focal_length_px;
  deviation[kPrincipalX] = deviation[kPrincipalY] = s.principal_point_px;
  return deviation.cwiseAbs2().asDiagonal();
}

absl::Status CheckTriangulationCovariance(const TriangulationCovariance& covariance,
                                          std::string_view field_name) {
  const std::string field(field_name);
  const auto error = [&](int i, int j, const std::string& allowed) {
    return absl::InvalidArgumentError(absl::StrCat(
        field, ": ", EntryName(i, j), " is ", NumberText(covariance(i, j)), ", must be ", allowed));
  };
  for (int i = 0; i < kTriangulationVariables; ++i) {
    if (!std::isfinite(covariance(i, i))) return error(i, i, "finite");
    if (covariance(i, i) < 0) return error(i, i, "0 or more");
  }
  const TriangulationErrors deviation = covariance.diagonal().cwiseSqrt();
  TriangulationCovariance correlation = TriangulationCovariance::Identity();
  for (int i = 0; i < kTriangulationVariables; ++i) {
    for (int j = 0; j < i; ++j) {
      for (const auto& [row, column] : {std::pair(i, j), std::pair(j, i)}) {
        if (!std::isfinite(covariance(row, column))) return error(row, column, "finite");
      }
      const double largest = deviation[i] * deviation[j];
      if (!(std::abs(covariance(i, j) - covariance(j, i)) <= kTolerance * largest)) {
        return error(i, j,
                     absl::StrCat("equal to the ", EntryName(j, i), ", which is ",
                                  NumberText(covariance(j, i)), ": a covariance is symmetric"));
      }
      // By Cauchy and Schwarz; with a variance of 0 nothing else than 0 is left.
      if (!(std::abs(covariance(i, j)) <= (1 + kTolerance) * largest)) {
        return error(i, j,
                     absl::StrCat("within +- ", NumberText(largest),
                                  ", the product of the two standard deviations"));
      }
      if (largest > 0) correlation(i, j) = correlation(j, i) = covariance(i, j) / largest;
    }
  }
  const Eigen::SelfAdjointEigenSolver<TriangulationCovariance> solver(correlation);
  if (!(solver.eigenvalues()[0] >= -kTolerance)) {
    // The largest parts of the eigenvector say which correlations do not fit together.
    const TriangulationErrors part = solver.eigenvectors().col(0).cwiseAbs();
    std::string variables;
    for (int i = 0; i < kTriangulationVariables; ++i) {
      if (part[i] < 0.5 * part.maxCoeff()) continue;
      absl::StrAppend(&variables, variables.empty() ? "" : ", ", kTriangulationVariableNames[i]);
    }
    return absl::InvalidArgumentError(
        absl::StrCat(field, ": correlations of ", variables,
                     " do not fit together: the smallest eigenvalue of the correlation matrix is ",
                     solver.eigenvalues()[0], ", must be 0 or more (positive semidefinite)"));
  }
  return absl::OkStatus();
}

}  // namespace sightline
