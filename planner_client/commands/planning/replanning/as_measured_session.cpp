// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/planning/replanning/as_measured_session.h"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "core/command_options/option_values.h"
#include "core/file/read_file.h"
#include "core/part/load_part.h"
#include "core/physics/angle.h"
#include "core/status/status_macros.h"
#include "core/text/length_unit.h"
#include "planner_client/command_line/process/print.h"
#include "planner_client/coverage_client/part_upload.h"
#include "planner_client/replanning/measured_gain_model.h"
#include "planning/plan_file/plan_file.h"

namespace sightline {
namespace {

// Returns a mesh that stays fixed to the holder while the part moves.
std::shared_ptr<const TriangleMesh> FixedToHolder(const TriangleMesh& mesh, const PartPose& pose) {
  auto moved = std::make_shared<TriangleMesh>(mesh);
  const Eigen::Isometry3d to_part = pose.Matrix().inverse();
  for (Eigen::Vector3f& position : moved->positions_m) {
    position = (to_part * position.cast<double>()).cast<float>();
  }
  return moved;
}

std::optional<TolerancedTargets> TolerancedOf(const PlanningSession& session,
                                              CoverageClient& client) {
  if (!session.ForUncertainty()) return std::nullopt;
  const Requirements& requirements = *session.requirements;
  return FindTolerancedTargets(client, *session.inspection.uncertainty, session.inspection.targets,
                               requirements.AdmissibleUncertainties(client.targets()),
                               requirements.relaxed_uncertainty_m);
}

// A rigid motion from a text of 16 numbers, row by row.
absl::StatusOr<Eigen::Isometry3d> ReadPose(const std::string& path) {
  constexpr uint64_t kMostBytes = 1 << 16;
  SIGHTLINE_ASSIGN_OR_RETURN(const auto text, ReadRegularFile(path, kMostBytes));
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Zero();
  int count = 0;
  for (absl::string_view word :
       absl::StrSplit(text, absl::ByAnyChar(" \t\r\n,;[]"), absl::SkipEmpty())) {
    double value = 0;
    if (count >= 16 || !absl::SimpleAtod(word, &value)) {
      return absl::InvalidArgumentError(
          absl::StrCat(path, ": a pose is 16 numbers, the rows of a 4 x 4 matrix"));
    }
    matrix(count / 4, count % 4) = value;
    ++count;
  }
  const Eigen::Matrix3d turn = matrix.topLeftCorner<3, 3>();
  const bool rigid = (turn * turn.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-4 &&
                     turn.determinant() > 0 && matrix.row(3) == Eigen::RowVector4d(0, 0, 0, 1);
  if (count != 16 || !rigid) {
    return absl::InvalidArgumentError(absl::StrCat(
        path,
        ": a pose is 16 numbers, the rows of a 4 x 4 matrix: a rotation, a shift [m] in the "
        "last column, and 0 0 0 1"));
  }
  return Eigen::Isometry3d(matrix);
}

// Part of the targets that scans satisfy, exact; infeasible ones count for nothing.
absl::StatusOr<double> SatisfiedFraction(GainModel& gain_model,
                                         std::span<const Measurement> scans) {
  const auto all = static_cast<double>(std::max<int64_t>(1, gain_model.measurable().Count()));
  SIGHTLINE_ASSIGN_OR_RETURN(auto exact, gain_model.ExactCoverage(scans));
  std::vector<Measurement> feasible;
  TargetBits covered(gain_model.measurable().size());
  for (size_t i = 0; i < scans.size(); ++i) {
    if (exact[i].feasibility != ScanFeasibility::kFeasible) continue;
    feasible.push_back(scans[i]);
    covered |= exact[i].covered;
  }
  if (!gain_model.ScoresPlans()) return static_cast<double>(covered.Count()) / all;
  SIGHTLINE_ASSIGN_OR_RETURN(auto score, gain_model.ScorePlan(feasible, true));
  return static_cast<double>(score.satisfied) / all;
}

std::string Triple(const v1::Vector3& v, double scale) {
  return absl::StrFormat("%.3f, %.3f, %.3f", scale * v.x(), scale * v.y(), scale * v.z());
}

}  // namespace

void AddRegistrationOptions(CLI::App& app, AsMeasuredOptions* options) {
  app.add_option(
         "--pose-prior-mm", options->pose_prior_mm,
         "with --measured: how far off the part may lie, standard deviation along each axis")
      ->check(CLI::Range(0.001, 100.0));
  app.add_option("--pose-prior-deg", options->pose_prior_deg,
                 "with --measured: how far it may be turned, standard deviation about each axis")
      ->check(CLI::Range(0.001, 30.0));
  app.add_option("--tolerated-distance-mm", options->tolerated_distance_mm,
                 "with --measured: three quarters of a file's points must be this near to the part")
      ->check(CLI::Range(0.001, 5.0));
  app.add_option("--measured-unit", options->unit,
                 "with --measured: length unit of PLY and PCD points: m, cm, mm, um, inch")
      ->transform(NameOfLengthUnit());
  app.add_option("--pose", options->pose_file,
                 "with --measured: text file with a 4 x 4 matrix (metres) that takes PLY and PCD "
                 "points to the coordinates of the CAD model");
}

absl::StatusOr<MeasuredPartOptions> PartOptionsOf(const AsMeasuredOptions& options) {
  MeasuredPartOptions finding;
  finding.prior.rotation_standard_deviation_rad = options.pose_prior_deg * kRadPerDeg;
  finding.prior.translation_standard_deviation_m = 1e-3 * options.pose_prior_mm;
  finding.tolerated_distance_m = 1e-3 * options.tolerated_distance_mm;
  finding.metres_per_unit = MetresPerUnit(options.unit).value_or(1);
  if (options.pose_file.empty()) return finding;
  SIGHTLINE_ASSIGN_OR_RETURN(finding.pose, ReadPose(options.pose_file));
  return finding;
}

void PrintPointCounts(const MeasuredPart& part) {
  for (size_t f = 0; f < part.files.size(); ++f) {
    const MeasuredPart::PointCounts& counts = part.counts[f];
    if (counts.among_neighbours + counts.off_model + counts.duplicates == 0) continue;
    PrintTextTo(
        stderr,
        "%s: of %d points %d differ from their neighbours and %d are far from the part: not "
        "used; %d repeat others\n",
        part.message.scans(static_cast<int>(f)).file(), counts.read, counts.among_neighbours,
        counts.off_model, counts.duplicates);
  }
}

MeasuredTargets MeasuredTargetsOf(const PlanningSession& session, CoverageClient& client,
                                  std::optional<TolerancedTargets> toleranced) {
  const Inspection& inspection = session.inspection;
  const std::vector<const IndexedScan*> scans = session.measured->ScanPointers();
  MeasuredTargets targets;
  for (const IndexedScan* scan : scans) {
    targets.covered.push_back(CoveredByPoints(client.targets(), inspection.targets, *scan, 0));
    targets.covered.back() &= client.measurable();
    targets.points.push_back(static_cast<int64_t>(scan->points.positions_m.size()) +
                             scan->points.off_model);
  }
  if (!toleranced) return targets;
  targets.client = &client;
  targets.toleranced = *std::move(toleranced);
  targets.priors = PriorsOf(client.targets(), inspection.targets, *inspection.uncertainty);
  targets.uncertainties = UncertaintiesFromPoints(
      client.targets(), targets.priors, inspection.targets.max_normal_angle_rad, scans, 0);
  return targets;
}

absl::Status PutFoundPart(std::shared_ptr<const MeasuredPart> measured, PlanningSession& session,
                          CoverageTask& task) {
  session.part = measured->mesh;
  session.inspection.rig.part_placement = measured->placement;
  session.measured = measured;
  // As the server reads it: vertices that fell together are one.
  SIGHTLINE_ASSIGN_OR_RETURN(
      auto welded, LoadPartFromMemory(EncodePly(*measured->mesh,
                                                /*with_materials=*/task.detectability.has_value()),
                                      "ply", "m", "part as measured"));
  task.part = std::make_shared<const TriangleMesh>(std::move(welded));
  task.rig = session.inspection.rig;
  for (CoverageTask::Obstacle& obstacle : task.obstacles) {
    if (obstacle.frame != ObstacleFrame::kPart) continue;
    obstacle.mesh = FixedToHolder(*obstacle.mesh, measured->registration.pose);
  }
  return absl::OkStatus();
}

void AddAsMeasuredOptions(CLI::App& app, AsMeasuredOptions* options) {
  app.add_option("--measured", options->files,
                 "with --resume: points that scans of the plan have measured (PLY, PCD, CSV of "
                 "profiles, depth rasters), one file per scan: scan_NN.ply, or in the order of the "
                 "scans; the rest is planned for the part as they show it");
  AddRegistrationOptions(app, options);
  NeedOption(app,
             {"--pose-prior-mm", "--pose-prior-deg", "--tolerated-distance-mm", "--measured-unit",
              "--pose"},
             "--measured");
}

std::vector<Measurement> EarlierPlan::Measured() const {
  std::vector<Measurement> measured;
  for (const MeasuredFile& file : files) measured.push_back(scans[static_cast<size_t>(file.scan)]);
  return measured;
}

absl::StatusOr<EarlierPlan> LockMeasuredScans(const AsMeasuredOptions& options,
                                              const std::string& folder, PlannerRequest* request) {
  for (const std::string& file : options.files) {
    std::error_code error;
    const auto in = std::filesystem::weakly_canonical(file, error).parent_path();
    if (!error && in == std::filesystem::weakly_canonical(folder + "/points", error)) {
      return absl::InvalidArgumentError(
          absl::StrCat(file,
                       ": points of the new plan will be written to this folder; keep "
                       "measured points elsewhere"));
    }
  }
  GivenPlans known;  // --resume has read this plan before
  SIGHTLINE_ASSIGN_OR_RETURN(auto plan, ReadPlanScans(folder + "/plan.json", &known));
  EarlierPlan earlier;
  earlier.scans = std::move(plan.all);
  SIGHTLINE_ASSIGN_OR_RETURN(earlier.files,
                             AssignScans(options.files, static_cast<int>(earlier.scans.size())));
  std::vector<Measurement> locked = earlier.Measured();
  const auto was_measured = [measured = locked](const Measurement& scan) {
    return std::find(measured.begin(), measured.end(), scan) != measured.end();
  };
  for (const Measurement& scan : request->locked) {
    if (!was_measured(scan)) locked.push_back(scan);
  }
  request->locked = std::move(locked);
  std::erase_if(request->starting, was_measured);
  return earlier;
}

std::function<absl::Status(PlanningSession&, CoverageTask&)> PutMeasuredPart(
    const AsMeasuredOptions& options, const EarlierPlan& earlier) {
  return [options, &earlier](PlanningSession& session, CoverageTask& task) -> absl::Status {
    SIGHTLINE_ASSIGN_OR_RETURN(const auto finding, PartOptionsOf(options));
    SIGHTLINE_ASSIGN_OR_RETURN(auto found, FindMeasuredPart(*session.part, session.inspection,
                                                            earlier.files, earlier.scans, finding));
    PrintPointCounts(found);
    return PutFoundPart(std::make_shared<const MeasuredPart>(std::move(found)), session, task);
  };
}

absl::Status AskMeasuredPoints(const EarlierPlan& earlier, PlanningSession* session) {
  CoverageClient& client = *session->client;
  MeasuredTargets planned = MeasuredTargetsOf(*session, client, TolerancedOf(*session, client));
  std::optional<MeasuredTargets> fresh;
  if (CoverageClient* other = session->validation_client.get()) {
    fresh = MeasuredTargetsOf(*session, *other, TolerancedOf(*session, *other));
  }
  auto gain_model = std::make_unique<MeasuredGainModel>(
      std::move(session->gain_model), earlier.Measured(), std::move(planned), std::move(fresh),
      session->requirements ? session->requirements->relaxed_uncertainty_m : 0);
  session->measured_gain_model = gain_model.get();
  session->gain_model = std::move(gain_model);
  return absl::OkStatus();
}

absl::Status DescribeAsMeasured(const EarlierPlan& earlier, const PlanningSession& session,
                                PlanDocument* document) {
  v1::AsMeasured& message = *document->plan.mutable_as_measured();
  message = session.measured->message;
  const std::vector<Measurement> measured = earlier.Measured();
  SIGHTLINE_ASSIGN_OR_RETURN(auto simulated, session.client->ExactCoverage(measured));
  SIGHTLINE_ASSIGN_OR_RETURN(auto by_points, session.measured_gain_model->ExactCoverage(measured));
  for (int i = 0; i < message.scans_size(); ++i) {
    message.mutable_scans(i)->set_covered_targets(by_points[i].covered.Count());
    message.mutable_scans(i)->set_simulated_covered_targets(simulated[i].covered.Count());
  }
  std::vector<Measurement> now;
  for (const ChosenScan& scan : document->scans) now.push_back(scan.measurement);
  const std::pair<const std::vector<Measurement>*, void (v1::AsMeasured::*)(double)> wanted[] = {
      {&earlier.scans, &v1::AsMeasured::set_earlier_settled},
      {&now, &v1::AsMeasured::set_settled},
      {&measured, &v1::AsMeasured::set_measured_settled}};
  for (const auto& [scans, set] : wanted) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto fraction,
                               SatisfiedFraction(*session.measured_gain_model, *scans));
    (message.*set)(fraction);
  }
  message.set_earlier_scans(static_cast<int32_t>(earlier.scans.size()));
  return absl::OkStatus();
}

std::string SummariseAsMeasured(const v1::Plan& plan) {
  if (!plan.has_as_measured()) return "";
  const v1::AsMeasured& m = plan.as_measured();
  std::string text = absl::StrFormat(
      "the part lies (%s) mm and (%s) deg off; two standard deviations: (%s) mm, (%s) deg.\n",
      Triple(m.translation_m(), 1e3), Triple(m.rotation_deg(), 1),
      Triple(m.translation_standard_deviation_m(), 2e3),
      Triple(m.rotation_standard_deviation_deg(), 2));
  if (m.not_fixed_size() > 0) {
    absl::StrAppendFormat(&text,
                          "the points do not determine %d of its 6 degrees of freedom; these keep "
                          "the prior (%.3g mm, %.3g deg).\n",
                          m.not_fixed_size(), 1e3 * m.prior_translation_standard_deviation_m(),
                          m.prior_rotation_standard_deviation_deg());
  }
  if (m.deviation().significant_targets() > 0) {
    absl::StrAppendFormat(
        &text,
        "its surface deviates significantly at %d of %d targets; most at (%s) mm: %.3f mm (2 u "
        "= %.3f mm).\n",
        m.deviation().significant_targets(), m.deviation().known_targets(),
        Triple(m.deviation().largest_place_m(), 1e3), 1e3 * m.deviation().largest_m(),
        2e3 * m.deviation().largest_uncertainty_m());
  }
  absl::StrAppendFormat(&text,
                        "targets satisfied on this part: %.2f %% by the measured scans (%d), %.2f "
                        "%% by the earlier plan (%d), %.2f %% by this plan (%d).\n",
                        100 * m.measured_settled(), m.scans_size(), 100 * m.earlier_settled(),
                        m.earlier_scans(), 100 * m.settled(), plan.scans_size());
  return text;
}

}  // namespace sightline
