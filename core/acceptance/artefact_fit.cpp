// SPDX-License-Identifier: Apache-2.0
#include "core/acceptance/artefact_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "core/association/surface_curvature.h"

namespace sightline {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr std::array<AcceptanceQuantityInfo, 8> kQuantities = {{
    {AcceptanceQuantityKind::kProbingSize, ArtefactKind::kSphere, "probing_size_error",
     "ISO 10360-13 P_Size.Sph.All; VDI/VDE 2634-2 P_S", "probing size error"},
    {AcceptanceQuantityKind::kProbingForm95, ArtefactKind::kSphere, "probing_form_error_95",
     "ISO 10360-13 P_Form.Sph.D95%", "probing form error, 95 % of the points"},
    {AcceptanceQuantityKind::kProbingForm997, ArtefactKind::kSphere, "probing_form_error_997",
     "VDI/VDE 2634-2 P_F", "probing form error, 99.7 % of the points"},
    {AcceptanceQuantityKind::kSphereDistance, ArtefactKind::kBallBar, "sphere_distance_error",
     "ISO 10360-13 D_CC; VDI/VDE 2634-2 SD", "sphere distance error"},
    {AcceptanceQuantityKind::kFlatness95, ArtefactKind::kPlate, "flatness_error_95",
     "ISO 10360-13 D_Form.Pla.D95%", "flatness error, 95 % of the points"},
    {AcceptanceQuantityKind::kFlatness997, ArtefactKind::kPlate, "flatness_error_997",
     "VDI/VDE 2634-2 F", "flatness error, 99.7 % of the points"},
    {AcceptanceQuantityKind::kRingDiameter, ArtefactKind::kRing, "ring_diameter_error",
     "ring gauge, no standard", "ring diameter error"},
    {AcceptanceQuantityKind::kHoleDistance, ArtefactKind::kHolePattern, "hole_distance_error",
     "no standard", "distance of holes seen in different set-ups"},
}};

constexpr double kMost = 0.997;  // VDI/VDE 2634-2: three per mille of the points may be left out
constexpr double k95 = 0.95;

std::vector<double> Distances(const NominalSurface& fitted, const SurfacePoints& points) {
  std::vector<double> distances;
  distances.reserve(points.positions_m.size());
  for (const Vector3d& p : points.positions_m) distances.push_back(SignedDistance(fitted, p));
  return distances;
}

using Pattern = std::array<Vector3d, 4>;

// Half a turn about the axis through the middle of the pattern, which lies between the set-ups.
Vector3d HalfTurn(const Vector3d& across_m) { return -across_m; }

// Bores of the second set-up in the order and coordinates of the first, before they are joined.
Pattern TurnedBack(const Pattern& second) {
  Pattern turned;
  for (int k = 0; k < 4; ++k) {
    turned[static_cast<size_t>(k)] = HalfTurn(second[static_cast<size_t>(OppositeBore(k))]);
  }
  return turned;
}

// Shift and small turn about `axis` through the origin that bring `from` nearest to `to` by least
// squares, applied to bore 2. All vectors are across the axis; `places` are the nominal ones, whose
// mean is the origin.
Vector3d Joined(const Pattern& places, const Vector3d& axis, const Pattern& from,
                const Pattern& to) {
  Vector3d shift = Vector3d::Zero();
  double turn = 0, squares = 0;
  for (size_t k = 0; k < 4; ++k) {
    shift += (to[k] - from[k]) / 4;
    turn += axis.cross(places[k]).dot(to[k] - from[k]);
    squares += places[k].squaredNorm();
  }
  return from[2] + shift + turn / squares * axis.cross(places[2]);
}

Pattern PlacesOf(const Artefact& pattern) {
  Pattern places;
  for (size_t k = 0; k < 4; ++k) places[k] = pattern.surfaces[k].nominal.point_m;
  return places;
}

// Displacement of the fitted axis, across the nominal one, in the middle of the bore.
Vector3d DisplacementOf(const NominalSurface& fitted, const NominalSurface& nominal) {
  const Vector3d& axis = nominal.axis;
  const double along = axis.dot(nominal.point_m - fitted.point_m) / axis.dot(fitted.axis);
  return fitted.point_m + along * fitted.axis - nominal.point_m;
}

double HoleDistanceError(const Artefact& pattern, const std::vector<NominalSurface>& fitted) {
  const Pattern places = PlacesOf(pattern);
  Pattern first, second;
  for (size_t k = 0; k < 4; ++k) {
    first[k] = DisplacementOf(fitted[k], pattern.surfaces[k].nominal);
    second[k] = DisplacementOf(fitted[4 + k], pattern.surfaces[k].nominal);
  }
  const Vector3d other =
      Joined(places, pattern.surfaces.front().nominal.axis, TurnedBack(second), first);
  return (places[2] + other - places[0] - first[0]).norm() - (places[2] - places[0]).norm();
}

}  // namespace

std::span<const AcceptanceQuantityInfo> AcceptanceQuantities() { return kQuantities; }

bool IsForm(AcceptanceQuantityKind kind) {
  return kind == AcceptanceQuantityKind::kProbingForm95 ||
         kind == AcceptanceQuantityKind::kProbingForm997 ||
         kind == AcceptanceQuantityKind::kFlatness95 ||
         kind == AcceptanceQuantityKind::kFlatness997;
}

double NarrowestRange(std::vector<double> values, double fraction) {
  std::sort(values.begin(), values.end());
  const size_t held = std::clamp<size_t>(
      static_cast<size_t>(std::ceil(fraction * static_cast<double>(values.size()))), 1,
      values.size());
  double narrowest = values.back() - values.front();
  for (size_t i = 0; i + held <= values.size(); ++i) {
    narrowest = std::min(narrowest, values[i + held - 1] - values[i]);
  }
  return narrowest;
}

std::vector<double> FittedErrors(const Artefact& artefact,
                                 const std::vector<SurfacePoints>& points) {
  std::vector<NominalSurface> fitted;
  for (size_t s = 0; s < points.size(); ++s) {
    const auto surface = FitSurface(artefact.surfaces[s % artefact.surfaces.size()].nominal.kind,
                                    points[s].positions_m, points[s].normals);
    if (!surface) return {};
    fitted.push_back(*surface);
  }
  const NominalSurface& nominal = artefact.surfaces.front().nominal;
  const double size_m = 2 * (fitted.front().radius_m - nominal.radius_m);
  switch (artefact.kind) {
    case ArtefactKind::kSphere: {
      const std::vector<double> distances = Distances(fitted.front(), points.front());
      return {size_m, NarrowestRange(distances, k95), NarrowestRange(distances, kMost)};
    }
    case ArtefactKind::kBallBar:
      return {(fitted[1].point_m - fitted[0].point_m).norm() -
              (artefact.surfaces[1].nominal.point_m - nominal.point_m).norm()};
    case ArtefactKind::kPlate: {
      const std::vector<double> distances = Distances(fitted.front(), points.front());
      return {NarrowestRange(distances, k95), NarrowestRange(distances, kMost)};
    }
    case ArtefactKind::kRing:
      return {size_m};
    case ArtefactKind::kHolePattern:
      return {HoleDistanceError(artefact, fitted)};
  }
  return {};
}

HolePatternWeights WeightsOfHolePattern(const Artefact& pattern) {
  const Pattern places = PlacesOf(pattern);
  const Vector3d& axis = pattern.surfaces.front().nominal.axis;
  const Vector3d along = (places[2] - places[0]).normalized();
  const Vector3d u = axis.unitOrthogonal(), v = axis.cross(u);
  HolePatternWeights weights;
  const Pattern none = {Vector3d::Zero(), Vector3d::Zero(), Vector3d::Zero(), Vector3d::Zero()};
  // Joined() is linear: its derivatives are what unit displacements do.
  for (size_t setup = 0; setup < 2; ++setup) {
    for (size_t place = 0; place < 4; ++place) {
      Vector3d& all = weights.all[setup][place];
      Vector3d& joining = weights.joining[setup][place];
      all.setZero();
      joining.setZero();
      for (const Vector3d& direction : {u, v}) {
        Pattern moved = none;
        moved[place] = direction;
        const Pattern second = setup == 1 ? TurnedBack(moved) : none;
        const Pattern& first = setup == 0 ? moved : none;
        const double by_joining = along.dot(Joined(places, axis, second, first) - second[2]);
        const double itself = along.dot(second[2] - first[0]);
        joining += by_joining * direction;
        all += (by_joining + itself) * direction;
      }
    }
  }
  return weights;
}

// Deviations along the normal n at the point p of a surface that is moved by c, turned by tilts
// t_u, t_v of its axis, and grown by r:
//   sphere    n . c + r
//   cylinder  n . (c_u u + c_v v) + s n . (t_u u + t_v v) + r,  s along the axis from its point
//   plane     c + x t_x + y t_y
LinearFit::LinearFit(const ArtefactSurface& surface, const std::vector<Vector3d>& positions_m,
                     const std::vector<Vector3d>& normals)
    : surface_(surface), positions_m_(positions_m), normals_(normals), kind_(surface.nominal.kind) {
  const auto n = static_cast<Eigen::Index>(positions_m.size());
  const NominalSurface& nominal = surface.nominal;
  const Vector3d u = u_ = nominal.axis.unitOrthogonal(), v = v_ = nominal.axis.cross(u);
  const int parameters = kind_ == SurfaceKind::kSphere     ? 4
                         : kind_ == SurfaceKind::kCylinder ? 5
                                                           : 3;
  design_.resize(n, parameters);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Vector3d& normal = normals[static_cast<size_t>(i)];
    const Vector3d from_middle = positions_m[static_cast<size_t>(i)] - nominal.point_m;
    if (kind_ == SurfaceKind::kSphere) {
      design_.row(i) << normal.transpose(), 1;
    } else if (kind_ == SurfaceKind::kCylinder) {
      const double s = nominal.axis.dot(from_middle) / surface.half_length_m;
      design_.row(i) << normal.dot(u), normal.dot(v), s * normal.dot(u), s * normal.dot(v), 1;
    } else {
      design_.row(i) << 1, surface.side_x.dot(from_middle) / surface.half_side_m,
          surface.side_y.dot(from_middle) / surface.half_side_m;
    }
  }
  const MatrixXd normal_equations = design_.transpose() * design_;
  normal_inverse_ =
      normal_equations.ldlt().solve(MatrixXd::Identity(design_.cols(), design_.cols()));
  inverse_ = normal_inverse_ * design_.transpose();
}

MatrixXd LinearFit::Parameters(const MatrixXd& deviations_m) const {
  return inverse_ * deviations_m;
}

MatrixXd LinearFit::Residuals(const MatrixXd& deviations_m) const {
  return deviations_m - design_ * Parameters(deviations_m);
}

double LinearFit::Variance(const VectorXd& combination, const VectorXd& variances_m2) const {
  return (combination.transpose() * inverse_).cwiseAbs2().dot(variances_m2.transpose());
}

VectorXd LinearFit::MeanChange(std::span<const PointNoise> noise) const {
  const Vector3d& axis = surface_.nominal.axis;
  VectorXd sum = VectorXd::Zero(design_.cols());
  for (const PointNoise& error : noise) {
    const Vector3d &t = error.first_m, &normal = normals_[error.point];
    const Vector3d& position_m = positions_m_[error.point];
    const Vector3d turn = DistanceHessian(surface_.nominal, position_m) * t;
    VectorXd change = VectorXd::Zero(design_.cols());  // of the row of the design
    if (kind_ == SurfaceKind::kSphere) {
      change.head<3>() = turn;
    } else if (kind_ == SurfaceKind::kCylinder) {
      const double s = axis.dot(position_m - surface_.nominal.point_m) / surface_.half_length_m;
      const double along = axis.dot(t) / surface_.half_length_m;
      change.head<4>() << turn.dot(u_), turn.dot(v_), s * turn.dot(u_) + along * normal.dot(u_),
          s * turn.dot(v_) + along * normal.dot(v_);
    } else {
      change.head<3>() << 0, surface_.side_x.dot(t) / surface_.half_side_m,
          surface_.side_y.dot(t) / surface_.half_side_m;
    }
    sum += 0.5 * (t.dot(turn) + normal.dot(error.second_m)) *
           design_.row(static_cast<Eigen::Index>(error.point)).transpose();
    sum += normal.dot(t) * change;
  }
  return normal_inverse_ * sum;
}

VectorXd LinearFit::Diameter() const {
  VectorXd combination = VectorXd::Zero(design_.cols());
  combination[design_.cols() - 1] = 2;
  return combination;
}

VectorXd LinearFit::Displacement(const Vector3d& direction) const {
  VectorXd combination = VectorXd::Zero(design_.cols());
  if (kind_ == SurfaceKind::kCylinder) {
    combination.head<2>() << direction.dot(u_), direction.dot(v_);
  } else {
    combination.head<3>() = direction;
  }
  return combination;
}

}  // namespace sightline
