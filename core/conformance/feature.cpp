// SPDX-License-Identifier: Apache-2.0
#include "core/conformance/feature.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "core/association/chebyshev_fit.h"
#include "core/random/counter_random.h"
#include "core/statistics/covariance_root.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

// Directions in which tilts and displacements of an axis are looked at, over half a turn: the worst
// of them is within 1 - cos(2.5 deg) = 0.1 % of the worst of all.
constexpr Eigen::Index kDirections = 36;
constexpr int kFormDraws = 2000;
// Pairs of targets are looked at among as many targets of the largest residual variance.
constexpr int kMostPairTargets = 512;
// cos(0.3 rad): half the angle between facets of a coarsely triangulated cylinder.
constexpr double kNormalAgreement = 0.955;

Vector3d MeanNormal(const Feature& f, int face) {
  Vector3d sum = Vector3d::Zero();
  for (const FeatureTarget& t : f.targets) {
    if (t.face == face) sum += t.normal;
  }
  return sum.normalized();
}

Vector3d MeanPosition(const Feature& f) {
  Vector3d sum = Vector3d::Zero();
  for (const FeatureTarget& t : f.targets) sum += t.position_m;
  return sum / static_cast<double>(f.targets.size());
}

// Two unit vectors perpendicular to `axis` and each other.
std::array<Vector3d, 2> Perpendicular(const Vector3d& axis) {
  const Vector3d first = axis.unitOrthogonal();
  return {first, axis.cross(first)};
}

// Largest distance of the targets from `centre` as seen along `directions`: scales slopes to
// heights, so that all parameters are lengths.
double HalfExtent(const Feature& f, const Vector3d& centre, std::initializer_list<Vector3d> along) {
  double extent = 0;
  for (const FeatureTarget& t : f.targets) {
    for (const Vector3d& a : along)
      extent = std::max(extent, std::abs(a.dot(t.position_m - centre)));
  }
  return extent;
}

double Extent(const Feature& f, const Vector3d& along) {
  double lowest = std::numeric_limits<double>::infinity(), highest = -lowest;
  for (const FeatureTarget& t : f.targets) {
    const double s = along.dot(t.position_m);
    lowest = std::min(lowest, s);
    highest = std::max(highest, s);
  }
  return highest - lowest;
}

// A fit: its design matrix and the places that describe it.
struct Model {
  Vector3d centre;
  std::array<Vector3d, 2> across;  // in the plane, or across the axis
  double scale_m = 0;              // parameters of tilt are heights at this distance
  MatrixXd design;
};

// Outward unit vector from the axis through a target.
Vector3d Radial(const Feature& f, const FeatureTarget& t) {
  const Vector3d d = t.position_m - f.axis_point_m;
  return (d - f.axis * f.axis.dot(d)).normalized();
}

Model MakeModel(const Feature& f) {
  Model m;
  m.centre = MeanPosition(f);
  const auto n = static_cast<Eigen::Index>(f.targets.size());
  switch (f.geometry) {
    case FeatureGeometry::kFreeform:
      break;
    case FeatureGeometry::kLine:
      m.scale_m = HalfExtent(f, m.centre, {f.axis});
      m.design.resize(n, 2);
      for (Eigen::Index i = 0; i < n; ++i) {
        m.design.row(i) << 1, f.axis.dot(f.targets[i].position_m - m.centre) / m.scale_m;
      }
      break;
    case FeatureGeometry::kPlane:
    case FeatureGeometry::kTwoPlanes: {
      m.across = Perpendicular(MeanNormal(f, 0));
      m.scale_m = HalfExtent(f, m.centre, {m.across[0], m.across[1]});
      m.design = MatrixXd::Zero(n, f.geometry == FeatureGeometry::kPlane ? 3 : 6);
      for (Eigen::Index i = 0; i < n; ++i) {
        const FeatureTarget& t = f.targets[i];
        const Vector3d d = (t.position_m - m.centre) / m.scale_m;
        m.design.row(i).segment<3>(t.face == 0 ? 0 : 3) << 1, m.across[0].dot(d),
            m.across[1].dot(d);
      }
      break;
    }
    case FeatureGeometry::kCylinder:
      // A displacement c of the axis and a tilt of it by the slope k raise the surface along its
      // radial direction r by c . r + z k . r; a bore's outward normal is -r.
      m.across = Perpendicular(f.axis);
      m.scale_m = HalfExtent(f, m.centre, {f.axis});
      m.design.resize(n, 5);
      for (Eigen::Index i = 0; i < n; ++i) {
        const FeatureTarget& t = f.targets[i];
        const Vector3d r = Radial(f, t);
        const double side = t.normal.dot(r) > 0 ? 1 : -1;
        const double z = f.axis.dot(t.position_m - m.centre) / m.scale_m;
        const double x = m.across[0].dot(r), y = m.across[1].dot(r);
        m.design.row(i) << side, side * x, side * y, side * z * x, side * z * y;
      }
      break;
  }
  return m;
}

// Rows of the design at the targets that lie farthest along the directions.
MatrixXd AtExtremes(const Feature& f, const Model& m, const std::vector<Vector3d>& along) {
  MatrixXd rows(static_cast<Eigen::Index>(along.size()), m.design.cols());
  for (size_t k = 0; k < along.size(); ++k) {
    size_t farthest = 0;
    for (size_t i = 1; i < f.targets.size(); ++i) {
      if (along[k].dot(f.targets[i].position_m - f.targets[farthest].position_m) > 0) farthest = i;
    }
    rows.row(static_cast<Eigen::Index>(k)) = m.design.row(static_cast<Eigen::Index>(farthest));
  }
  return rows;
}

// Rows of the measurand over the parameters of the design; empty if the geometry has none.
MatrixXd Functionals(const Feature& f, const Model& m, Measurand measurand) {
  const auto direction = [](Eigen::Index k) {
    const double angle =
        static_cast<double>(k) * std::numbers::pi / static_cast<double>(kDirections);
    return Vector2d(std::cos(angle), std::sin(angle));
  };
  MatrixXd rows;
  switch (measurand) {
    case Measurand::kDeviation:
    case Measurand::kForm:
      return rows;
    case Measurand::kPosition:
      // The variance of a fitted height is a convex function of the place: largest at corners.
      if (f.geometry == FeatureGeometry::kLine) return AtExtremes(f, m, {f.axis, -f.axis});
      if (f.geometry == FeatureGeometry::kPlane) {
        std::vector<Vector3d> along;
        for (Eigen::Index k = 0; k < 2 * kDirections; ++k) {
          along.push_back(direction(k).x() * m.across[0] + direction(k).y() * m.across[1]);
        }
        return AtExtremes(f, m, along);
      }
      if (f.geometry == FeatureGeometry::kCylinder) {
        rows.resize(2 * kDirections, 5);
        for (Eigen::Index k = 0; k < kDirections; ++k) {
          const Eigen::RowVector2d d = direction(k).transpose();
          rows.row(k) << 0, d, -d;
          rows.row(kDirections + k) << 0, d, d;
        }
      }
      return rows;
    case Measurand::kOrientation:
      if (f.geometry == FeatureGeometry::kLine) {
        rows = MatrixXd::Zero(1, 2);
        rows(0, 1) = Extent(f, f.axis) / m.scale_m;
      } else if (f.geometry == FeatureGeometry::kPlane) {
        std::vector<Vector3d> high, low;
        for (Eigen::Index k = 0; k < kDirections; ++k) {
          high.push_back(direction(k).x() * m.across[0] + direction(k).y() * m.across[1]);
          low.push_back(-high.back());
        }
        rows = AtExtremes(f, m, high) - AtExtremes(f, m, low);
      } else if (f.geometry == FeatureGeometry::kCylinder) {
        rows = MatrixXd::Zero(kDirections, 5);
        const double extent_m = Extent(f, f.axis);
        for (Eigen::Index k = 0; k < kDirections; ++k) {
          rows.row(k).tail<2>() = extent_m / m.scale_m * direction(k).transpose();
        }
      }
      return rows;
    case Measurand::kSize:
      if (f.geometry == FeatureGeometry::kCylinder) {
        rows = MatrixXd::Zero(1, 5);
        rows(0, 0) = 2;
      } else if (f.geometry == FeatureGeometry::kTwoPlanes) {
        // Along the first face's normal the second moves by its deviation times the normals'
        // product: -1 for the two sides of a wall, whose thickness then is the sum, up to the sign.
        rows = MatrixXd::Zero(1, 6);
        rows(0, 0) = 1;
        rows(0, 3) = MeanNormal(f, 0).dot(MeanNormal(f, 1)) > 0 ? -1 : 1;
      }
      return rows;
  }
  return rows;
}

absl::Status BadTarget(size_t i, absl::string_view problem) {
  return absl::InvalidArgumentError(absl::StrCat("feature target ", i, ": ", problem));
}

// CovarianceRoot of a valid covariance.
absl::StatusOr<MatrixXd> Root(const CalibrationCovariance& c, const std::string& field) {
  if (!c.allFinite() || !c.isApprox(c.transpose(), 1e-9)) {
    return absl::InvalidArgumentError(absl::StrCat(field, " is not finite and symmetric"));
  }
  for (int i = 0; i < kCalibrationVariables; ++i) {
    if (c(i, i) < 0) {
      return absl::InvalidArgumentError(
          absl::StrCat(field, ": variance ", i, " is ", c(i, i), ", must not be negative"));
    }
    if (c(i, i) == 0 && c.row(i).cwiseAbs().maxCoeff() > 0) {
      return absl::InvalidArgumentError(
          absl::StrCat(field, ": variable ", i, " has covariances but no variance"));
    }
  }
  const MatrixXd root = CovarianceRoot(c);
  // A root leaves negative eigenvalues out, so that its square then differs.
  const VectorXd deviation = c.diagonal().cwiseSqrt();
  const MatrixXd difference = (root * root.transpose() - c).cwiseAbs();
  if ((difference.array() > 1e-9 * (deviation * deviation.transpose()).array()).any()) {
    return absl::InvalidArgumentError(absl::StrCat(field, " is not positive semidefinite"));
  }
  return root;
}

// F of the targets `used`: F F' is the covariance of the common errors of their estimates. Columns
// of registration are the last ones.
absl::StatusOr<MatrixXd> CommonFactor(const Feature& f, const std::vector<int>& used) {
  std::vector<MatrixXd> roots;
  Eigen::Index columns = 0;
  for (size_t s = 0; s < f.scans.size(); ++s) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto root,
                               Root(f.scans[s].covariance, absl::StrCat("covariance of scan ", s)));
    columns += root.cols();
    roots.push_back(std::move(root));
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto common, Root(f.common_covariance, "common_covariance"));
  columns += common.cols() + f.common_deviations_m.cols() + f.registration_deviations_m.cols();

  MatrixXd factor = MatrixXd::Zero(static_cast<Eigen::Index>(used.size()), columns);
  for (size_t i = 0; i < used.size(); ++i) {
    CalibrationRow all_scans = CalibrationRow::Zero();
    Eigen::Index column = 0;
    for (size_t s = 0; s < f.scans.size(); ++s) {
      const double weight = f.scans[s].weights[used[i]];
      if (weight != 0) {
        const CalibrationRow row = weight * f.scans[s].derivatives.row(used[i]);
        factor.row(static_cast<Eigen::Index>(i)).segment(column, roots[s].cols()) = row * roots[s];
        all_scans += row;
      }
      column += roots[s].cols();
    }
    factor.row(static_cast<Eigen::Index>(i)).segment(column, common.cols()) = all_scans * common;
    column += common.cols();
    for (const MatrixXd* further : {&f.common_deviations_m, &f.registration_deviations_m}) {
      if (further->cols() == 0) continue;
      factor.row(static_cast<Eigen::Index>(i)).segment(column, further->cols()) =
          further->row(used[i]);
      column += further->cols();
    }
  }
  return factor;
}

// Correlation of the independent parts of the targets `used`; empty if they have none.
MatrixXd Correlation(const Feature& f, const std::vector<int>& used) {
  if (f.correlation_length_m <= 0) return {};
  const auto n = static_cast<Eigen::Index>(used.size());
  MatrixXd k(n, n);
  const double scale = -0.5 / (f.correlation_length_m * f.correlation_length_m);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) {
      const double squared_m2 =
          (f.targets[used[i]].position_m - f.targets[used[j]].position_m).squaredNorm();
      k(i, j) = k(j, i) = std::exp(scale * squared_m2);
    }
  }
  return k;
}

// Errors of the deviations of the targets used, in their parts.
struct JointErrors {
  VectorXd noise_m, sampling_m;  // standard deviations
  MatrixXd correlation;          // of either between targets; empty: the identity
  MatrixXd common;               // F
  Eigen::Index registration_columns = 0;

  // The parts of a sum's uncertainty, given those of noise and sampling and the sum's row of F.
  SurfaceUncertainty Of(double of_noise_m, double of_sampling_m,
                        const Eigen::RowVectorXd& of_common_m) const {
    SurfaceUncertainty u{};
    u.noise_m = of_noise_m;
    u.sampling_m = of_sampling_m;
    u.calibration_m = of_common_m.head(of_common_m.size() - registration_columns).norm();
    u.registration_m = of_common_m.tail(registration_columns).norm();
    u.total_m = std::hypot(std::hypot(u.noise_m, u.sampling_m), u.calibration_m, u.registration_m);
    return u;
  }
  VectorXd Independent() const {
    return (noise_m.array().square() + sampling_m.array().square()).sqrt();
  }
  // Uncertainty of the deviations' sum with weights w.
  SurfaceUncertainty Of(const VectorXd& w) const {
    const auto part = [&](const VectorXd& s) {
      const VectorXd ws = w.cwiseProduct(s);
      if (correlation.size() == 0) return ws.norm();
      return std::sqrt(std::max(0.0, ws.dot(correlation * ws)));
    };
    return Of(part(noise_m), part(sampling_m), w.transpose() * common);
  }
};

absl::StatusOr<JointErrors> MakeJointErrors(const Feature& f, const std::vector<int>& used) {
  JointErrors e;
  SIGHTLINE_ASSIGN_OR_RETURN(e.common, CommonFactor(f, used));
  e.registration_columns = f.registration_deviations_m.cols();
  e.correlation = Correlation(f, used);
  e.noise_m.resize(static_cast<Eigen::Index>(used.size()));
  e.sampling_m.resize(static_cast<Eigen::Index>(used.size()));
  for (size_t i = 0; i < used.size(); ++i) {
    e.noise_m[static_cast<Eigen::Index>(i)] = f.targets[used[i]].uncertainty.noise_m;
    e.sampling_m[static_cast<Eigen::Index>(i)] = f.targets[used[i]].uncertainty.sampling_m;
  }
  return e;
}

// Residuals of a fit at the toleranced targets that are used.
struct ResidualRows {
  std::vector<int> column;   // of each, among the used targets
  std::vector<int> surface;  // the range belongs to it
  MatrixXd design;
};

ResidualRows RowsOf(const FeatureFit& fit) {
  ResidualRows rows;
  std::vector<Eigen::Index> chosen;
  for (size_t i = 0; i < fit.toleranced.size(); ++i) {
    const auto found = std::lower_bound(fit.used.begin(), fit.used.end(), fit.toleranced[i]);
    if (found == fit.used.end() || *found != fit.toleranced[i]) continue;
    rows.column.push_back(static_cast<int>(found - fit.used.begin()));
    rows.surface.push_back(fit.surface_of.empty() ? 0 : fit.surface_of[i]);
    chosen.push_back(static_cast<Eigen::Index>(i));
  }
  const bool fitted = fit.design.rows() > 0;
  rows.design =
      MatrixXd::Zero(static_cast<Eigen::Index>(chosen.size()), fitted ? fit.estimator.rows() : 0);
  for (size_t k = 0; fitted && k < chosen.size(); ++k) {
    rows.design.row(static_cast<Eigen::Index>(k)) = fit.design.row(chosen[k]);
  }
  return rows;
}

// Elements of a vector, or rows of a matrix, of the used targets at the residuals' places.
template <typename Matrix>
Matrix AtRows(const Matrix& all, const std::vector<int>& column) {
  Matrix chosen(static_cast<Eigen::Index>(column.size()), all.cols());
  for (size_t k = 0; k < column.size(); ++k) {
    chosen.row(static_cast<Eigen::Index>(k)) = all.row(column[k]);
  }
  return chosen;
}

VectorXd Residuals(const FeatureFit& fit, const ResidualRows& rows, const VectorXd& h) {
  VectorXd r = AtRows(h, rows.column);
  if (rows.design.cols() > 0) r -= rows.design * (fit.estimator * h);
  return r;
}

double LargestRange(const ResidualRows& rows, const VectorXd& r) {
  if (r.size() == 0) return 0;
  const int surfaces = *std::max_element(rows.surface.begin(), rows.surface.end()) + 1;
  const auto count = static_cast<size_t>(surfaces);
  std::vector<double> low(count, std::numeric_limits<double>::infinity()), high(count, -low[0]);
  for (Eigen::Index i = 0; i < r.size(); ++i) {
    const auto s = static_cast<size_t>(rows.surface[static_cast<size_t>(i)]);
    low[s] = std::min(low[s], r[i]);
    high[s] = std::max(high[s], r[i]);
  }
  double largest = 0;
  for (size_t s = 0; s < count; ++s) largest = std::max(largest, high[s] - low[s]);
  return largest;
}

// Least 2 max |r - A p| over the parameters p of a surface's rows A, with a shift of the zone's
// middle unless it lies about the model. Twice the largest residual where rounding keeps the
// exchange algorithm from its end.
double MinimumZoneWidth(const FeatureFit& fit, const ResidualRows& rows, const VectorXd& r,
                        int surface) {
  std::vector<int> chosen;
  for (size_t i = 0; i < rows.surface.size(); ++i) {
    if (rows.surface[i] == surface) chosen.push_back(static_cast<int>(i));
  }
  if (chosen.empty()) return 0;
  MatrixXd design = AtRows(rows.design, chosen);
  if (!fit.about_model) {
    design.conservativeResize(Eigen::NoChange, design.cols() + 1);
    design.rightCols(1).setOnes();
  }
  const VectorXd own = AtRows(r, chosen);
  const auto zone = FitChebyshev(design, own);
  return 2 * (zone ? zone->deviation : own.cwiseAbs().maxCoeff());
}

// Form of least-squares residuals r: of several surfaces the largest.
double FormOf(const FeatureFit& fit, const ResidualRows& rows, const VectorXd& r) {
  if (fit.association == Association::kGauss) return LargestRange(rows, r);
  const int surfaces =
      rows.surface.empty() ? 0 : *std::max_element(rows.surface.begin(), rows.surface.end()) + 1;
  double largest = 0;
  for (int s = 0; s < surfaces; ++s) {
    largest = std::max(largest, MinimumZoneWidth(fit, rows, r, s));
  }
  return largest;
}

// Lower root of a correlation; a ridge far below any number used keeps it definite.
MatrixXd RootOfCorrelation(const MatrixXd& correlation) {
  if (correlation.size() == 0) return {};
  const Eigen::Index n = correlation.rows();
  return (correlation + 1e-10 * MatrixXd::Identity(n, n)).llt().matrixL();
}

MeasurandUncertainty PredictForm(const FeatureFit& fit, const JointErrors& errors,
                                 const ErrorDraws& draws, uint64_t seed) {
  const ResidualRows rows = RowsOf(fit);
  const auto m = static_cast<Eigen::Index>(rows.column.size());
  const MatrixXd common =
      AtRows(errors.common, rows.column) - rows.design * (fit.estimator * errors.common);
  const VectorXd independent = errors.Independent();
  double sum = 0, squares = 0;
  for (int d = 0; d < kFormDraws; ++d) {
    const double range =
        FormOf(fit, rows, Residuals(fit, rows, draws.Draw(seed, static_cast<uint64_t>(d))));
    sum += range;
    squares += range * range;
  }
  MeasurandUncertainty result;
  result.bias_m = sum / kFormDraws;
  const double spread =
      std::sqrt(std::max(0.0, (squares - sum * result.bias_m) / (kFormDraws - 1)));

  // Covariance of the residuals R E R' with R = S - A H, S the choice of the toleranced targets.
  MatrixXd e = independent.asDiagonal();
  e = errors.correlation.size() > 0 ? MatrixXd(e * errors.correlation * e) : MatrixXd(e * e);
  const MatrixXd fitted = fit.estimator * e;  // H E
  const MatrixXd mixed =
      rows.design * AtRows(MatrixXd(fitted.transpose()), rows.column).transpose();
  MatrixXd covariance =
      common * common.transpose() - mixed - mixed.transpose() +
      rows.design * (fitted * fit.estimator.transpose()) * rows.design.transpose();
  covariance += AtRows(MatrixXd(AtRows(e, rows.column).transpose()), rows.column).transpose();
  std::vector<int> order(static_cast<size_t>(m));
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(),
            [&](int a, int b) { return covariance(a, a) > covariance(b, b); });
  order.resize(std::min<size_t>(order.size(), kMostPairTargets));
  double largest = -1;
  int a = 0, b = 0;
  // About the model, the opposite of one residual takes the place of the other of a pair.
  if (fit.about_model) a = b = order.front(), order.clear();
  for (size_t i = 0; i < order.size(); ++i) {
    for (size_t j = i + 1; j < order.size(); ++j) {
      const int p = order[i], q = order[j];
      if (rows.surface[static_cast<size_t>(p)] != rows.surface[static_cast<size_t>(q)]) continue;
      const double variance = covariance(p, p) + covariance(q, q) - 2 * covariance(p, q);
      if (variance > largest) largest = variance, a = p, b = q;
    }
  }
  // The pair's difference as weights of the deviations: rows a and b of R.
  const double other = fit.about_model ? 1 : -1;
  VectorXd weights =
      -(fit.estimator.transpose() * (rows.design.row(a) + other * rows.design.row(b)).transpose());
  weights[rows.column[static_cast<size_t>(a)]] += 1;
  weights[rows.column[static_cast<size_t>(b)]] += other;
  result.u = errors.Of(weights);
  result.worst = fit.used[static_cast<size_t>(rows.column[static_cast<size_t>(a)])];
  if (spread > result.u.total_m && result.u.total_m > 0) {
    const double factor = spread / result.u.total_m;
    result.u.total_m *= factor;
    result.u.noise_m *= factor;
    result.u.sampling_m *= factor;
    result.u.calibration_m *= factor;
    result.u.registration_m *= factor;
  }
  return result;
}

// Variances of the residuals S h - A H h, for errors of standard deviations s.
VectorXd ResidualVariances(const FeatureFit& fit, const ResidualRows& rows, const VectorXd& s,
                           const MatrixXd& correlation) {
  VectorXd variance = AtRows(s, rows.column).cwiseAbs2();
  if (rows.design.cols() == 0) return variance;
  const MatrixXd scaled = fit.estimator * s.asDiagonal();
  const MatrixXd correlated = correlation.size() > 0 ? MatrixXd(scaled * correlation) : scaled;
  const MatrixXd covariance = correlated * scaled.transpose();
  for (size_t k = 0; k < rows.column.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    const Eigen::RowVectorXd a = rows.design.row(i);
    variance[i] += a.dot(a * covariance) -
                   2 * a.dot(correlated.col(rows.column[k]).transpose()) * s[rows.column[k]];
  }
  return variance.cwiseMax(0);
}

MeasurandUncertainty PredictDeviations(const FeatureFit& fit, const JointErrors& errors) {
  const ResidualRows rows = RowsOf(fit);
  const VectorXd noise = ResidualVariances(fit, rows, errors.noise_m, errors.correlation);
  const VectorXd sampling = ResidualVariances(fit, rows, errors.sampling_m, errors.correlation);
  MatrixXd common = AtRows(errors.common, rows.column);
  if (rows.design.cols() > 0) common -= rows.design * (fit.estimator * errors.common);
  MeasurandUncertainty result;
  result.target_u_m = VectorXd::Constant(static_cast<Eigen::Index>(fit.toleranced.size()),
                                         std::numeric_limits<double>::infinity());
  result.target_parts.resize(fit.toleranced.size());
  size_t k = 0;
  for (size_t i = 0; i < fit.toleranced.size() && k < rows.column.size(); ++i) {
    if (fit.used[static_cast<size_t>(rows.column[k])] != fit.toleranced[i]) continue;
    const auto row = static_cast<Eigen::Index>(k++);
    const SurfaceUncertainty u =
        errors.Of(std::sqrt(noise[row]), std::sqrt(sampling[row]), common.row(row));
    result.target_u_m[static_cast<Eigen::Index>(i)] = u.total_m;
    result.target_parts[i] = u;
    if (k == 1 || u.total_m > result.u.total_m) result.u = u, result.worst = fit.toleranced[i];
  }
  return result;
}

// The functional of the largest uncertainty. Covariances of the few parameters come first, since
// there are many functionals of them.
MeasurandUncertainty PredictFunctionals(const FeatureFit& fit, const JointErrors& errors) {
  const auto part = [&](const VectorXd& s) {
    const MatrixXd scaled = fit.estimator * s.asDiagonal();
    const MatrixXd covariance = errors.correlation.size() > 0
                                    ? MatrixXd(scaled * errors.correlation * scaled.transpose())
                                    : MatrixXd(scaled * scaled.transpose());
    return VectorXd(
        (fit.functionals * covariance).cwiseProduct(fit.functionals).rowwise().sum().cwiseMax(0));
  };
  const VectorXd noise = part(errors.noise_m), sampling = part(errors.sampling_m);
  const MatrixXd common = fit.functionals * (fit.estimator * errors.common);
  MeasurandUncertainty result;
  for (Eigen::Index k = 0; k < fit.functionals.rows(); ++k) {
    const SurfaceUncertainty u =
        errors.Of(std::sqrt(noise[k]), std::sqrt(sampling[k]), common.row(k));
    if (k == 0 || u.total_m > result.u.total_m) result.u = u, result.worst = static_cast<int>(k);
  }
  return result;
}

}  // namespace

absl::Status CheckFeature(const Feature& f) {
  const size_t n = f.targets.size();
  if (n == 0 || n > kMostFeatureTargets) {
    return absl::InvalidArgumentError(
        absl::StrCat("feature has ", n, " targets, must have 1 to ", kMostFeatureTargets));
  }
  if (n * f.scans.size() > kMostFeatureSensitivities) {
    return absl::InvalidArgumentError(
        absl::StrCat("feature has ", n, " targets and ", f.scans.size(),
                     " scans; their product must not exceed ", kMostFeatureSensitivities));
  }
  if (!(f.correlation_length_m >= 0) || !std::isfinite(f.correlation_length_m)) {
    return absl::InvalidArgumentError(absl::StrCat("correlation_length_m is ",
                                                   f.correlation_length_m,
                                                   ", must not be negative and be finite"));
  }
  const bool has_axis =
      f.geometry == FeatureGeometry::kCylinder || f.geometry == FeatureGeometry::kLine;
  if (has_axis && !(std::abs(f.axis.norm() - 1) < 1e-6 && f.axis_point_m.allFinite())) {
    return absl::InvalidArgumentError("feature axis must be a unit vector through a finite point");
  }
  const bool two = f.geometry == FeatureGeometry::kTwoPlanes;
  for (size_t i = 0; i < n; ++i) {
    const FeatureTarget& t = f.targets[i];
    if (!t.position_m.allFinite()) return BadTarget(i, "position_m is not finite");
    if (!(std::abs(t.normal.norm() - 1) < 1e-6)) return BadTarget(i, "normal is not a unit vector");
    if (t.face < 0 || t.face > (two ? 1 : 0)) {
      return BadTarget(i, absl::StrCat("face is ", t.face, ", must be 0", two ? " or 1" : ""));
    }
    const SurfaceUncertainty& u = t.uncertainty;
    if (t.used() && !(u.noise_m >= 0 && u.sampling_m >= 0 && std::isfinite(u.noise_m) &&
                      std::isfinite(u.sampling_m))) {
      return BadTarget(i, absl::StrCat("noise_m is ", u.noise_m, ", sampling_m ", u.sampling_m,
                                       ", must not be negative and be finite"));
    }
  }
  if (f.geometry == FeatureGeometry::kPlane || two) {
    for (int face = 0; face <= (two ? 1 : 0); ++face) {
      const Vector3d mean = MeanNormal(f, face);
      if (!(std::abs(mean.norm() - 1) < 1e-6)) {
        return absl::InvalidArgumentError(
            absl::StrCat("feature: face ", face, " has no targets, or normals of all directions"));
      }
      for (size_t i = 0; i < n; ++i) {
        if (f.targets[i].face == face && f.targets[i].normal.dot(mean) < kNormalAgreement) {
          return BadTarget(i, "normal is more than 0.3 rad from that of the plane");
        }
      }
    }
    if (two && std::abs(MeanNormal(f, 0).dot(MeanNormal(f, 1))) < kNormalAgreement) {
      return absl::InvalidArgumentError("feature: the two planes are not parallel");
    }
  }
  if (f.geometry == FeatureGeometry::kCylinder) {
    for (size_t i = 0; i < n; ++i) {
      const Vector3d radial = Radial(f, f.targets[i]);
      if (!(std::abs(f.targets[i].normal.dot(radial)) >= kNormalAgreement)) {
        return BadTarget(i, "normal is more than 0.3 rad from the cylinder's radial direction");
      }
    }
  }
  const auto rows = static_cast<Eigen::Index>(n);
  for (const auto& [name, deviations_m] :
       {std::pair{"common_deviations_m", &f.common_deviations_m},
        std::pair{"registration_deviations_m", &f.registration_deviations_m}}) {
    if (deviations_m->cols() == 0 || (deviations_m->rows() == rows && deviations_m->allFinite())) {
      continue;
    }
    return absl::InvalidArgumentError(absl::StrCat(name, " has ", deviations_m->rows(),
                                                   " rows for ", n, " targets, or is not finite"));
  }
  for (size_t s = 0; s < f.scans.size(); ++s) {
    const ScanSensitivity& scan = f.scans[s];
    if (scan.weights.size() != rows || scan.derivatives.rows() != rows) {
      return absl::InvalidArgumentError(absl::StrCat("scan ", s, " has ", scan.weights.size(),
                                                     " weights and ", scan.derivatives.rows(),
                                                     " rows of derivatives for ", n, " targets"));
    }
    for (size_t i = 0; i < n; ++i) {
      const auto row = static_cast<Eigen::Index>(i);
      if (scan.weights[row] == 0) continue;
      if (!std::isfinite(scan.weights[row]) || !scan.derivatives.row(row).allFinite()) {
        return absl::InvalidArgumentError(
            absl::StrCat("scan ", s, ": weight or derivatives of target ", i, " are not finite"));
      }
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<FeatureFit> FitFeature(const Feature& f, Measurand measurand) {
  SIGHTLINE_RETURN_IF_ERROR(CheckFeature(f));
  FeatureFit fit;
  for (size_t i = 0; i < f.targets.size(); ++i) {
    if (f.targets[i].used()) fit.used.push_back(static_cast<int>(i));
    fit.toleranced.push_back(static_cast<int>(i));
  }
  if (measurand == Measurand::kDeviation) return fit;
  const Model model = MakeModel(f);
  fit.design = model.design;
  fit.functionals = Functionals(f, model, measurand);
  if (f.geometry == FeatureGeometry::kFreeform ||
      (measurand != Measurand::kForm && fit.functionals.size() == 0) ||
      (measurand == Measurand::kForm && f.geometry == FeatureGeometry::kTwoPlanes)) {
    return absl::FailedPreconditionError("the feature's geometry has no such measurand");
  }
  const absl::Status undetermined = absl::FailedPreconditionError(absl::StrCat(
      "its ", fit.used.size(), " targets that are known well enough do not determine the fit of ",
      fit.design.cols(), " parameters"));
  const auto used = static_cast<Eigen::Index>(fit.used.size());
  const Eigen::Index parameters = fit.design.cols();
  if (used < parameters || !fit.design.allFinite()) return undetermined;
  const MatrixXd design = AtRows(fit.design, fit.used);
  Eigen::ColPivHouseholderQR<MatrixXd> qr(design);
  // Singular values of the design below this share of the largest are rounding of positions in
  // single precision, not geometry.
  qr.setThreshold(1e-6);
  if (qr.rank() < parameters) return undetermined;
  // Seminormal equations: A P = Q R, so that (A' A)^-1 A' = P R^-1 R'^-1 P' A'.
  const MatrixXd r = qr.matrixR().topLeftCorner(parameters, parameters);
  const MatrixXd half = r.transpose().triangularView<Eigen::Lower>().solve(
      MatrixXd(qr.colsPermutation().transpose() * design.transpose()));
  fit.estimator = qr.colsPermutation() * MatrixXd(r.triangularView<Eigen::Upper>().solve(half));
  return fit;
}

Eigen::VectorXd FitResiduals(const FeatureFit& fit, const Eigen::VectorXd& deviations_m) {
  return Residuals(fit, RowsOf(fit), deviations_m);
}

double FormDeviation(const FeatureFit& fit, const Eigen::VectorXd& deviations_m) {
  const ResidualRows rows = RowsOf(fit);
  return FormOf(fit, rows, Residuals(fit, rows, deviations_m));
}

absl::StatusOr<MeasurandUncertainty> PredictUncertainty(const Feature& f, Measurand measurand,
                                                        uint64_t seed) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto fit, FitFeature(f, measurand));
  return PredictUncertainty(f, fit, measurand, seed);
}

absl::StatusOr<MeasurandUncertainty> PredictUncertainty(const Feature& f, const FeatureFit& fit,
                                                        Measurand measurand, uint64_t seed) {
  if ((measurand == Measurand::kForm || f.correlation_length_m > 0) &&
      fit.used.size() > kMostDenseTargets) {
    return absl::InvalidArgumentError(
        absl::StrCat("feature has ", fit.used.size(),
                     " measured targets; form and correlated errors allow ", kMostDenseTargets));
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto errors, MakeJointErrors(f, fit.used));
  if (measurand == Measurand::kForm) {
    SIGHTLINE_ASSIGN_OR_RETURN(const auto draws, ErrorDraws::OfDeviations(f, fit));
    return PredictForm(fit, errors, draws, seed);
  }
  if (measurand == Measurand::kDeviation) return PredictDeviations(fit, errors);
  return PredictFunctionals(fit, errors);
}

absl::StatusOr<ErrorDraws> ErrorDraws::OfDeviations(const Feature& feature, const FeatureFit& fit) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto errors, MakeJointErrors(feature, fit.used));
  ErrorDraws draws;
  draws.independent_m_ = errors.Independent();
  draws.root_ = RootOfCorrelation(errors.correlation);
  draws.common_m_ = std::move(errors.common);
  return draws;
}

absl::StatusOr<ErrorDraws> ErrorDraws::OfParameters(const Feature& feature, const FeatureFit& fit) {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto errors, MakeJointErrors(feature, fit.used));
  const MatrixXd scaled = fit.estimator * errors.Independent().asDiagonal();
  const MatrixXd common = fit.estimator * errors.common;
  const MatrixXd covariance =
      (errors.correlation.size() > 0 ? MatrixXd(scaled * errors.correlation * scaled.transpose())
                                     : MatrixXd(scaled * scaled.transpose())) +
      common * common.transpose();
  const VectorXd deviation = covariance.diagonal().cwiseMax(0).cwiseSqrt();
  const VectorXd inverse = deviation.unaryExpr([](double s) { return s > 0 ? 1 / s : 0; });
  MatrixXd correlation = inverse.asDiagonal() * covariance * inverse.asDiagonal();
  correlation.diagonal().setOnes();
  ErrorDraws draws;
  draws.independent_m_ = VectorXd::Zero(covariance.rows());
  draws.common_m_ = deviation.asDiagonal() * RootOfCorrelation(correlation);
  return draws;
}

Eigen::VectorXd ErrorDraws::Draw(uint64_t seed, uint64_t number) const {
  CounterRandom random(seed, number);
  VectorXd own(independent_m_.size()), common(common_m_.cols());
  for (double& x : own) x = random.Normal();
  for (double& x : common) x = random.Normal();
  if (root_.size() > 0) own = root_.triangularView<Eigen::Lower>() * own;
  return own.cwiseProduct(independent_m_) + common_m_ * common;
}

int64_t ErrorDraws::Cost() const {
  constexpr int64_t kOfANormal = 20;
  return independent_m_.size() * (kOfANormal + common_m_.cols()) + root_.size();
}

}  // namespace sightline
