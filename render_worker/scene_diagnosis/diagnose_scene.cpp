// SPDX-License-Identifier: Apache-2.0
#include "render_worker/scene_diagnosis/diagnose_scene.h"

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "core/rig/scan_geometry.h"
#include "render_worker/effects/effect.h"
#include "render_worker/render/part_frame.h"
#include "render_worker/scene_diagnosis/block_means.h"
#include "render_worker/scene_diagnosis/compare_paths.h"
#include "render_worker/scene_diagnosis/light_paths.h"
#include "render_worker/scene_diagnosis/path_fit.h"

namespace sightline {
namespace {

// Blocks that stand out, in standard deviations.
constexpr double kExcess = 3;
constexpr double kTransportShare = 0.75;  // of the work

absl::Status CheckImages(const RecordedScene& scene) {
  if (scene.recordings.format_version != 2) {
    return absl::InvalidArgumentError(absl::StrCat("recordings: format_version is ",
                                                   scene.recordings.format_version,
                                                   ", must be 2: recordings of a part"));
  }
  if (!scene.inspection.sensor || !scene.inspection.rig.lens) {
    return absl::InvalidArgumentError("inspection: sensor and lens are needed");
  }
  const auto& recordings = scene.recordings.recordings;
  if (scene.raw_dn.size() != recordings.size()) {
    return absl::InvalidArgumentError(absl::StrCat("images: there are ", scene.raw_dn.size(),
                                                   ", must be one for each of the ",
                                                   recordings.size(), " recordings"));
  }
  const Camera& camera = scene.inspection.rig.camera;
  bool laser = false;
  for (size_t i = 0; i < recordings.size(); ++i) {
    const Image<uint16_t>& raw = scene.raw_dn[i];
    if (raw.columns_px != camera.columns_px || raw.rows_px != camera.rows_px) {
      return absl::InvalidArgumentError(absl::StrCat(recordings[i].file, ": is ", raw.columns_px,
                                                     " x ", raw.rows_px, " px, must be ",
                                                     camera.columns_px, " x ", camera.rows_px));
    }
    const uint16_t largest = *std::max_element(raw.values.begin(), raw.values.end());
    if (largest > scene.inspection.sensor->largest_dn()) {
      return absl::InvalidArgumentError(absl::StrCat(recordings[i].file, ": has a raw number of ",
                                                     largest, ", the sensor's largest is ",
                                                     scene.inspection.sensor->largest_dn()));
    }
    const FrameSetup frame = PartFrameSetup(
        scene.inspection, {recordings[i].measurement, recordings[i].stage_position_m});
    if (*frame.lens.focus_distance_m <= 1.01 * frame.lens.focal_length_m) {
      return absl::InvalidArgumentError(
          absl::StrCat(recordings[i].file, ": is focused at ", *frame.lens.focus_distance_m,
                       " m, too near for a focal length of ", frame.lens.focal_length_m, " m"));
    }
    laser = laser || recordings[i].kind == RecordingKind::kLaser;
  }
  if (!laser) {
    return absl::FailedPreconditionError(
        "recordings: none has kind \"laser\"; light paths cannot be told apart without");
  }
  return absl::OkStatus();
}

// Where and on what light stands out that the null model does not have.
struct Excess {
  int recording = -1;
  int first_row_px = 0, last_row_px = 0, first_column_px = 0, last_column_px = 0;
  double mean_electrons = 0;  // of the path in these blocks
  double mean_z = 0;
  std::string surface;
  double surface_share = 0;
  Eigen::Vector3d place_m = Eigen::Vector3d::Zero();  // part coordinates
};

std::string SurfaceName(const Inspection& inspection, int material) {
  if (material < 0 || material >= static_cast<int>(inspection.materials.size())) return "obstacle";
  const MaterialChoice& choice = inspection.materials[static_cast<size_t>(material)];
  return !choice.part_material.empty() ? choice.part_material : choice.material.name();
}

// Largest connected region of one recording whose blocks are above the refitted null model and
// where `path_electrons` is more than the noise.
Excess FindExcess(const RecordedScene& scene, const SceneLight& light, const BlockMeans& blocks,
                  const Eigen::VectorXd& null_residuals, const Eigen::VectorXd& path_electrons) {
  Excess largest;
  double largest_sum = 0;
  std::vector<bool> seen(static_cast<size_t>(blocks.count()));
  std::vector<int> best_region;
  for (int start = 0; start < blocks.count(); ++start) {
    if (seen[static_cast<size_t>(start)] || null_residuals[start] < kExcess) continue;
    std::vector<int> region = {start};
    seen[static_cast<size_t>(start)] = true;
    double sum = 0;
    for (size_t next = 0; next < region.size(); ++next) {
      const int block = region[next];
      sum += path_electrons[block];
      const int column = block % blocks.columns(), row = block / blocks.columns() % blocks.rows();
      const int recording = block / (blocks.columns() * blocks.rows());
      for (const auto& [di, dj] :
           {std::pair(-1, 0), std::pair(1, 0), std::pair(0, -1), std::pair(0, 1)}) {
        const int i = row + di, j = column + dj;
        if (i < 0 || j < 0 || i >= blocks.rows() || j >= blocks.columns()) continue;
        const int neighbour = blocks.Index(recording, i, j);
        if (seen[static_cast<size_t>(neighbour)] || null_residuals[neighbour] < kExcess) continue;
        seen[static_cast<size_t>(neighbour)] = true;
        region.push_back(neighbour);
      }
    }
    if (sum <= largest_sum) continue;
    largest_sum = sum;
    best_region = std::move(region);
  }
  if (best_region.empty()) return largest;
  largest.recording = best_region.front() / (blocks.columns() * blocks.rows());
  const auto recording = static_cast<size_t>(largest.recording);
  largest.first_row_px = largest.first_column_px = std::numeric_limits<int>::max();
  std::map<int, double> by_material;
  double weight_sum = 0;
  int brightest = best_region.front();
  const SeenSurface& surface = light.surfaces[recording];
  for (const int block : best_region) {
    const int top = block / blocks.columns() % blocks.rows() * blocks.block_px();
    const int left = block % blocks.columns() * blocks.block_px();
    largest.first_row_px = std::min(largest.first_row_px, top);
    largest.last_row_px = std::max(largest.last_row_px, top + blocks.block_px() - 1);
    largest.first_column_px = std::min(largest.first_column_px, left);
    largest.last_column_px = std::max(largest.last_column_px, left + blocks.block_px() - 1);
    const double weight = std::max(0.0, path_electrons[block]);
    largest.mean_electrons += weight;
    largest.mean_z += null_residuals[block];
    if (path_electrons[block] > path_electrons[brightest]) brightest = block;
    for (int i = top; i < top + blocks.block_px(); ++i) {
      for (int j = left; j < left + blocks.block_px(); ++j) {
        const float depth = surface.depth_m.At(i, j);
        if (depth <= 0) continue;
        by_material[static_cast<int>(surface.material.At(i, j))] += weight;
        weight_sum += weight;
      }
    }
  }
  largest.mean_electrons /= static_cast<double>(best_region.size());
  largest.mean_z /= static_cast<double>(best_region.size());
  if (weight_sum <= 0) return largest;
  const auto material =
      std::max_element(by_material.begin(), by_material.end(),
                       [](const auto& a, const auto& b) { return a.second < b.second; });
  largest.surface = SurfaceName(scene.inspection, material->first);
  largest.surface_share = material->second / weight_sum;
  // The middle of the block that has most of this light.
  const int row =
      brightest / blocks.columns() % blocks.rows() * blocks.block_px() + blocks.block_px() / 2;
  const int column = brightest % blocks.columns() * blocks.block_px() + blocks.block_px() / 2;
  const double depth_m = surface.depth_m.At(row, column);
  const RecordedImage& recorded = scene.recordings.recordings[recording];
  const Camera& camera = scene.inspection.rig.camera;
  const ScanGeometry geometry = MakeScanGeometry(scene.inspection.rig, recorded.measurement);
  const SensorPose pose = WorldToPart(geometry, scene.part.BoundingBox().center(), geometry.camera,
                                      recorded.stage_position_m);
  // The pixel of these numbers lies on the optical axis.
  const int axis_column = camera.columns_px / 2, axis_row = camera.rows_px / 2;
  const double x = (column - axis_column) / camera.FocalLengthPx();
  const double y = (row - axis_row) / camera.FocalLengthPx();
  largest.place_m = pose.origin_m + depth_m * (pose.z_axis + x * pose.x_axis + y * pose.y_axis);
  return largest;
}

v1::ModelFit DescribeFit(const BlockMeans& blocks, const PathFit& fit) {
  v1::ModelFit message;
  message.set_chi_squared(fit.held_out_chi_squared);
  message.set_degrees_of_freedom(fit.held_out_count);
  message.set_p_value(boost::math::cdf(boost::math::complement(
      boost::math::chi_squared(fit.held_out_count), fit.held_out_chi_squared)));
  for (size_t k = 0; k < fit.paths.size(); ++k) {
    const LightPath& path = *fit.paths[k];
    if (!path.nominal) continue;
    v1::FittedDeviation* deviation = message.add_deviations();
    deviation->set_name(path.parameter);
    deviation->set_standard_uncertainty(path.prior_standard_deviation);
    const auto i = static_cast<Eigen::Index>(k);
    deviation->set_value(fit.factors[i] - path.prior_mean);
    deviation->set_standard_error(std::sqrt(fit.covariance(i, i)));
  }
  const int per_recording = blocks.rows() * blocks.columns();
  for (int r = 0; r < blocks.recordings(); ++r) {
    for (const bool held_out : {false, true}) {
      v1::RecordingFit* recording = message.add_recordings();
      recording->set_recording(r);
      recording->set_held_out(held_out);
      double chi_squared = 0;
      int count = 0;
      for (int b = r * per_recording; b < (r + 1) * per_recording; ++b) {
        if (blocks.HeldOut(b) != held_out) continue;
        chi_squared += fit.residuals[b] * fit.residuals[b];
        ++count;
      }
      recording->set_chi_squared(chi_squared);
      recording->set_degrees_of_freedom(count);
    }
  }
  return message;
}

std::string PlaceText(const Eigen::Vector3d& place_m) {
  return absl::StrFormat("(%.0f, %.0f, %.0f) mm of the part", 1e3 * place_m.x(), 1e3 * place_m.y(),
                         1e3 * place_m.z());
}

void DescribeEffects(const PathFit& fit, const Excess& excess, const RecordedScene& scene,
                     v1::Explanation* explanation) {
  for (size_t k = 0; k < fit.paths.size(); ++k) {
    const LightPath& path = *fit.paths[k];
    if (path.nominal || path.effect == "unknown") continue;
    const auto i = static_cast<Eigen::Index>(k);
    v1::FittedEffect* effect = explanation->add_effects();
    effect->set_effect(path.effect);
    effect->set_stage(path.stage);
    v1::FittedParameter* factor = effect->add_parameters();
    const double error = std::sqrt(fit.covariance(i, i));
    factor->set_name(path.parameter);
    factor->set_value(fit.factors[i]);
    factor->set_standard_error(error);
    factor->set_lower(path.may_be_negative ? fit.factors[i] - 1.96 * error
                                           : std::max(0.0, fit.factors[i] - 1.96 * error));
    factor->set_upper(fit.factors[i] + 1.96 * error);
    if (!path.shape_name.empty()) {
      v1::FittedParameter* shape = effect->add_parameters();
      shape->set_name(path.shape_name);
      shape->set_value(path.shape);
      shape->set_lower(path.shape_lower);
      shape->set_upper(path.shape_upper);
    }
    if (excess.recording >= 0) {
      effect->add_regions(absl::StrFormat(
          "%s: rows %d-%d, columns %d-%d",
          scene.recordings.recordings[static_cast<size_t>(excess.recording)].file,
          excess.first_row_px, excess.last_row_px, excess.first_column_px, excess.last_column_px));
      if (excess.surface.empty()) continue;
      effect->add_regions(
          absl::StrFormat("surface \"%s\" (%.0f %%)", excess.surface, 100 * excess.surface_share));
      effect->add_regions("brightest at " + PlaceText(excess.place_m));
    }
  }
}

// Light and dark charge of the description with the factors of the best explanation, and what that
// adds, within the bounds that the renderer knows.
void DescribeCalibration(const RecordedScene& scene, const PathFit& fit, v1::Diagnosis* diagnosis) {
  RecordingSet set = scene.recordings;
  for (size_t k = 0; k < fit.paths.size(); ++k) {
    const LightPath& path = *fit.paths[k];
    const double factor = fit.factors[static_cast<Eigen::Index>(k)];
    if (path.effect == "laser_factor") {
      set.laser.power_w *= factor;
      if (set.part) set.part->laser.power_w *= factor;
    } else if (path.effect == "dark_mean_electrons") {
      set.camera.dark_mean_electrons = std::max(0.0, set.camera.dark_mean_electrons + factor);
    } else if (path.effect == "lamp_factor" && set.part) {
      v1::Lighting& lighting = set.part->lighting;
      if (lighting.has_ambient()) {
        lighting.mutable_ambient()->set_radiance_w_m2_sr(factor *
                                                         lighting.ambient().radiance_w_m2_sr());
      }
      for (v1::AreaLight& light : *lighting.mutable_area_lights()) {
        light.set_radiance_w_m2_sr(factor * light.radiance_w_m2_sr());
      }
    }
    if (path.nominal || path.effect == "unknown") continue;
    v1::Effect* effect = diagnosis->add_calibrated_effects();
    effect->set_effect(path.effect);
    auto& parameters = *effect->mutable_parameters();
    parameters[path.parameter] = factor;
    if (!path.shape_name.empty()) parameters[path.shape_name] = path.shape;
    const Effect* known = FindEffect(path.effect);
    if (known == nullptr) continue;
    for (const EffectParameter& p : known->description().parameters) {
      const auto found = parameters.find(std::string(p.name));
      if (found != parameters.end()) found->second = std::clamp(found->second, p.lower, p.upper);
    }
  }
  *diagnosis->mutable_calibrated() = RecordingsToProto(set);
}

// Most probable first.
std::vector<const Hypothesis*> Ranked(const std::vector<Hypothesis>& hypotheses) {
  std::vector<const Hypothesis*> ranked;
  for (const Hypothesis& h : hypotheses) ranked.push_back(&h);
  std::stable_sort(ranked.begin(), ranked.end(), [](const Hypothesis* a, const Hypothesis* b) {
    return a->log_prior + a->log_predictive > b->log_prior + b->log_predictive;
  });
  return ranked;
}

// What the best explanation adds to the null model.
struct AddedLight {
  Eigen::VectorXd electrons;  // mean of every block
  double sum = 0, laser_sum = 0;
  Excess excess;
};

AddedLight FindAddedLight(const RecordedScene& scene, const SceneLight& light,
                          const BlockMeans& blocks, const Hypothesis& best,
                          const PathFit& null_fit) {
  AddedLight added;
  added.electrons = Eigen::VectorXd::Zero(blocks.count());
  for (size_t k = 0; k < best.best.paths.size(); ++k) {
    const LightPath& path = *best.best.paths[k];
    const Eigen::VectorXd electrons =
        best.best.factors[static_cast<Eigen::Index>(k)] * blocks.PathElectrons(path);
    if (path.effect == "laser_factor") added.laser_sum = electrons.sum();
    if (path.nominal) continue;
    added.electrons += electrons;
    added.sum += electrons.sum();
  }
  if (!best.effects.empty()) {
    added.excess = FindExcess(scene, light, blocks, null_fit.residuals, added.electrons);
  }
  return added;
}

double HeldOutPerDegree(const PathFit& fit) {
  return fit.held_out_chi_squared / fit.held_out_count;
}

std::string Finding(const RecordedScene& scene, const Hypothesis& best, const PathFit& null_fit,
                    const AddedLight& added) {
  const double null_held_out = HeldOutPerDegree(null_fit);
  if (best.effects.empty()) {
    return absl::StrFormat(
        "Nothing is missing from the model that these recordings could show (probability %.2f); "
        "held-out chi^2 per degree of freedom %.2f.",
        best.probability, null_held_out);
  }
  std::vector<std::string> words;
  for (const LightPath* path : best.best.paths) {
    if (!path->nominal && path->effect != "unknown") words.push_back(path->words);
  }
  if (words.empty()) words.push_back("light that none of the known paths explains");
  std::string finding = absl::StrCat("Left out of the model: ", absl::StrJoin(words, "; "));
  if (added.sum > 0 && added.laser_sum > 0) {
    absl::StrAppendFormat(&finding, ", %.2g %% of the direct laser light",
                          100 * added.sum / added.laser_sum);
  }
  const Excess& excess = added.excess;
  if (!excess.surface.empty()) {
    absl::StrAppendFormat(&finding, ", most on surface \"%s\", %.1f electrons a pixel in %s",
                          excess.surface, excess.mean_electrons,
                          scene.recordings.recordings[static_cast<size_t>(excess.recording)].file);
  }
  absl::StrAppendFormat(&finding,
                        "; with it held-out chi^2 per degree of freedom falls from %.2f to %.2f.",
                        null_held_out, HeldOutPerDegree(best.best));
  return finding;
}

// Of a diagnosis that was stopped.
std::string UnfinishedFinding(const Hypothesis& best, const PathComparison& comparison,
                              int recordings, int all_recordings) {
  const auto& hypotheses = comparison.hypotheses;
  const auto compared = static_cast<int>(hypotheses.size()) - 1;
  std::string so_far = "nothing was compared with the model as described yet";
  if (!best.effects.empty()) {
    so_far = absl::StrFormat("so far %s explains most, %.3g nats better than nothing left out",
                             best.Name(), best.log_predictive - hypotheses[0].log_predictive);
  } else if (compared > 0) {
    so_far = "so far nothing explains the recordings better than the model as described";
  }
  return absl::StrFormat(
      "Interrupted with %d of %d recordings computed and %d explanation%s compared: %s; held-out "
      "chi^2 per degree of freedom without any %.2f. This is no finding: what was not compared may "
      "explain more.",
      recordings, all_recordings, compared, compared == 1 ? "" : "s", so_far,
      HeldOutPerDegree(hypotheses[0].best));
}

void DescribeRanking(const RecordedScene& scene, const PathComparison& comparison,
                     const std::vector<const Hypothesis*>& ranked, const Excess& excess,
                     v1::Diagnosis* diagnosis) {
  const Hypothesis& best = *ranked.front();
  std::map<std::string, double> stages;
  for (const Hypothesis* hypothesis : ranked) {
    if (!hypothesis->stage.empty()) stages[hypothesis->stage] += hypothesis->probability;
    v1::Explanation* explanation = diagnosis->add_ranked();
    explanation->set_effect(hypothesis->effects.empty() ? "none" : hypothesis->effects.front());
    explanation->set_stage(hypothesis->stage);
    explanation->set_probability(hypothesis->probability);
    explanation->set_log_evidence_gain(hypothesis->log_predictive -
                                       comparison.hypotheses[0].log_predictive);
    explanation->set_held_out_chi_squared_per_dof(HeldOutPerDegree(hypothesis->best));
    DescribeEffects(hypothesis->best, hypothesis == &best ? excess : Excess(), scene, explanation);
    const char* switch_on = best.Name() == "illumination.interreflection"
                                ? "; render.laser_interreflection switches it on"
                                : "";
    const char* most = comparison.finished ? "the most probable" : "the best so far";
    explanation->set_reason(hypothesis == &best
                                ? absl::StrCat(most, switch_on)
                                : absl::StrFormat("log evidence %.1f below %s",
                                                  best.log_predictive - hypothesis->log_predictive,
                                                  most));
  }
  for (const auto& [stage, probability] : stages) {
    v1::StageEvidence* evidence = diagnosis->add_stages();
    evidence->set_stage(stage);
    evidence->set_probability(probability);
  }
}

// Smallest factors these recordings show: expected gain 5 is chi^2 of 10.
void DescribePower(const std::vector<Hypothesis>& hypotheses, v1::Diagnosis* diagnosis) {
  for (const Hypothesis& hypothesis : hypotheses) {
    if (hypothesis.effects.size() != 1 || hypothesis.effects[0] == "unknown") continue;
    const LightPath& path = *hypothesis.best.paths.back();
    const Eigen::Index k = hypothesis.best.factors.size() - 1;
    const double information =
        1 / hypothesis.best.covariance(k, k) - 1 / std::pow(path.prior_standard_deviation, 2);
    if (information <= 0) continue;
    v1::DetectableStrength* strength = diagnosis->add_power();
    strength->set_effect(path.effect);
    strength->set_parameter(path.parameter);
    strength->set_strength(std::sqrt(10 / information));
    if (!path.shape_name.empty()) {
      strength->set_unit_note(absl::StrCat(path.shape_name, " = ", path.shape));
    }
  }
}

void DescribeMaps(const BlockMeans& blocks, const PathFit& null_fit, const PathFit& model_fit,
                  v1::Diagnosis* diagnosis) {
  for (int r = 0; r < blocks.recordings(); ++r) {
    v1::RegionMap* map = diagnosis->add_region_maps();
    map->set_recording(r);
    map->set_rows(blocks.rows());
    map->set_columns(blocks.columns());
    for (int i = 0; i <= blocks.rows(); ++i) map->add_row_edges_px(i * blocks.block_px());
    for (int j = 0; j <= blocks.columns(); ++j) map->add_column_edges_px(j * blocks.block_px());
    for (int i = 0; i < blocks.rows(); ++i) {
      for (int j = 0; j < blocks.columns(); ++j) {
        const int block = blocks.Index(r, i, j);
        map->add_null_z(static_cast<float>(null_fit.residuals[block]));
        map->add_model_z(static_cast<float>(model_fit.residuals[block]));
      }
    }
  }
}

}  // namespace

absl::StatusOr<v1::Diagnosis> DiagnoseScene(const RecordedScene& scene,
                                            const SceneDiagnosisSettings& settings,
                                            const SceneDiagnosisProgress& progress) {
  if (absl::Status status = CheckImages(scene); !status.ok()) return status;
  if (settings.max_effects < 1 || settings.max_effects > 2) {
    return absl::InvalidArgumentError(
        absl::StrCat("max_effects: is ", settings.max_effects, ", must be 1 or 2 for a part"));
  }
  const auto report = [&progress](double fraction, std::string_view what) {
    if (progress) progress(fraction, what);
  };
  LightPathSettings tracing;
  tracing.seed = settings.seed;
  tracing.threads = settings.threads;
  tracing.max_bounces = settings.max_bounces;
  tracing.max_image_bytes = settings.max_image_bytes;
  tracing.cancelled = settings.cancelled;
  tracing.progress = [&report](double fraction) {
    report(kTransportShare * fraction, "expected images by light path");
  };
  absl::StatusOr<SceneLight> light = TraceLightPaths(scene, tracing);
  if (!light.ok()) return light.status();
  const auto recordings = static_cast<int>(light->surfaces.size());
  const auto all_recordings = static_cast<int>(scene.recordings.recordings.size());
  const BlockMeans blocks(scene, recordings, settings.block_px, settings.tile_blocks,
                          settings.registration_px);

  // Interrupted while it traced, it compares what there is, which takes little.
  const bool traced_all = recordings == all_recordings;
  PathComparisonSettings comparing;
  comparing.excluded_effects = settings.excluded_effects;
  comparing.max_effects = settings.max_effects;
  comparing.singles_only = !traced_all;
  PathComparison comparison =
      ComparePaths(scene, *light, blocks, comparing, [&](double fraction, std::string_view what) {
        report(kTransportShare + (1 - kTransportShare) * fraction, what);
        return !traced_all || settings.cancelled == nullptr || !*settings.cancelled;
      });
  comparison.finished = comparison.finished && traced_all;

  const std::vector<const Hypothesis*> ranked = Ranked(comparison.hypotheses);
  const Hypothesis& best = *ranked.front();
  const PathFit& null_fit = comparison.hypotheses.front().best;
  const AddedLight added = FindAddedLight(scene, *light, blocks, best, null_fit);
  v1::Diagnosis diagnosis;
  diagnosis.set_set(scene.recordings.name);
  diagnosis.set_seed(static_cast<int64_t>(settings.seed));
  if (!comparison.finished) {
    diagnosis.set_verdict("interrupted");
    diagnosis.set_finding(UnfinishedFinding(best, comparison, recordings, all_recordings));
  } else {
    diagnosis.set_verdict(best.effects.empty() ? "none" : "effect");
    diagnosis.set_finding(Finding(scene, best, null_fit, added));
  }
  DescribeRanking(scene, comparison, ranked, added.excess, &diagnosis);
  v1::HeldOutImprovement* improvement = diagnosis.mutable_held_out_improvement();
  improvement->set_measure("chi^2 per degree of freedom of held-out tiles");
  improvement->set_null(HeldOutPerDegree(null_fit));
  improvement->set_with_effect(HeldOutPerDegree(best.best));
  for (int r = 0; r < blocks.recordings(); ++r) improvement->add_recordings(r);
  *diagnosis.mutable_null_fit() = DescribeFit(blocks, null_fit);
  *diagnosis.mutable_model_fit() = DescribeFit(blocks, best.best);
  DescribePower(comparison.hypotheses, &diagnosis);
  DescribeMaps(blocks, null_fit, best.best, &diagnosis);
  // Nobody should render or plan with values that may still change.
  if (comparison.finished) {
    DescribeCalibration(scene, best.best, &diagnosis);
    if (HeldOutPerDegree(best.best) > 1.5) {
      diagnosis.add_warnings(absl::StrFormat(
          "held-out chi^2 per degree of freedom is still %.2f: something else differs too",
          HeldOutPerDegree(best.best)));
    }
  }
  report(1, "done");
  return diagnosis;
}

}  // namespace sightline
