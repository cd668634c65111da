// SPDX-License-Identifier: Apache-2.0
#include "core/acceptance/virtual_test.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "core/association/surface_curvature.h"
#include "core/laser_line/line_quality.h"
#include "core/parallel/for_each_index.h"
#include "core/random/counter_random.h"
#include "core/statistics/covariance_root.h"
#include "core/statistics/normal_distribution.h"
#include "core/triangulation/line_shift.h"

namespace sightline {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

// A group of errors that are drawn together, and its name.
struct ErrorGroup {
  const char* name;
  int first, count;
};
constexpr ErrorGroup kCalibrationGroups[] = {
    {"camera rotation", kCameraAlpha, 3},   {"camera position", kCameraX, 3},
    {"laser sheet tilt", kSheetTiltX, 2},   {"laser sheet offset", kSheetOffset, 1},
    {"focal length", kFocalLengthError, 1}, {"principal point", kPrincipalX, 2}};
constexpr char kDetection[] = "line detection";
constexpr char kFitBias[] = "bias of least squares by noise";
constexpr char kLineShift[] = "shift of the line on curved surfaces";
constexpr char kJoining[] = "joining of set-ups";

TriangulationErrors DrawErrors(const MatrixXd& root, CounterRandom& random) {
  VectorXd standard(root.cols());
  for (double& x : standard) x = random.Normal();
  return root * standard;
}

double DetectionDeviation(const UncertaintyModel& model, const ArtefactPoint& p) {
  return model.detection.At(p.distance_m, p.incidence_rad);
}

// Row of the column at which the true sheet and the true line of sight meet the surface, by the
// secant method from the nominal row. NaN where they do not.
double TrueRow(const TriangulationSetup& setup, const NominalSurface& surface,
               const ArtefactPoint& p, const TriangulationErrors& errors) {
  const auto height_m = [&](double row) {
    return SignedDistance(surface, Triangulate(setup, Vector2d(p.column_px, row), errors));
  };
  constexpr double kEnough_m = 1e-10;
  double row = p.row_px, height = height_m(row), slope = p.slope_m_per_px;
  for (int i = 0; i < 12 && std::abs(height) > kEnough_m; ++i) {
    const double step = std::clamp(-height / slope, -20.0, 20.0);
    const double next = height_m(row + step);
    if (next != height) slope = (next - height) / step;
    row += step;
    height = next;
  }
  return std::abs(height) <= kEnough_m ? row : std::nan("");
}

// Systematic error of the rendered line at a point; empty: the line is not found there.
std::optional<double> SystematicAt(const LineDeviations& deviations,
                                   const std::vector<ReferencePlace>& references,
                                   const ArtefactScan& scan, const ArtefactPoint& p) {
  const ReferencePlace& place = references[static_cast<size_t>(p.surface)];
  const double stage_m = scan.frames[static_cast<size_t>(p.frame)].stage_m - place.stage_m;
  return deviations.Systematic(stage_m, p.column_px - place.column_px);
}

std::vector<ReferencePlace> ReferencesOf(const ArtefactScan& scan, const Artefact& artefact) {
  std::vector<ReferencePlace> references;
  for (const ArtefactSurface& surface : artefact.surfaces) {
    references.push_back(PlaceOfReference(scan, surface));
  }
  return references;
}

struct DetectionError {
  double column_px = 0, row_px = 0;
};

// Detection errors of one run.
class DetectionDraws {
 public:
  DetectionDraws(const ArtefactScan& scan, const Artefact& artefact, const UncertaintyModel& model,
                 const LineDeviations* deviations, uint64_t seed, uint64_t run, uint32_t stream)
      : scan_(scan), model_(model), deviations_(deviations), random_(seed, run, stream) {
    if (deviations == nullptr) return;
    references_ = ReferencesOf(scan, artefact);
    for (size_t f = 0; f < scan.frames.size(); ++f) {
      lines_.push_back({static_cast<int>(random_.Uniform() * deviations->realisations()),
                        random_.Uniform() < 0.5 ? -1 : 1});
    }
  }

  // Error of the next point; points come in their order. Empty: not detected.
  std::optional<DetectionError> Next(const ArtefactPoint& p) {
    if (deviations_ == nullptr) {
      const double deviation = DetectionDeviation(model_, p);
      const auto pair = random_.NormalPair();
      return DetectionError{deviation * pair[0], deviation * pair[1]};
    }
    const auto frame = static_cast<size_t>(p.frame);
    const ReferencePlace& place = references_[static_cast<size_t>(p.surface)];
    const DrawnLine& line = lines_[frame];
    const auto row = deviations_->Drawn(scan_.frames[frame].stage_m - place.stage_m,
                                        p.column_px - place.column_px, line.realisation, line.sign);
    if (!row) return std::nullopt;
    return DetectionError{0, *row};
  }

 private:
  const ArtefactScan& scan_;
  const UncertaintyModel& model_;
  const LineDeviations* deviations_;
  CounterRandom random_;
  std::vector<ReferencePlace> references_;
  struct DrawnLine {
    int realisation = 0, sign = 1;
  };
  std::vector<DrawnLine> lines_;  // of every frame
};

// The points of every surface as they are measured in one run.
std::vector<SurfacePoints> MeasuredPoints(const ArtefactScan& scan, const Artefact& artefact,
                                          const TriangulationErrors& errors,
                                          DetectionDraws* draws) {
  std::vector<SurfacePoints> measured(artefact.surfaces.size());
  for (const ArtefactPoint& p : scan.points) {
    const auto detection = draws->Next(p);
    if (!detection) continue;
    const TriangulationSetup& setup = scan.frames[static_cast<size_t>(p.frame)].setup;
    const auto surface = static_cast<size_t>(p.surface);
    const double row = TrueRow(setup, artefact.surfaces[surface].nominal, p, errors);
    const Vector3d position_m =
        Triangulate(setup, Vector2d(p.column_px + detection->column_px, row + detection->row_px));
    if (!position_m.allFinite()) continue;
    measured[surface].positions_m.push_back(position_m);
    measured[surface].normals.push_back(p.normal);
  }
  return measured;
}

std::vector<AcceptanceQuantityInfo> QuantitiesOf(const Artefact& artefact) {
  std::vector<AcceptanceQuantityInfo> quantities;
  for (const AcceptanceQuantityInfo& info : AcceptanceQuantities()) {
    if (info.artefact == artefact.kind) quantities.push_back(info);
  }
  return quantities;
}

// The scan's points on one surface, their linear fit, and their errors.
struct LinearSurface {
  LinearFit fit;
  MatrixXd calibration;           // [point][variable], m per unit
  VectorXd detection_variances;   // m^2
  std::vector<size_t> points;     // of the scan
  std::vector<PointNoise> noise;  // by detection

  // Displacements along the normals by shifts of the detected line [px]: one per point, or none.
  VectorXd Displacements(const ArtefactScan& scan, std::span<const double> shifts_px) const {
    VectorXd displacements_m = VectorXd::Zero(static_cast<Eigen::Index>(points.size()));
    if (shifts_px.empty()) return displacements_m;
    for (size_t i = 0; i < points.size(); ++i) {
      displacements_m[static_cast<Eigen::Index>(i)] =
          scan.points[points[i]].slope_m_per_px * shifts_px[points[i]];
    }
    return displacements_m;
  }
};

// Second derivative of the triangulated point by an image coordinate [m/px^2].
Vector3d SecondDerivative(const TriangulationSetup& setup, const Vector2d& image_px,
                          const Vector2d& along) {
  return Triangulate(setup, image_px + along) + Triangulate(setup, image_px - along) -
         2 * Triangulate(setup, image_px);
}

LinearSurface Linearise(const ArtefactScan& scan, const Artefact& artefact,
                        const UncertaintyModel& model, bool by_columns, int surface) {
  std::vector<Vector3d> positions_m, normals;
  std::vector<size_t> points;
  for (size_t i = 0; i < scan.points.size(); ++i) {
    if (scan.points[i].surface != surface) continue;
    positions_m.push_back(scan.points[i].position_m);
    normals.push_back(scan.points[i].normal);
    points.push_back(i);
  }
  const auto n = static_cast<Eigen::Index>(points.size());
  LinearSurface linear{
      LinearFit(artefact.surfaces[static_cast<size_t>(surface)], positions_m, normals),
      MatrixXd(n, kTriangulationVariables),
      VectorXd(n),
      std::move(points),
      {}};
  for (Eigen::Index i = 0; i < n; ++i) {
    const ArtefactPoint& p = scan.points[linear.points[static_cast<size_t>(i)]];
    const TriangulationSetup& setup = scan.frames[static_cast<size_t>(p.frame)].setup;
    const Vector2d image_px(p.column_px, p.row_px);
    const auto derivatives = PointDerivatives(setup, image_px);
    linear.calibration.row(i) = p.normal.transpose() * derivatives;
    const double deviation = DetectionDeviation(model, p);
    linear.detection_variances[i] = 0;
    for (const TriangulationVariable k : {kImageX, kImageY}) {
      if (by_columns && k == kImageX) continue;
      linear.detection_variances[i] += std::pow(deviation * linear.calibration(i, k), 2);
      const Vector2d along = Vector2d::Unit(k - kImageX);
      linear.noise.push_back({static_cast<size_t>(i), deviation * derivatives.col(k),
                              deviation * deviation * SecondDerivative(setup, image_px, along)});
    }
    linear.calibration.row(i).head<2>().setZero();
  }
  return linear;
}

double CombinedVariance(const Eigen::RowVectorXd& sensitivities,
                        const TriangulationCovariance& covariance, int first, int count) {
  const auto part = sensitivities.segment(first, count);
  return part * covariance.block(first, first, count, count) * part.transpose();
}

// Sensitivity of a size or distance to the calibration, and its variance by detection.
struct SizeSensitivity {
  Eigen::RowVectorXd calibration = Eigen::RowVectorXd::Zero(kTriangulationVariables);
  double detection_variance_m2 = 0;

  void Add(const LinearSurface& linear, const VectorXd& combination) {
    calibration += combination.transpose() * linear.fit.Parameters(linear.calibration);
    detection_variance_m2 += linear.fit.Variance(combination, linear.detection_variances);
  }
};

// Combination of the parameters of a surface, fitted to points with errors of their own.
struct Combination {
  size_t surface = 0;
  VectorXd parameters;
};

// Combinations that add up to a size or a distance.
std::vector<Combination> SizeCombinations(const Artefact& artefact,
                                          const std::vector<LinearSurface>& surfaces) {
  if (artefact.kind == ArtefactKind::kHolePattern) {
    std::vector<Combination> combinations;
    for (const auto& setup : WeightsOfHolePattern(artefact).all) {
      for (size_t b = 0; b < setup.size(); ++b) {
        combinations.push_back({b, surfaces[b].fit.Displacement(setup[b])});
      }
    }
    return combinations;
  }
  if (artefact.kind != ArtefactKind::kBallBar) return {{0, surfaces[0].fit.Diameter()}};
  const Vector3d along =
      (artefact.surfaces[1].nominal.point_m - artefact.surfaces[0].nominal.point_m).normalized();
  return {{0, surfaces[0].fit.Displacement(-along)}, {1, surfaces[1].fit.Displacement(along)}};
}

// Standard uncertainty by detection that joining the set-ups adds to the distance of holes.
double JoiningDeviation(const Artefact& artefact, const std::vector<LinearSurface>& surfaces) {
  double variance_m2 = 0;
  for (const auto& setup : WeightsOfHolePattern(artefact).joining) {
    for (size_t b = 0; b < setup.size(); ++b) {
      variance_m2 += surfaces[b].fit.Variance(surfaces[b].fit.Displacement(setup[b]),
                                              surfaces[b].detection_variances);
    }
  }
  return std::sqrt(variance_m2);
}

// Change of a size or distance by shifts of the detected line.
double SizeShift(const ArtefactScan& scan, const Artefact& artefact,
                 const std::vector<LinearSurface>& surfaces, std::span<const double> shifts_px) {
  double size_m = 0;
  for (const Combination& combination : SizeCombinations(artefact, surfaces)) {
    const LinearSurface& surface = surfaces[combination.surface];
    size_m += combination.parameters.dot(
        surface.fit.Parameters(surface.Displacements(scan, shifts_px)).col(0));
  }
  return size_m;
}

QuantityPrediction PredictSize(const ArtefactScan& scan, const Artefact& artefact,
                               const UncertaintyModel& model,
                               const std::vector<LinearSurface>& surfaces,
                               std::span<const double> shifts_px) {
  SizeSensitivity sensitivity;
  for (const Combination& combination : SizeCombinations(artefact, surfaces)) {
    sensitivity.Add(surfaces[combination.surface], combination.parameters);
  }
  QuantityPrediction prediction;
  prediction.terms.push_back({kDetection, std::sqrt(sensitivity.detection_variance_m2)});
  for (const ErrorGroup& group : kCalibrationGroups) {
    prediction.terms.push_back(
        {group.name,
         std::sqrt(std::max(0.0, CombinedVariance(sensitivity.calibration, model.calibration,
                                                  group.first, group.count)))});
  }
  if (artefact.kind == ArtefactKind::kHolePattern) {
    prediction.terms.push_back({kJoining, JoiningDeviation(artefact, surfaces)});
  }
  const double variance_m2 =
      sensitivity.detection_variance_m2 +
      std::max(0.0, CombinedVariance(sensitivity.calibration, model.calibration, 0,
                                     kTriangulationVariables));
  double bias_m = 0;
  for (const Combination& combination : SizeCombinations(artefact, surfaces)) {
    const LinearSurface& surface = surfaces[combination.surface];
    bias_m += combination.parameters.dot(surface.fit.MeanChange(surface.noise));
  }
  prediction.terms.push_back({kFitBias, std::abs(bias_m)});
  const double shift_m = SizeShift(scan, artefact, surfaces, shifts_px);
  if (!shifts_px.empty()) prediction.terms.push_back({kLineShift, std::abs(shift_m)});
  prediction.magnitude_m = NormalMagnitude95(bias_m + shift_m, std::sqrt(variance_m2));
  return prediction;
}

std::vector<ErrorTerm> FormTerms(const UncertaintyModel& model, const LinearSurface& linear,
                                 const MatrixXd& residuals) {
  const auto n = static_cast<double>(linear.points.size());
  std::vector<ErrorTerm> terms = {{kDetection, std::sqrt(linear.detection_variances.mean())}};
  const MatrixXd moments = residuals.transpose() * residuals / n;
  for (const ErrorGroup& group : kCalibrationGroups) {
    const auto block = [&](const MatrixXd& m) {
      return MatrixXd(m.block(group.first, group.first, group.count, group.count));
    };
    terms.push_back({group.name, std::sqrt(std::max(
                                     0.0, (block(model.calibration) * block(moments)).trace()))});
  }
  return terms;
}

double RootMeanSquare(const VectorXd& values) {
  return std::sqrt(values.squaredNorm() / static_cast<double>(values.size()));
}

// Ranges of 95 % and 99.7 % of the residuals.
std::vector<QuantityPrediction> PredictForm(const ArtefactScan& scan, const UncertaintyModel& model,
                                            const LinearSurface& linear,
                                            std::span<const double> shifts_px, int draws,
                                            uint64_t seed) {
  const MatrixXd residuals = linear.fit.Residuals(linear.calibration);
  const MatrixXd root = CovarianceRoot(model.calibration);
  const VectorXd deviations = linear.detection_variances.cwiseSqrt();
  const VectorXd shift = linear.fit.Residuals(linear.Displacements(scan, shifts_px));
  std::vector<std::vector<double>> ranges(2, std::vector<double>(static_cast<size_t>(draws)));
  (void)ForEachIndex(static_cast<size_t>(draws), [&](size_t draw) {
    CounterRandom random(seed, draw, 2);
    VectorXd residual = shift + residuals * DrawErrors(root, random);
    // The fit reduces independent noise only slightly, which is neglected here.
    for (Eigen::Index i = 0; i < residual.size(); ++i)
      residual[i] += deviations[i] * random.Normal();
    const std::vector<double> values(residual.begin(), residual.end());
    ranges[0][draw] = NarrowestRange(values, 0.95);
    ranges[1][draw] = NarrowestRange(values, 0.997);
    return absl::OkStatus();
  });
  std::vector<ErrorTerm> terms = FormTerms(model, linear, residuals);
  if (!shifts_px.empty()) terms.push_back({kLineShift, RootMeanSquare(shift)});
  return {{Magnitude95(ranges[0]), terms}, {Magnitude95(ranges[1]), terms}};
}

std::vector<LinearSurface> LineariseAll(const ArtefactScan& scan, const Artefact& artefact,
                                        const UncertaintyModel& model, bool by_columns) {
  std::vector<LinearSurface> surfaces;
  for (size_t s = 0; s < artefact.surfaces.size(); ++s) {
    surfaces.push_back(Linearise(scan, artefact, model, by_columns, static_cast<int>(s)));
  }
  return surfaces;
}

}  // namespace

double Magnitude95(std::vector<double> errors_m) {
  for (double& error : errors_m) error = std::abs(error);
  std::sort(errors_m.begin(), errors_m.end());
  const auto n = static_cast<double>(errors_m.size());
  const double place = 0.95 * (n - 1);
  const auto below = static_cast<size_t>(place);
  const size_t above = std::min(below + 1, errors_m.size() - 1);
  const double weight = place - static_cast<double>(below);
  return (1 - weight) * errors_m[below] + weight * errors_m[above];
}

ReferencePlace PlaceOfReference(const ArtefactScan& scan, const ArtefactSurface& surface) {
  // The setup travels with the stage: at the stage position s the sheet passes through the place
  // x if n . (x - source at 0) + s n_x = 0.
  const ArtefactFrame& frame = scan.frames.front();
  const Vector3d& normal = frame.setup.laser.y_axis;
  const double beyond_m =
      -normal.dot(surface.reference_m - frame.setup.laser.origin_m) / normal.x();
  TriangulationSetup lit = frame.setup;
  lit.camera.origin_m.x() -= beyond_m;
  return {frame.stage_m + beyond_m,
          static_cast<int>(std::lround(ProjectPoint(lit, surface.reference_m).x()))};
}

SimulatedErrors SimulateTests(const ArtefactScan& scan, const Artefact& artefact,
                              const UncertaintyModel& model, const LineDeviations* deviations,
                              int runs, uint64_t seed) {
  const MatrixXd root = CovarianceRoot(model.calibration);
  std::vector<std::vector<double>> by_run(static_cast<size_t>(runs));
  (void)ForEachIndex(by_run.size(), [&](size_t run) {
    CounterRandom random(seed, run);
    const TriangulationErrors errors = DrawErrors(root, random);
    DetectionDraws draws(scan, artefact, model, deviations, seed, run, 1);
    std::vector<SurfacePoints> points = MeasuredPoints(scan, artefact, errors, &draws);
    if (artefact.kind == ArtefactKind::kHolePattern) {
      DetectionDraws again(scan, artefact, model, deviations, seed, run, 3);
      for (SurfacePoints& surface : MeasuredPoints(scan, artefact, errors, &again)) {
        points.push_back(std::move(surface));
      }
    }
    by_run[run] = FittedErrors(artefact, points);
    return absl::OkStatus();
  });
  SimulatedErrors errors(QuantitiesOf(artefact).size());
  for (const std::vector<double>& run : by_run) {
    for (size_t q = 0; q < run.size(); ++q) errors[q].push_back(run[q]);
  }
  return errors;
}

std::vector<double> LineShifts(const ArtefactScan& scan, const Artefact& artefact,
                               const Laser& laser, LaserLineMethod method) {
  std::vector<double> shifts_px;
  shifts_px.reserve(scan.points.size());
  for (const ArtefactPoint& p : scan.points) {
    const TriangulationSetup& setup = scan.frames[static_cast<size_t>(p.frame)].setup;
    const NominalSurface& surface = artefact.surfaces[static_cast<size_t>(p.surface)].nominal;
    const double axial_m = setup.laser.z_axis.dot(p.position_m - setup.laser.origin_m);
    const LineShift shift =
        LineShiftOnSurface(setup, p.position_m, p.normal, DistanceHessian(surface, p.position_m),
                           SheetDeviation_m(laser, axial_m));
    shifts_px.push_back(method == LaserLineMethod::kGaussianFit ? shift.gaussian_fit_px
                                                                : shift.centre_of_gravity_px);
  }
  return shifts_px;
}

std::vector<QuantityPrediction> PredictTests(const ArtefactScan& scan, const Artefact& artefact,
                                             const UncertaintyModel& model,
                                             const ColumnDetection* columns, int draws,
                                             uint64_t seed) {
  const std::span<const double> shifts_px =
      columns == nullptr ? std::span<const double>() : std::span(columns->shifts_px);
  const std::vector<LinearSurface> surfaces =
      LineariseAll(scan, artefact, model, columns != nullptr);
  std::vector<QuantityPrediction> predictions;
  if (artefact.kind != ArtefactKind::kPlate) {
    predictions.push_back(PredictSize(scan, artefact, model, surfaces, shifts_px));
  }
  if (artefact.kind == ArtefactKind::kSphere || artefact.kind == ArtefactKind::kPlate) {
    for (QuantityPrediction& form : PredictForm(scan, model, surfaces[0], shifts_px, draws, seed)) {
      predictions.push_back(std::move(form));
    }
  }
  return predictions;
}

double NormalMagnitude95(double mean, double deviation) {
  mean = std::abs(mean);
  if (!(deviation > 0)) return mean;
  // P(|X| > m) falls from above 5 % to below it between these ends.
  double lower = mean, upper = mean + kNormal95 * deviation;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (lower + upper);
    const double outside =
        NormalUpperTail((middle - mean) / deviation) + NormalUpperTail((middle + mean) / deviation);
    (outside > 0.05 ? lower : upper) = middle;
  }
  return upper;
}

std::vector<double> SystematicContributions(const ArtefactScan& scan, const Artefact& artefact,
                                            std::span<const double> shifts_px) {
  const std::vector<LinearSurface> surfaces =
      LineariseAll(scan, artefact, UncertaintyModel(), true);
  std::vector<double> contributions;
  if (artefact.kind != ArtefactKind::kPlate) {
    contributions.push_back(std::abs(SizeShift(scan, artefact, surfaces, shifts_px)));
  }
  if (artefact.kind == ArtefactKind::kSphere || artefact.kind == ArtefactKind::kPlate) {
    const VectorXd shift = surfaces[0].Displacements(scan, shifts_px);
    contributions.insert(contributions.end(), 2, RootMeanSquare(surfaces[0].fit.Residuals(shift)));
  }
  return contributions;
}

std::vector<double> RenderedShifts(const ArtefactScan& scan, const Artefact& artefact,
                                   const LineDeviations& deviations) {
  const std::vector<ReferencePlace> references = ReferencesOf(scan, artefact);
  std::vector<double> shifts_px;
  shifts_px.reserve(scan.points.size());
  for (const ArtefactPoint& p : scan.points) {
    shifts_px.push_back(SystematicAt(deviations, references, scan, p).value_or(0));
  }
  return shifts_px;
}

void KeepRendered(const Artefact& artefact, const LineDeviations& deviations, ArtefactScan* scan) {
  const std::vector<ReferencePlace> references = ReferencesOf(*scan, artefact);
  std::erase_if(scan->points, [&](const ArtefactPoint& p) {
    return !SystematicAt(deviations, references, *scan, p);
  });
}

}  // namespace sightline
