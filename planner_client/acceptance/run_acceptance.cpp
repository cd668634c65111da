// SPDX-License-Identifier: Apache-2.0
#include "planner_client/acceptance/run_acceptance.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/acceptance/virtual_test.h"
#include "core/random/seed.h"
#include "core/status/status_macros.h"
#include "core/uncertainty/uncertainty_model.h"

namespace sightline {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kBin_rad = 10 * kDegree;
// Samples per bin of incidence for a standard deviation within about 10 %.
constexpr int64_t kLeastOfBin = 50;
constexpr char kUnpredictedShift[] = "systematic error of line detection that is not predicted";

// Frames that are rendered of an artefact.
int FramesOf(ArtefactKind kind) {
  switch (kind) {
    case ArtefactKind::kSphere:
      return 24;
    case ArtefactKind::kRing:
      return 8;
    default:
      return 3;
  }
}

struct Moments {
  double sum = 0, squares = 0;
  int64_t count = 0;

  void Add(double value) {
    sum += value;
    squares += value * value;
    ++count;
  }
  double Mean() const { return count > 0 ? sum / static_cast<double>(count) : 0; }
  double RootMeanSquare() const {
    return count > 0 ? std::sqrt(squares / static_cast<double>(count)) : 0;
  }
};

// Errors of line detection at similar incidence.
struct Bin {
  Moments systematic, random;
};
using ByIncidence = std::map<int, Bin>;  // by number of the bin

ByIncidence Binned(const std::vector<const RenderedLine*>& lines) {
  ByIncidence bins;
  for (const RenderedLine* line : lines) {
    for (const RenderedLine::Sample& sample : line->samples) {
      Bin& bin = bins[static_cast<int>(sample.incidence_rad / kBin_rad)];
      bin.systematic.Add(sample.systematic_px);
      bin.random.Add(sample.random_px);
    }
  }
  std::erase_if(bins, [](const auto& bin) { return bin.second.random.count < kLeastOfBin; });
  return bins;
}

LineDetectionNoise NoiseOf(const ByIncidence& bins) {
  LineDetectionNoise noise;
  noise.incidence_angles_rad.clear();
  noise.standard_deviations_px.clear();
  for (const auto& [number, bin] : bins) {
    noise.incidence_angles_rad.push_back((number + 0.5) * kBin_rad);
    noise.standard_deviations_px.push_back(bin.random.RootMeanSquare());
  }
  return noise;
}

double PredictedDetection(const ArtefactScan& sphere, const UncertaintyModel& model) {
  double squares = 0;
  for (const ArtefactPoint& p : sphere.points) {
    squares += std::pow(model.detection.At(p.distance_m, p.incidence_rad), 2);
  }
  return sphere.points.empty() ? 0 : std::sqrt(squares / static_cast<double>(sphere.points.size()));
}

// Ball bars use the deviations of the spheres, hole patterns those of the ring.
ArtefactKind RenderedFor(ArtefactKind kind) {
  if (kind == ArtefactKind::kBallBar) return ArtefactKind::kSphere;
  return kind == ArtefactKind::kHolePattern ? ArtefactKind::kRing : kind;
}

const RenderedLine* LineFor(const std::map<ArtefactKind, RenderedLine>& lines, ArtefactKind kind) {
  const auto found = lines.find(RenderedFor(kind));
  return found == lines.end() ? nullptr : &found->second;
}

// The measured points of a test: for rendered lines, the detected ones.
ArtefactScan ScanOf(const Rig& rig, const ScanGeometry& geometry, const Artefact& artefact,
                    SightLimits limits, const RenderedLine* line) {
  if (line == nullptr) return ScanArtefact(rig, geometry, artefact, limits);
  const int most_points = limits.most_points;
  limits.most_points = std::numeric_limits<int>::max();
  ArtefactScan scan = ScanArtefact(rig, geometry, artefact, limits);
  KeepRendered(artefact, line->deviations, &scan);
  ThinColumns(most_points, &scan);
  return scan;
}

struct Test {
  const Artefact* artefact;
  ArtefactScan scan;
};

void AddQuantity(const AcceptanceTask& task, const Test& test, const AcceptanceQuantityInfo& info,
                 const std::vector<double>& simulated, QuantityPrediction prediction,
                 const double* unpredicted_m, v1::AcceptanceResult* result) {
  v1::AcceptanceQuantity* quantity = result->add_quantities();
  quantity->set_standard(info.standard);
  quantity->set_artefact(test.artefact->name);
  quantity->set_quantity(info.name);
  quantity->set_simulated_m(Magnitude95(simulated));
  quantity->set_predicted_m(prediction.magnitude_m);
  const auto within = std::count_if(simulated.begin(), simulated.end(), [&](double error_m) {
    return std::abs(error_m) <= prediction.magnitude_m;
  });
  quantity->set_within_predicted(static_cast<double>(within) /
                                 static_cast<double>(simulated.size()));
  double sum = 0;
  for (const double error : simulated) sum += error;
  quantity->set_mean_m(sum / static_cast<double>(simulated.size()));
  quantity->set_points(static_cast<int>(test.scan.points.size()));
  if (unpredicted_m != nullptr) prediction.terms.push_back({kUnpredictedShift, *unpredicted_m});
  const ErrorTerm* largest = nullptr;
  for (const ErrorTerm& term : prediction.terms) {
    v1::AcceptanceTerm* added = quantity->add_terms();
    added->set_name(term.name);
    added->set_contribution_m(term.contribution_m);
    if (largest == nullptr || term.contribution_m > largest->contribution_m) largest = &term;
  }
  if (largest != nullptr) quantity->set_dominating_term(largest->name);
  for (const PermittedError& limit : task.settings.limits) {
    if (limit.kind != info.kind) continue;
    quantity->set_permitted_m(limit.permitted_m);
    quantity->set_passed(quantity->simulated_m() <= limit.permitted_m);
  }
}

absl::Status AddTest(const AcceptanceTask& task, const UncertaintyModel& model, const Test& test,
                     const RenderedLine* line, v1::AcceptanceResult* result) {
  const uint64_t seed = DeriveSeed(task.settings.seed, test.artefact->name.c_str());
  const SimulatedErrors simulated =
      SimulateTests(test.scan, *test.artefact, model, line == nullptr ? nullptr : &line->deviations,
                    task.settings.runs, seed);
  ColumnDetection columns;
  if (line != nullptr) {
    columns.shifts_px = LineShifts(test.scan, *test.artefact, task.inspection.rig.laser,
                                   task.imaging->inspection.optics->detector.method);
  }
  std::vector<QuantityPrediction> predicted =
      PredictTests(test.scan, *test.artefact, model, line == nullptr ? nullptr : &columns,
                   task.settings.runs, seed);
  std::vector<double> unpredicted;
  if (line != nullptr) {
    std::vector<double> rest_px = RenderedShifts(test.scan, *test.artefact, line->deviations);
    for (size_t i = 0; i < rest_px.size(); ++i) rest_px[i] -= columns.shifts_px[i];
    unpredicted = SystematicContributions(test.scan, *test.artefact, rest_px);
  }
  size_t q = 0;
  for (const AcceptanceQuantityInfo& info : AcceptanceQuantities()) {
    if (info.artefact != test.artefact->kind) continue;
    if (simulated[q].empty()) {
      return absl::FailedPreconditionError(absl::StrCat(
          task.context, ": points measured of the ", test.artefact->name, " do not determine it"));
    }
    AddQuantity(task, test, info, simulated[q], std::move(predicted[q]),
                line == nullptr ? nullptr : &unpredicted[q], result);
    ++q;
  }
  return absl::OkStatus();
}

void AddDetection(const std::map<ArtefactKind, RenderedLine>& lines, const ByIncidence& bins,
                  double predicted_px, double exposure_time_s, v1::AcceptanceResult* result) {
  v1::AcceptanceDetection* detection = result->mutable_detection();
  detection->set_predicted_px(predicted_px);
  const RenderedLine* sphere = LineFor(lines, ArtefactKind::kSphere);
  if (sphere == nullptr) {
    detection->set_standard_deviation_px(predicted_px);
    return;
  }
  detection->set_rendered(true);
  detection->set_exposure_time_s(exposure_time_s);
  detection->set_found_fraction(sphere->found_fraction);
  Bin all;
  for (const RenderedLine::Sample& sample : sphere->samples) {
    all.systematic.Add(sample.systematic_px);
    all.random.Add(sample.random_px);
  }
  detection->set_standard_deviation_px(all.random.RootMeanSquare());
  detection->set_mean_px(all.systematic.Mean());
  int images = 0;
  for (const auto& [kind, line] : lines) images += line.images;
  detection->set_images(images);
  for (const auto& [number, bin] : bins) {
    v1::AcceptanceDetection::Bin* added = detection->add_by_incidence();
    added->set_incidence_deg((number + 0.5) * kBin_rad / kDegree);
    added->set_standard_deviation_px(bin.random.RootMeanSquare());
    added->set_mean_px(bin.systematic.Mean());
    added->set_points(bin.random.count);
  }
}

void AddVerdict(v1::AcceptanceResult* result) {
  for (const v1::AcceptanceQuantity& quantity : result->quantities()) {
    if (!quantity.has_passed()) continue;
    result->set_passed(quantity.passed() && (!result->has_passed() || result->passed()));
  }
}

}  // namespace

absl::StatusOr<v1::AcceptanceResult> RunAcceptance(const AcceptanceTask& task,
                                                   const RenderClientOptions& client) {
  const Rig& rig = task.inspection.rig;
  const Measurement place = PlaceOfSensors(task.settings, task.inspection.domain);
  const ScanGeometry geometry = MakeScanGeometry(rig, place);
  SightLimits limits;
  limits.max_range_m = rig.max_range_m;
  if (task.inspection.targets.max_incidence_rad) {
    limits.most_incidence_rad = *task.inspection.targets.max_incidence_rad;
  }
  SIGHTLINE_ASSIGN_OR_RETURN(const auto choice,
                             ChooseArtefacts(task.settings, rig, geometry, limits, task.context));

  v1::AcceptanceResult result;
  result.set_inspection_name(task.inspection.name);
  *result.mutable_place() = MeasurementToProto(place);
  result.set_field_width_m(FieldWidth(rig, place));
  result.set_runs(task.settings.runs);
  result.set_seed(static_cast<int64_t>(task.settings.seed));
  for (const std::string& warning : choice.warnings) result.add_warnings(warning);

  // Images of every kind of artefact.
  std::map<ArtefactKind, RenderedLine> lines;
  double exposure_time_s = task.settings.exposure_time_s.value_or(0);
  for (const Artefact& artefact : choice.artefacts) {
    if (!task.imaging || RenderedFor(artefact.kind) != artefact.kind) continue;
    SightLimits all_columns = limits;
    all_columns.most_points = std::numeric_limits<int>::max();
    const ArtefactScan scan = ScanArtefact(rig, geometry, artefact, all_columns);
    if (!(exposure_time_s > 0)) {
      SIGHTLINE_ASSIGN_OR_RETURN(exposure_time_s,
                                 ExposureOf(client, *task.imaging, artefact, scan));
    }
    SIGHTLINE_ASSIGN_OR_RETURN(auto line,
                               RenderLine(client, *task.imaging, artefact, scan, exposure_time_s,
                                          FramesOf(artefact.kind), task.realisations));
    if (line.found_fraction < 0.9) {
      result.add_warnings(absl::StrFormat(
          "the laser line is found in %.0f %% of the columns that see the %s: the exposure time of "
          "%.3g ms may not suit it",
          100 * line.found_fraction, artefact.name, 1e3 * exposure_time_s));
    }
    lines.emplace(artefact.kind, std::move(line));
  }

  std::vector<const RenderedLine*> every_line;
  for (const auto& [kind, line] : lines) every_line.push_back(&line);
  const ByIncidence bins = Binned(every_line);
  UncertaintyModel model;
  if (task.inspection.uncertainty) {
    model = *task.inspection.uncertainty;
  } else if (task.inspection.defaults != DefaultsVersion::k0_1) {
    model.calibration = CalibrationOnSite();
    model.calibration_assumed = true;
  }
  if (!task.detection_stated && !bins.empty()) model.detection = NoiseOf(bins);
  if (!model.HasCalibrationErrors()) {
    result.add_warnings(
        "uncertainty.calibration has no errors: sizes and distances come out too good");
  } else if (model.calibration_assumed) {
    result.add_warnings(
        "uncertainty.calibration is not stated: a rig calibrated on site is assumed, with 0.001 "
        "degrees and 0.01 mm for camera and laser");
  }
  for (const Artefact& artefact : choice.artefacts) {
    const RenderedLine* line = LineFor(lines, artefact.kind);
    // At equal incidence of the camera, that of the laser differs between artefacts. So does the
    // width of the line in the image, and speckle errors grow with it.
    if (!task.detection_stated && line != nullptr) {
      const ByIncidence own = Binned({line});
      if (!own.empty()) model.detection = NoiseOf(own);
    }
    const Test test{&artefact, ScanOf(rig, geometry, artefact, limits, line)};
    if (artefact.kind == ArtefactKind::kSphere) {
      AddDetection(lines, bins, PredictedDetection(test.scan, model), exposure_time_s, &result);
    }
    SIGHTLINE_RETURN_IF_ERROR(AddTest(task, model, test, line, &result));
  }
  AddVerdict(&result);
  return result;
}

}  // namespace sightline
