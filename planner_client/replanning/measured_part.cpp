// SPDX-License-Identifier: Apache-2.0
#include "planner_client/replanning/measured_part.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <numbers>
#include <regex>
#include <span>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "core/file/read_file.h"
#include "core/inspection/vector_proto.h"
#include "core/part/load_part.h"
#include "core/part/mesh_readers.h"
#include "core/registration/deformed_mesh.h"
#include "core/rig/scan_geometry.h"
#include "core/statistics/normal_distribution.h"
#include "core/status/status_macros.h"
#include "core/targets/poisson_disk.h"
#include "planner_client/measured_points/read_points.h"
#include "planner_client/replanning/misfit.h"

namespace sightline {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kToleratedDeviations = 4;  // of the prior
// A deviation is significant if noise alone makes any of the targets deviate as much in one of so
// many parts.
constexpr double kFalseAlarm = 0.05;
constexpr double kFarthest_m = 100;
// Residuals of a registration above this robust standard deviation are looked into.
constexpr double kSuspicious_m = 2e-4;

std::string FileName(const std::string& path) {
  return std::filesystem::path(path).filename().string();
}

double QuantileOf(std::vector<float> values, int64_t beyond, double fraction) {
  const size_t count = values.size() + static_cast<size_t>(beyond);
  const auto rank = static_cast<size_t>(fraction * static_cast<double>(count));
  if (rank >= values.size()) return std::numeric_limits<double>::infinity();
  const auto place = values.begin() + static_cast<std::ptrdiff_t>(rank);
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

// Limit on the header of a PLY file; lists of properties and comments take some thousand.
constexpr size_t kMostHeaderBytes = size_t{1} << 20;

// Whether a file with so many points can be used after others with `before`.
absl::Status CheckPointCount(const std::string& path, int64_t points, int64_t before) {
  if (points <= kMostMeasuredPoints - before) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(path, ": has ", points, " points", before > 0 ? ", besides " : "",
                   before > 0 ? absl::StrCat(before, " of the files before it") : "", "; at most ",
                   kMostMeasuredPoints,
                   " measured points can be used, all files together: thin them out evenly"));
}

// The same by the file's header, before its points take memory. LoadPoints refuses files that are
// no PLY files or damaged.
absl::Status CheckAnnouncedPoints(const std::string& path, int64_t before) {
  SIGHTLINE_ASSIGN_OR_RETURN(const File file, OpenRegularFile(path));
  std::string start(kMostHeaderBytes, '\0');
  start.resize(std::fread(start.data(), 1, start.size(), file.get()));
  TextScanner header(start);
  if (header.WordInLine() != "ply") return absl::OkStatus();
  int64_t points = 0;
  while (header.NextLine()) {
    const std::string_view keyword = header.WordInLine();
    if (keyword == "end_header") return absl::OkStatus();
    if (keyword != "element" || header.WordInLine() != "vertex") continue;
    int64_t count = 0;
    if (!ParseInteger(header.WordInLine(), &count) || count < 0) continue;
    // There may be several: first one by itself, so that the sum does not overflow.
    SIGHTLINE_RETURN_IF_ERROR(CheckPointCount(path, count, before));
    points += count;
    SIGHTLINE_RETURN_IF_ERROR(CheckPointCount(path, points, before));
  }
  if (start.size() < kMostHeaderBytes) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(path, ": its header has more than ", kMostHeaderBytes >> 20, " MiB"));
}

// How far the points of a file are from the part where the plan supposes it.
absl::Status TooFar(const std::string& path, const PointCloud& cloud, const SurfaceIndex& model,
                    double tolerated_m, const PosePrior& prior) {
  std::vector<float> distances_m;
  const size_t stride = cloud.positions_m.size() / 100 + 1;
  for (size_t i = 0; i < cloud.positions_m.size(); i += stride) {
    const auto on = model.Nearest(cloud.positions_m[i], Eigen::Vector3d::Zero(), kFarthest_m);
    distances_m.push_back(on ? static_cast<float>(on->distance_m)
                             : std::numeric_limits<float>::infinity());
  }
  const double median_m = QuantileOf(std::move(distances_m), 0, 0.5);
  const double size_m = model.mesh().BoundingBox().sizes().norm();
  const std::string reason =
      LikelyMisfit(model, cloud.positions_m, prior, {.residual_m = median_m});
  return absl::InvalidArgumentError(absl::StrFormat(
      "%s: its points are %.4g mm (median) from the part at its planned pose; registration needs "
      "them within %.4g mm. %s",
      path, 1e3 * median_m, 1e3 * tolerated_m,
      !reason.empty() ? reason
      : median_m > 20 * size_m
          ? "Coordinates must be in metres: are they in millimetres? --measured-unit states "
            "another unit"
          : "Are they of this part and scan, in the coordinates of the CAD model?"));
}

absl::Status CheckPose(const Registration& registration, const std::vector<MeasuredFile>& files,
                       const MeasuredPartOptions& options) {
  std::vector<std::string> names;
  for (const MeasuredFile& file : files) names.push_back(file.path);
  const PoseVector& pose = registration.pose.parameters;
  const double turn_rad = pose.head<3>().norm(), shift_m = pose.tail<3>().norm();
  const double most_rad = kToleratedDeviations * options.prior.rotation_standard_deviation_rad;
  const double most_m = kToleratedDeviations * options.prior.translation_standard_deviation_m;
  const bool within = turn_rad <= most_rad && shift_m <= most_m;
  if (within && registration.converged) return absl::OkStatus();
  const std::string found = absl::StrFormat(
      "%.4g mm and %.4g deg from the planned one, with the points %.4g mm (robust standard "
      "deviation) from the part",
      1e3 * shift_m, turn_rad / kDegree, 1e3 * registration.residual_standard_deviation_m);
  const std::string files_text = absl::StrJoin(names, ", ");
  if (!within) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "%s: the pose found lies %s. At most %.4g mm and %.4g deg are accepted, four standard "
        "deviations of the prior (--pose-prior-mm, --pose-prior-deg)",
        files_text, found, 1e3 * most_m, most_rad / kDegree));
  }
  return absl::InvalidArgumentError(absl::StrFormat(
      "%s: the registration has not converged after %d iterations; the last pose lies %s. Are the "
      "points of this part, and do they show enough of its shape to determine a pose?",
      files_text, registration.iterations, found));
}

void DescribePose(const Registration& registration, const MeasuredPartOptions& options,
                  v1::AsMeasured& message) {
  const Eigen::Matrix4d matrix = registration.pose.Matrix().matrix();
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) {
      message.mutable_pose()->add_matrix(matrix(row, column));
    }
  }
  const PoseVector& pose = registration.pose.parameters;
  const PoseVector deviations = registration.covariance.diagonal().cwiseMax(0).cwiseSqrt();
  *message.mutable_rotation_deg() = VectorToProto(pose.head<3>() / kDegree);
  *message.mutable_translation_m() = VectorToProto(pose.tail<3>());
  *message.mutable_rotation_standard_deviation_deg() =
      VectorToProto(deviations.head<3>() / kDegree);
  *message.mutable_translation_standard_deviation_m() = VectorToProto(deviations.tail<3>());
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 6; ++column) {
      message.add_covariance(registration.covariance(row, column));
    }
  }
  message.set_prior_rotation_standard_deviation_deg(options.prior.rotation_standard_deviation_rad /
                                                    kDegree);
  message.set_prior_translation_standard_deviation_m(
      options.prior.translation_standard_deviation_m);
  for (int k = 0; k < registration.not_fixed; ++k) {
    const PoseDirection& direction = registration.directions[static_cast<size_t>(k)];
    v1::PoseMovement& movement = *message.add_not_fixed();
    *movement.mutable_rotation_deg() = VectorToProto(direction.direction.head<3>() / kDegree);
    *movement.mutable_translation_m() = VectorToProto(direction.direction.tail<3>());
    movement.set_standard_deviation_relative(direction.standard_deviation_relative);
  }
  message.set_residual_standard_deviation_m(registration.residual_standard_deviation_m);
}

// Priors for deviations that a mesh moved at its targets can follow: no finer than twice their
// spacing; and no larger than the tolerated distance of a part's points.
std::vector<SurfacePrior> DeviationPriors(const TargetSet& targets, const TargetSampling& sampling,
                                          const UncertaintyModel& model,
                                          double tolerated_distance_m) {
  std::vector<SurfacePrior> priors = PriorsOf(targets, sampling, model);
  for (size_t t = 0; t < priors.size(); ++t) {
    const int32_t region = targets.regions.empty() ? -1 : targets.regions[t];
    const double spacing_m =
        region < 0 ? sampling.spacing_m : sampling.regions[static_cast<size_t>(region)].spacing_m;
    priors[t].length_scale_m =
        std::max(priors[t].length_scale_m, CovarianceLengthScale(2 * spacing_m));
    priors[t].standard_deviation_m = std::min(priors[t].standard_deviation_m, tolerated_distance_m);
  }
  return priors;
}

// Deviations at targets of the model, and the mesh that they make of it.
absl::Status AddDeviations(const TriangleMesh& model, const Inspection& inspection,
                           const UncertaintyModel& uncertainty, double tolerated_distance_m,
                           int threads, MeasuredPart& part) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto targets, SampleTargets(model, inspection.targets));
  const std::vector<DeviationEstimate> estimates = EstimateDeviations(
      targets, DeviationPriors(targets, inspection.targets, uncertainty, tolerated_distance_m),
      inspection.targets.max_normal_angle_rad, part.ScanPointers(), threads);
  const auto known = std::count_if(estimates.begin(), estimates.end(),
                                   [](const auto& estimate) { return estimate.points > 0; });
  const double level =
      NormalTwoSidedQuantile(kFalseAlarm / static_cast<double>(std::max<int64_t>(1, known)));
  DeviationField field;
  field.spacing_m = inspection.targets.spacing_m;
  v1::SurfaceDeviation& message = *part.message.mutable_deviation();
  double square_sum_m2 = 0, largest_m = 0;
  int64_t significant_count = 0;
  for (size_t t = 0; t < estimates.size(); ++t) {
    const DeviationEstimate& estimate = estimates[t];
    if (estimate.points == 0) continue;
    const double variance_m2 =
        estimate.uncertainty_m * estimate.uncertainty_m +
        PoseVariance(part.registration, targets.positions_m[t].cast<double>(),
                     targets.normals[t].cast<double>());
    const double uncertainty_m = std::sqrt(variance_m2);
    const bool significant = std::abs(estimate.mean_m) > level * uncertainty_m;
    part.deviations.push_back({targets.positions_m[t], targets.normals[t],
                               static_cast<float>(estimate.mean_m),
                               static_cast<float>(uncertainty_m), significant});
    field.positions_m.push_back(targets.positions_m[t]);
    field.normals.push_back(targets.normals[t]);
    field.deviations_m.push_back(significant ? estimate.mean_m : 0);
    if (!significant) continue;
    ++significant_count;
    square_sum_m2 += estimate.mean_m * estimate.mean_m;
    const double surely_m = std::abs(estimate.mean_m) - level * uncertainty_m;
    if (surely_m <= largest_m) continue;
    largest_m = surely_m;
    *message.mutable_largest_place_m() = VectorToProto(targets.positions_m[t].cast<double>());
    message.set_largest_m(estimate.mean_m);
    message.set_largest_uncertainty_m(uncertainty_m);
  }
  message.set_known_targets(known);
  message.set_significant_targets(significant_count);
  message.set_significance_level(level);
  if (significant_count > 0) {
    message.set_root_mean_square_m(
        std::sqrt(square_sum_m2 / static_cast<double>(significant_count)));
  }
  part.mesh = std::make_shared<const TriangleMesh>(DeformMesh(model, field));
  return absl::OkStatus();
}

// Three quarters of a normal distribution lie within this many standard deviations.
constexpr double kUpperQuartile = 1.1503;

// Upper quartile of the points' standard deviations along the surface's normals, by noise of
// detection; 0 if there is none.
double TypicalNoise(const PointsOnModel& points, const ScanNoise& noise) {
  constexpr size_t kEnough = 1000;
  const size_t count = points.positions_m.size();
  const size_t step = std::max<size_t>(1, count / kEnough);
  std::vector<float> deviations_m;
  for (size_t i = 0; i < count; i += step) {
    const Eigen::Vector3d normal = points.normals[i].cast<double>();
    const double variance =
        noise.DetectionVariance(points.positions_m[i].cast<double>(), normal, normal);
    if (std::isfinite(variance)) deviations_m.push_back(static_cast<float>(std::sqrt(variance)));
  }
  return deviations_m.empty() ? 0 : QuantileOf(deviations_m, 0, 0.75);
}

// Points of all files, one after the other.
struct AllPoints {
  std::vector<Eigen::Vector3d> points_m;
  // Empty if no file has them; zero for the points of a file that has none.
  std::vector<Eigen::Vector3d> normals;
  std::vector<size_t> end_of_file;
  std::vector<MeasuredPart::PointCounts> counts;

  std::span<Eigen::Vector3d> OfFile(std::vector<Eigen::Vector3d>& all, size_t file) const {
    if (all.empty()) return {};
    const size_t begin = file > 0 ? end_of_file[file - 1] : 0;
    return std::span(all).subspan(begin, end_of_file[file] - begin);
  }
};

// Poses of the laser of a scan, as the plan states them.
PointFileFrame FrameOf(const TriangleMesh& model, const Inspection& inspection,
                       const Measurement& scan, const MeasuredPartOptions& options) {
  PointFileFrame frame;
  frame.metres_per_unit = options.metres_per_unit;
  frame.pose = options.pose;
  frame.laser_at = [geometry = MakeScanGeometry(inspection.rig, scan),
                    centre_m = Eigen::Vector3d(model.BoundingBox().center())](double stage_m) {
    return Eigen::Isometry3d(WorldToPart(geometry, centre_m, geometry.laser, stage_m).Matrix());
  };
  return frame;
}

// Leaves the first of points that repeat one another.
absl::Status RemoveDuplicates(const std::string& path, PointCloud& cloud, int64_t* duplicates) {
  const std::vector<uint8_t> repeated = FindDuplicates(cloud.positions_m);
  const auto first = std::find(repeated.begin(), repeated.end(), 1);
  *duplicates = std::count(first, repeated.end(), 1);
  if (*duplicates == 0) return absl::OkStatus();
  if (100 * *duplicates > static_cast<int64_t>(repeated.size())) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": ", *duplicates, " of its ", repeated.size(),
                     " points repeat another one exactly, first point ", first - repeated.begin(),
                     "; repeated points would count as measured several times: write each once"));
  }
  size_t kept = 0;
  for (size_t i = 0; i < repeated.size(); ++i) {
    if (repeated[i] != 0) continue;
    cloud.positions_m[kept] = cloud.positions_m[i];
    if (!cloud.normals.empty()) cloud.normals[kept] = cloud.normals[i];
    ++kept;
  }
  cloud.positions_m.resize(kept);
  if (!cloud.normals.empty()) cloud.normals.resize(kept);
  return absl::OkStatus();
}

absl::StatusOr<AllPoints> ReadAllPoints(const SurfaceIndex& index, const Inspection& inspection,
                                        const std::vector<MeasuredFile>& files,
                                        const std::vector<Measurement>& scans,
                                        const MeasuredPartOptions& options, double reach_m) {
  AllPoints all;
  for (const MeasuredFile& file : files) {
    const auto before = static_cast<int64_t>(all.points_m.size());
    SIGHTLINE_RETURN_IF_ERROR(CheckAnnouncedPoints(file.path, before));
    SIGHTLINE_ASSIGN_OR_RETURN(
        auto read, ReadMeasuredPoints(file.path,
                                      FrameOf(index.mesh(), inspection,
                                              scans[static_cast<size_t>(file.scan)], options),
                                      kMostMeasuredPoints - before));
    PointCloud& cloud = read.cloud;
    MeasuredPart::PointCounts& counts = all.counts.emplace_back();
    counts.without_value = read.without_value;
    SIGHTLINE_RETURN_IF_ERROR(
        CheckPointCount(file.path, static_cast<int64_t>(cloud.positions_m.size()), before));
    SIGHTLINE_RETURN_IF_ERROR(RemoveDuplicates(file.path, cloud, &counts.duplicates));
    counts.read = static_cast<int64_t>(cloud.positions_m.size());
    int64_t near = 0;
    const size_t stride = cloud.positions_m.size() / 200 + 1;
    for (size_t i = 0; i < cloud.positions_m.size(); i += stride) {
      near += index.Nearest(cloud.positions_m[i], Eigen::Vector3d::Zero(), reach_m).has_value();
    }
    if (near * static_cast<int64_t>(stride) * 2 < counts.read) {
      return TooFar(file.path, cloud, index, reach_m, options.prior);
    }
    // The normals of other files count even if one file has none.
    if (!cloud.normals.empty()) {
      all.normals.resize(all.points_m.size(), Eigen::Vector3d::Zero());
      all.normals.insert(all.normals.end(), cloud.normals.begin(), cloud.normals.end());
    }
    all.points_m.insert(all.points_m.end(), cloud.positions_m.begin(), cloud.positions_m.end());
    all.end_of_file.push_back(all.points_m.size());
  }
  if (!all.normals.empty()) all.normals.resize(all.points_m.size(), Eigen::Vector3d::Zero());
  return all;
}

absl::StatusOr<Registration> RegisterAll(const SurfaceIndex& index, const Inspection& inspection,
                                         const UncertaintyModel& uncertainty,
                                         const std::vector<MeasuredFile>& files,
                                         const std::vector<Measurement>& scans,
                                         const AllPoints& all, RegistrationOptions registering) {
  // The part lies nearly where it is supposed: near enough to say how noisy its points are.
  std::vector<ScanNoise> noise_of_file;
  for (const MeasuredFile& file : files) {
    noise_of_file.emplace_back(inspection.rig, scans[static_cast<size_t>(file.scan)],
                               index.mesh().BoundingBox().center(), uncertainty);
  }
  registering.noise_m2 = [&](size_t i) {
    const auto file = std::upper_bound(all.end_of_file.begin(), all.end_of_file.end(), i);
    const ScanNoise& noise = noise_of_file[static_cast<size_t>(file - all.end_of_file.begin())];
    const Eigen::Vector3d normal =
        all.normals.empty() ? Eigen::Vector3d::Zero().eval() : all.normals[i];
    if (!normal.isZero(0)) return noise.DetectionCovariance(all.points_m[i], normal);
    const auto on = index.Nearest(all.points_m[i], normal, registering.reach_m);
    return noise.DetectionCovariance(all.points_m[i], on ? on->normal : normal);
  };
  auto registration = RegisterPoints(index, all.points_m, all.normals, registering);
  if (registration.ok()) return registration;
  return absl::InvalidArgumentError(
      absl::StrCat(files.front().path, ": ", registration.status().message()));
}

double RootMeanSquare(const std::vector<float>& values) {
  double sum = 0;
  for (const float value : values) sum += static_cast<double>(value) * static_cast<double>(value);
  return values.empty() ? 0 : std::sqrt(sum / static_cast<double>(values.size()));
}

// A dent or a wrong place moves whole neighbourhoods; a cell of the length scale has hardly any
// slope.
OutlierRule OutlierRuleOf(const UncertaintyModel& model) {
  return {.cell_m = CovarianceLengthScale(model.resolution_m)};
}

absl::Status CheckDistances(const MeasuredFile& file, const PointsOnModel& on_model,
                            const ScanNoise& noise, const PartPose& pose,
                            const MeasuredPartOptions& options, const std::string& reason) {
  const double upper_m = QuantileOf(on_model.distances_m, on_model.off_model, 0.75);
  const double noise_m = kUpperQuartile * TypicalNoise(on_model, noise);
  if (upper_m <= options.tolerated_distance_m + noise_m) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrFormat(
      "%s: these points do not fit the part at the pose found (%.4g mm and %.4g deg off): three "
      "quarters of them are within %s. Allowed are %.4g mm (--tolerated-distance-mm) and %.4g mm "
      "of noise. %s",
      file.path, 1e3 * pose.parameters.tail<3>().norm(), pose.parameters.head<3>().norm() / kDegree,
      std::isfinite(upper_m) ? absl::StrFormat("%.4g mm", 1e3 * upper_m)
                             : absl::StrFormat("more than %.4g mm", 1e3 * options.reach_m),
      1e3 * options.tolerated_distance_m, 1e3 * noise_m,
      reason.empty() ? "Are they of this part and scan?" : reason));
}

// One file's points on the registered model; `positions_m` and `facing` are in CAD coordinates.
absl::Status AddScan(const SurfaceIndex& index, const Rig& rig, const UncertaintyModel& uncertainty,
                     const std::vector<Measurement>& scans, size_t f,
                     std::span<const Eigen::Vector3d> positions_m,
                     std::span<const Eigen::Vector3d> facing, const MeasuredPartOptions& options,
                     const std::string& reason, MeasuredPart& part) {
  const MeasuredFile& file = part.files[f];
  const ScanNoise noise(rig, scans[static_cast<size_t>(file.scan)], part.placement.centre_m,
                        uncertainty);
  PointsOnModel on_model =
      ProjectOntoModel(index, positions_m, facing, &noise, options.reach_m, options.threads);
  SIGHTLINE_RETURN_IF_ERROR(
      CheckDistances(file, on_model, noise, part.registration.pose, options, reason));
  const auto other =
      OtherScanInView(rig, scans, static_cast<size_t>(file.scan), part.placement.centre_m,
                      on_model.positions_m, on_model.normals);
  if (other) {
    return absl::InvalidArgumentError(
        absl::StrCat(file.path, ": most of its points face away from camera or laser of scan ",
                     file.scan + 1, " of the plan; scan ", *other + 1,
                     " could have measured them. Are the files in the order "
                     "of the scans?"));
  }
  v1::MeasuredScan& message = *part.message.add_scans();
  message.set_file(FileName(file.path));
  message.set_scan(static_cast<int>(f) + 1);
  message.set_earlier_scan(file.scan + 1);
  message.set_points(static_cast<int64_t>(positions_m.size()));
  message.set_median_distance_m(QuantileOf(on_model.distances_m, on_model.off_model, 0.5));
  message.set_upper_quartile_distance_m(QuantileOf(on_model.distances_m, on_model.off_model, 0.75));
  MeasuredPart::PointCounts& counts = part.counts[f];
  const std::vector<uint8_t> outliers = FindOutliers(on_model, noise, OutlierRuleOf(uncertainty));
  for (size_t p = 0; p < outliers.size(); ++p) {
    if (outliers[p] == 0) continue;
    part.outliers_m.push_back(on_model.positions_m[p] +
                              on_model.deviations_m[p] * on_model.normals[p]);
  }
  counts.among_neighbours = RemovePoints(outliers, on_model);
  counts.off_model = on_model.off_model;
  counts.rms_m = RootMeanSquare(on_model.distances_m);
  part.scans.push_back(std::make_unique<IndexedScan>(std::move(on_model), noise));
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::vector<MeasuredFile>> AssignScans(const std::vector<std::string>& paths,
                                                      int scan_count) {
  static const std::regex numbered("scan_([0-9]{1,6})\\.(ply|pcd|csv|png|tiff?)");
  std::vector<MeasuredFile> files;
  size_t with_number = 0;
  for (size_t i = 0; i < paths.size(); ++i) {
    std::smatch match;
    const std::string name = FileName(paths[i]);
    const bool has_number = std::regex_match(name, match, numbered);
    files.push_back({paths[i], has_number ? std::stoi(match[1]) - 1 : static_cast<int>(i)});
    with_number += has_number;
    if (with_number != 0 && with_number != i + 1) {
      return absl::InvalidArgumentError(
          absl::StrCat(paths[i],
                       ": some files of measured points are named scan_NN.ply by the scan "
                       "they are of and others are not; name all of them so or none"));
    }
  }
  for (const MeasuredFile& file : files) {
    if (file.scan >= 0 && file.scan < scan_count) continue;
    return absl::InvalidArgumentError(absl::StrCat(file.path, ": is of scan ", file.scan + 1,
                                                   ", the plan has scans 1 to ", scan_count));
  }
  std::stable_sort(files.begin(), files.end(),
                   [](const MeasuredFile& a, const MeasuredFile& b) { return a.scan < b.scan; });
  for (size_t i = 1; i < files.size(); ++i) {
    if (files[i].scan != files[i - 1].scan) continue;
    return absl::InvalidArgumentError(absl::StrCat(files[i].path, ": is of scan ",
                                                   files[i].scan + 1, " as ", files[i - 1].path,
                                                   " is; give one file per scan"));
  }
  return files;
}

std::vector<const IndexedScan*> MeasuredPart::ScanPointers() const {
  std::vector<const IndexedScan*> pointers;
  for (const auto& scan : scans) pointers.push_back(scan.get());
  return pointers;
}

std::vector<SurfacePrior> PriorsOf(const TargetSet& targets, const TargetSampling& sampling,
                                   const UncertaintyModel& model) {
  std::vector<SurfacePrior> priors;
  priors.reserve(targets.size());
  for (size_t t = 0; t < targets.size(); ++t) {
    const int32_t region = targets.regions.empty() ? -1 : targets.regions[t];
    const double resolution_m =
        region < 0 ? model.resolution_m
                   : sampling.regions[static_cast<size_t>(region)].resolution_m.value_or(
                         model.resolution_m);
    priors.push_back({model.prior_standard_deviation_m, CovarianceLengthScale(resolution_m)});
  }
  return priors;
}

absl::StatusOr<MeasuredPart> FindMeasuredPart(const TriangleMesh& model,
                                              const Inspection& inspection,
                                              const std::vector<MeasuredFile>& files,
                                              const std::vector<Measurement>& scans,
                                              const MeasuredPartOptions& options) {
  const SurfaceIndex index(model);
  RegistrationOptions registering;
  registering.prior = options.prior;
  registering.correlation_length_m = model.BoundingBox().sizes().norm() / 40;
  SIGHTLINE_ASSIGN_OR_RETURN(
      auto all, ReadAllPoints(index, inspection, files, scans, options, registering.reach_m));
  const UncertaintyModel uncertainty = inspection.uncertainty.value_or(UncertaintyModel{});
  SIGHTLINE_ASSIGN_OR_RETURN(auto registration, RegisterAll(index, inspection, uncertainty, files,
                                                            scans, all, registering));

  MeasuredPart part;
  part.registration = std::move(registration);
  part.files = files;
  part.counts = all.counts;
  const PartPose& pose = part.registration.pose;
  part.placement.rotation = pose.Rotation();
  part.placement.centre_m = pose.centre_m - pose.Rotation().transpose() * pose.parameters.tail<3>();
  Rig rig = inspection.rig;
  rig.part_placement = part.placement;
  std::string reason;
  const Misfit misfit = {.residual_m = part.registration.residual_standard_deviation_m,
                         .fraction_off = FractionOff(index, all.points_m, pose)};
  if (misfit.residual_m > kSuspicious_m || misfit.fraction_off > kSuspiciousFractionOff) {
    reason = LikelyMisfit(index, all.points_m, options.prior, misfit);
  }
  const Eigen::Isometry3d to_model = pose.Matrix().inverse();
  for (Eigen::Vector3d& position : all.points_m) position = to_model * position;
  for (Eigen::Vector3d& normal : all.normals) normal = to_model.linear() * normal;
  for (size_t f = 0; f < files.size(); ++f) {
    SIGHTLINE_RETURN_IF_ERROR(AddScan(index, rig, uncertainty, scans, f,
                                      all.OfFile(all.points_m, f), all.OfFile(all.normals, f),
                                      options, reason, part));
  }
  SIGHTLINE_RETURN_IF_ERROR(CheckPose(part.registration, files, options));
  if (!reason.empty()) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "%s: its points are %.4g mm (robust standard deviation) from the part, %.0f %% of them "
        "more than 1 mm. %s",
        files.front().path, 1e3 * misfit.residual_m, 100 * misfit.fraction_off, reason));
  }
  DescribePose(part.registration, options, part.message);
  SIGHTLINE_RETURN_IF_ERROR(AddDeviations(model, inspection, uncertainty,
                                          options.tolerated_distance_m, options.threads, part));
  return part;
}

}  // namespace sightline
