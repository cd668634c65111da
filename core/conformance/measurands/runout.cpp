// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <Eigen/QR>

#include "absl/strings/str_cat.h"
#include "core/conformance/measurands/measurands.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

// Direction of the first datum that has an axis; zero if none has.
Eigen::Vector3d DatumAxis(const Characteristic& c) {
  for (const std::vector<FeatureElement>& group : c.datums) {
    for (const FeatureElement& element : group) {
      const SurfaceKind kind = element.surface.kind;
      if (kind == SurfaceKind::kCylinder || kind == SurfaceKind::kCone ||
          kind == SurfaceKind::kTorus) {
        return element.surface.axis;
      }
    }
  }
  return Eigen::Vector3d::Zero();
}

}  // namespace

absl::StatusOr<CharacteristicFit> FitRunout(const MotionFrame& frame, const Characteristic& c) {
  const Eigen::Vector3d axis = DatumAxis(c);
  if (axis.isZero()) return absl::UnimplementedError("none of its datums has an axis");
  MotionEstimate datum = UnknownMotion(frame);
  for (const std::vector<FeatureElement>& group : c.datums) {
    SIGHTLINE_RETURN_IF_ERROR(FixRemaining(frame, group, true, datum));
  }
  const bool circular = c.kind == ToleranceKind::kCircularRunout;
  const Eigen::Index own = circular ? 2 : 1;
  const auto used = static_cast<Eigen::Index>(frame.used().size());
  CharacteristicFit result;
  result.measurand = Measurand::kForm;
  result.zone = ZoneKind::kOneSided;
  FeatureFit& fit = result.fit;
  fit.used = frame.used();
  fit.toleranced = TolerancedTargets(c);
  const auto count = static_cast<Eigen::Index>(c.elements.size());
  fit.estimator = Eigen::MatrixXd::Zero(6 + own * count, used);
  fit.estimator.topRows(6) = datum.estimator;
  fit.design =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(fit.toleranced.size()), fit.estimator.rows());
  Eigen::Index row = 0;
  for (Eigen::Index e = 0; e < count; ++e) {
    const FeatureElement& element = c.elements[static_cast<size_t>(e)];
    const Eigen::Vector3d centre = frame.Centre(element);
    const auto own_row = [&](int t) {
      const Eigen::Vector3d& p = frame.feature().targets[static_cast<size_t>(t)].position_m;
      Eigen::RowVectorXd columns = Eigen::RowVectorXd::Ones(own);
      if (circular) columns(1) = axis.dot(p - centre) / frame.scale_m();
      return columns;
    };
    std::vector<int> known;
    for (const int t : element.targets) {
      if (frame.feature().targets[static_cast<size_t>(t)].used()) known.push_back(t);
      fit.design.row(row).head<6>() = frame.Deviation(element, t);
      fit.design.row(row++).segment(6 + own * e, own) = own_row(t);
      fit.surface_of.push_back(static_cast<int>(e));
    }
    const std::vector<int> columns = frame.Columns(element);
    const auto rows = static_cast<Eigen::Index>(known.size());
    if (rows < 6) {
      return absl::FailedPreconditionError(absl::StrCat(
          "its ", rows, " targets that are known well enough are too few for a run-out"));
    }
    // Offset and slope of what the datum's motion leaves.
    Eigen::MatrixXd a(rows, own), left(rows, used);
    for (Eigen::Index i = 0; i < rows; ++i) {
      a.row(i) = own_row(known[static_cast<size_t>(i)]);
      left.row(i) = -frame.Deviation(element, known[static_cast<size_t>(i)]) * datum.estimator;
      left(i, columns[static_cast<size_t>(i)]) += 1;
    }
    fit.estimator.middleRows(6 + own * e, own) =
        a.completeOrthogonalDecomposition().pseudoInverse() * left;
  }
  return result;
}

}  // namespace sightline
