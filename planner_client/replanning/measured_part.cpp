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
#include "core/targets/poisson_disk.h"

namespace sightline {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kToleratedDeviations = 4;  // of the prior
// A deviation is significant if noise alone makes any of the targets deviate as much in one of so
// many parts.
constexpr double kFalseAlarm = 0.05;
constexpr double kFarthest_m = 100;

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

// z with P(|N(0, 1)| > z) = probability.
double TwoSidedQuantile(double probability) {
  double low = 0, high = 40;
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (low + high);
    (std::erfc(middle / std::numbers::sqrt2) > probability ? low : high) = middle;
  }
  return high;
}

// Of a PLY file; lists of properties and comments take some thousand.
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

// The same by the file's header, before its points take memory. What is no PLY file, or a damaged
// one, is for LoadPoints to refuse.
absl::Status CheckAnnouncedPoints(const std::string& path, int64_t before) {
  const absl::StatusOr<File> file = OpenRegularFile(path);
  if (!file.ok()) return file.status();
  std::string start(kMostHeaderBytes, '\0');
  start.resize(std::fread(start.data(), 1, start.size(), file->get()));
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
    if (absl::Status status = CheckPointCount(path, count, before); !status.ok()) return status;
    points += count;
    if (absl::Status status = CheckPointCount(path, points, before); !status.ok()) return status;
  }
  if (start.size() < kMostHeaderBytes) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(path, ": its header has more than ", kMostHeaderBytes >> 20, " MiB"));
}

// How far the points of a file are from the part where the plan supposes it.
absl::Status TooFar(const std::string& path, const PointCloud& cloud, const SurfaceIndex& model,
                    double tolerated_m) {
  std::vector<float> distances_m;
  const size_t stride = cloud.positions_m.size() / 100 + 1;
  for (size_t i = 0; i < cloud.positions_m.size(); i += stride) {
    const auto on = model.Nearest(cloud.positions_m[i], Eigen::Vector3d::Zero(), kFarthest_m);
    distances_m.push_back(on ? static_cast<float>(on->distance_m)
                             : std::numeric_limits<float>::infinity());
  }
  const double median_m = QuantileOf(std::move(distances_m), 0, 0.5);
  const double size_m = model.mesh().BoundingBox().sizes().norm();
  return absl::InvalidArgumentError(absl::StrFormat(
      "%s: its points are %.4g mm (median) from the part where the plan supposes it; the part can "
      "be "
      "found if they are within %.4g mm. %s",
      path, 1e3 * median_m, 1e3 * tolerated_m,
      median_m > 20 * size_m
          ? "Coordinates must be in metres: are they in millimetres?"
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
  if (turn_rad <= most_rad && shift_m <= most_m && registration.converged) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrFormat(
      "%s: the part seems to lie %.4g mm and %.4g deg off, the points then %.4g mm (robust "
      "standard "
      "deviation) from it%s; %.4g mm and %.4g deg are tolerated, four standard deviations of the "
      "prior (--pose-prior-mm, --pose-prior-deg)",
      absl::StrJoin(names, ", "), 1e3 * shift_m, turn_rad / kDegree,
      1e3 * registration.residual_standard_deviation_m,
      registration.converged ? ""
                             : absl::StrCat(", without settling there within ",
                                            registration.iterations, " iterations"),
      1e3 * most_m, most_rad / kDegree));
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

// Of deviations that a mesh moved at its targets can follow: no finer than twice their spacing; and
// no larger than what is tolerated of a part's points.
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
  auto targets = SampleTargets(model, inspection.targets);
  if (!targets.ok()) return targets.status();
  const std::vector<DeviationEstimate> estimates = EstimateDeviations(
      *targets, DeviationPriors(*targets, inspection.targets, uncertainty, tolerated_distance_m),
      inspection.targets.max_normal_angle_rad, part.ScanPointers(), threads);
  const auto known = std::count_if(estimates.begin(), estimates.end(),
                                   [](const auto& estimate) { return estimate.points > 0; });
  const double level =
      TwoSidedQuantile(kFalseAlarm / static_cast<double>(std::max<int64_t>(1, known)));
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
        PoseVariance(part.registration, targets->positions_m[t].cast<double>(),
                     targets->normals[t].cast<double>());
    const double uncertainty_m = std::sqrt(variance_m2);
    const bool significant = std::abs(estimate.mean_m) > level * uncertainty_m;
    part.deviations.push_back({targets->positions_m[t], targets->normals[t],
                               static_cast<float>(estimate.mean_m),
                               static_cast<float>(uncertainty_m), significant});
    field.positions_m.push_back(targets->positions_m[t]);
    field.normals.push_back(targets->normals[t]);
    field.deviations_m.push_back(significant ? estimate.mean_m : 0);
    if (!significant) continue;
    ++significant_count;
    square_sum_m2 += estimate.mean_m * estimate.mean_m;
    const double surely_m = std::abs(estimate.mean_m) - level * uncertainty_m;
    if (surely_m <= largest_m) continue;
    largest_m = surely_m;
    *message.mutable_largest_place_m() = VectorToProto(targets->positions_m[t].cast<double>());
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

// Of a normal distribution, three quarters lie within this many standard deviations.
constexpr double kUpperQuartile = 1.1503;

// What three quarters of the points' standard deviations along the surface's normals, by noise of
// detection, are below; 0 if there is none.
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

}  // namespace

absl::StatusOr<std::vector<MeasuredFile>> AssignScans(const std::vector<std::string>& paths,
                                                      int scan_count) {
  static const std::regex numbered("scan_([0-9]{1,6})\\.ply");
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
  const double size_m = model.BoundingBox().sizes().norm();
  registering.correlation_length_m = size_m / 40;
  // Of all files; normals: empty if none has them, zero for the points of a file that has none.
  std::vector<Eigen::Vector3d> points_m, normals;
  std::vector<size_t> end_of_file;
  for (const MeasuredFile& file : files) {
    const auto before = static_cast<int64_t>(points_m.size());
    if (absl::Status status = CheckAnnouncedPoints(file.path, before); !status.ok()) return status;
    auto cloud = LoadPoints(file.path);
    if (!cloud.ok()) return cloud.status();
    const auto count = static_cast<int64_t>(cloud->positions_m.size());
    if (absl::Status status = CheckPointCount(file.path, count, before); !status.ok()) {
      return status;
    }
    int64_t near = 0;
    const size_t stride = cloud->positions_m.size() / 200 + 1;
    for (size_t i = 0; i < cloud->positions_m.size(); i += stride) {
      near += index.Nearest(cloud->positions_m[i], Eigen::Vector3d::Zero(), registering.reach_m)
                  .has_value();
    }
    if (near * static_cast<int64_t>(stride) * 2 < static_cast<int64_t>(cloud->positions_m.size())) {
      return TooFar(file.path, *cloud, index, registering.reach_m);
    }
    // Where one file has no normals those of the others count nonetheless.
    if (!cloud->normals.empty()) {
      normals.resize(points_m.size(), Eigen::Vector3d::Zero());
      normals.insert(normals.end(), cloud->normals.begin(), cloud->normals.end());
    }
    points_m.insert(points_m.end(), cloud->positions_m.begin(), cloud->positions_m.end());
    end_of_file.push_back(points_m.size());
  }
  if (!normals.empty()) normals.resize(points_m.size(), Eigen::Vector3d::Zero());

  // The part lies nearly where it is supposed: near enough to say how noisy its points are.
  const UncertaintyModel uncertainty = inspection.uncertainty.value_or(UncertaintyModel{});
  std::vector<ScanNoise> noise_of_file;
  for (size_t f = 0; f < files.size(); ++f) {
    noise_of_file.emplace_back(inspection.rig, scans[static_cast<size_t>(files[f].scan)],
                               model.BoundingBox().center(), uncertainty);
  }
  registering.noise_m2 = [&](size_t i) {
    const auto file = std::upper_bound(end_of_file.begin(), end_of_file.end(), i);
    const ScanNoise& noise = noise_of_file[static_cast<size_t>(file - end_of_file.begin())];
    const Eigen::Vector3d normal = normals.empty() ? Eigen::Vector3d::Zero().eval() : normals[i];
    if (!normal.isZero(0)) return noise.DetectionCovariance(points_m[i], normal);
    const auto on = index.Nearest(points_m[i], normal, registering.reach_m);
    return noise.DetectionCovariance(points_m[i], on ? on->normal : normal);
  };
  auto registration = RegisterPoints(index, points_m, normals, registering);
  if (!registration.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat(files.front().path, ": ", registration.status().message()));
  }
  MeasuredPart part;
  part.registration = *std::move(registration);
  part.files = files;
  const PartPose& pose = part.registration.pose;
  part.placement.rotation = pose.Rotation();
  part.placement.centre_m = pose.centre_m - pose.Rotation().transpose() * pose.parameters.tail<3>();
  Rig rig = inspection.rig;
  rig.part_placement = part.placement;
  const Eigen::Isometry3d to_model = pose.Matrix().inverse();
  for (size_t f = 0; f < files.size(); ++f) {
    const size_t begin = f > 0 ? end_of_file[f - 1] : 0, count = end_of_file[f] - begin;
    const auto of_file = [&](std::vector<Eigen::Vector3d>& all) {
      return all.empty() ? std::span<Eigen::Vector3d>() : std::span(all).subspan(begin, count);
    };
    const std::span<Eigen::Vector3d> positions_m = of_file(points_m), facing = of_file(normals);
    for (Eigen::Vector3d& position : positions_m) position = to_model * position;
    for (Eigen::Vector3d& normal : facing) normal = to_model.linear() * normal;
    const ScanNoise noise(rig, scans[static_cast<size_t>(files[f].scan)], part.placement.centre_m,
                          uncertainty);
    PointsOnModel on_model =
        ProjectOntoModel(index, positions_m, facing, &noise, options.reach_m, options.threads);
    const double upper_m = QuantileOf(on_model.distances_m, on_model.off_model, 0.75);
    const double noise_m = kUpperQuartile * TypicalNoise(on_model, noise);
    if (!(upper_m <= options.tolerated_distance_m + noise_m)) {
      return absl::InvalidArgumentError(absl::StrFormat(
          "%s: where the part was found to lie (%.4g mm and %.4g deg off) three quarters of these "
          "points are within %s of it, %.4g mm is tolerated (--tolerated-distance-mm) besides %.4g "
          "mm of noise. Are they of this part and scan?",
          files[f].path, 1e3 * pose.parameters.tail<3>().norm(),
          pose.parameters.head<3>().norm() / kDegree,
          std::isfinite(upper_m) ? absl::StrFormat("%.4g mm", 1e3 * upper_m)
                                 : absl::StrFormat("more than %.4g mm", 1e3 * options.reach_m),
          1e3 * options.tolerated_distance_m, 1e3 * noise_m));
    }
    v1::MeasuredScan& message = *part.message.add_scans();
    message.set_file(FileName(files[f].path));
    message.set_scan(static_cast<int>(f) + 1);
    message.set_earlier_scan(files[f].scan + 1);
    message.set_points(static_cast<int64_t>(count));
    message.set_median_distance_m(QuantileOf(on_model.distances_m, on_model.off_model, 0.5));
    message.set_upper_quartile_distance_m(upper_m);
    part.scans.push_back(std::make_unique<IndexedScan>(std::move(on_model), noise));
  }
  if (absl::Status status = CheckPose(part.registration, files, options); !status.ok()) {
    return status;
  }
  DescribePose(part.registration, options, part.message);
  absl::Status deviations = AddDeviations(model, inspection, uncertainty,
                                          options.tolerated_distance_m, options.threads, part);
  if (!deviations.ok()) return deviations;
  return part;
}

}  // namespace sightline
