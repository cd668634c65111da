#include "render_worker/scene_diagnosis/diagnose_scene.h"

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
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
#include "render_worker/scene_diagnosis/light_paths.h"
#include "render_worker/scene_diagnosis/path_fit.h"

namespace sightline {
namespace {

// Prior beliefs before the recordings are seen.
constexpr double kPriorNone = 0.5, kPriorOne = 0.35, kPriorTwo = 0.05, kPriorUnknown = 0.1;
// Singles that may be one of a pair.
constexpr size_t kPairPartners = 3;
// Cosines per axis of the free map, and standard deviations of their factors [electrons].
constexpr int kMapOrder = 5;
constexpr double kMapScales_electrons[] = {1, 4, 16, 64};
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

// Cosines over the image, the same in every recording with light.
std::vector<LightPath> FreeMap(const RecordedScene& scene, double scale_electrons) {
  const int columns = scene.inspection.rig.camera.columns_px;
  const int rows = scene.inspection.rig.camera.rows_px;
  std::vector<LightPath> map;
  for (int v = 0; v < kMapOrder; ++v) {
    for (int u = 0; u < kMapOrder; ++u) {
      LightPath path;
      path.effect = "unknown";
      path.parameter = absl::StrCat("cosine_", v, "_", u, "_electrons");
      path.prior_standard_deviation = scale_electrons;
      path.may_be_negative = true;
      Image<double> image(columns, rows);
      for (int i = 0; i < rows; ++i) {
        for (int j = 0; j < columns; ++j) {
          image.At(i, j) = std::cos(std::numbers::pi * v * (i + 0.5) / rows) *
                           std::cos(std::numbers::pi * u * (j + 0.5) / columns);
        }
      }
      for (const RecordedImage& recorded : scene.recordings.recordings) {
        path.electrons.push_back(
            recorded.kind == RecordingKind::kDark ? Image<double>(columns, rows) : image);
      }
      map.push_back(std::move(path));
    }
  }
  return map;
}

// An explanation with its fits: one for every choice of shapes, of which the best is kept.
struct Hypothesis {
  std::vector<std::string> effects;  // empty: none
  std::string stage;
  double log_prior = 0;
  double log_predictive = -std::numeric_limits<double>::infinity();  // mean over the shapes
  PathFit best;
  double probability = 0;

  std::string Name() const { return effects.empty() ? "none" : absl::StrJoin(effects, " + "); }
};

double LogAdd(double a, double b) {
  const double larger = std::max(a, b);
  return std::isinf(larger) ? larger : larger + std::log1p(std::exp(std::min(a, b) - larger));
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
  const double x = (column - camera.columns_px / 2) / camera.FocalLengthPx();
  const double y = (row - camera.rows_px / 2) / camera.FocalLengthPx();
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
  const BlockMeans blocks(scene, settings.block_px, settings.tile_blocks, settings.registration_px);

  PathChoice nominal;
  std::map<std::string, PathChoice> left_out;  // by effect: its shapes
  for (const LightPath& path : light->paths) {
    if (path.nominal) {
      nominal.push_back(&path);
    } else if (std::find(settings.excluded_effects.begin(), settings.excluded_effects.end(),
                         path.effect) == settings.excluded_effects.end()) {
      left_out[path.effect].push_back(&path);
    }
  }

  // Paths are compared one after the other, so that the order of sums never changes.
  std::vector<Hypothesis> hypotheses;
  const auto cancelled = [&settings] { return settings.cancelled && *settings.cancelled; };
  const auto consider = [&](Hypothesis* hypothesis, PathChoice paths, double log_share) {
    PathFit fit = FitPaths(blocks, std::move(paths));
    const double log_predictive = fit.LogPredictive() + log_share;
    const bool better =
        hypothesis->best.paths.empty() || fit.LogPredictive() > hypothesis->best.LogPredictive();
    hypothesis->log_predictive = LogAdd(hypothesis->log_predictive, log_predictive);
    if (better) hypothesis->best = std::move(fit);
  };
  report(kTransportShare, "null model");
  Hypothesis none;
  none.log_prior = std::log(kPriorNone);
  consider(&none, nominal, 0);
  hypotheses.push_back(none);
  for (const auto& [effect, shapes] : left_out) {
    if (cancelled()) return absl::CancelledError("cancelled");
    report(kTransportShare + 0.05, effect);
    Hypothesis one;
    one.effects = {effect};
    one.stage = shapes.front()->stage;
    one.log_prior = std::log(kPriorOne / static_cast<double>(left_out.size()));
    for (const LightPath* shape : shapes) {
      PathChoice paths = nominal;
      paths.push_back(shape);
      consider(&one, std::move(paths), -std::log(static_cast<double>(shapes.size())));
    }
    hypotheses.push_back(std::move(one));
  }
  std::vector<size_t> order;
  for (size_t i = 1; i < hypotheses.size(); ++i) order.push_back(i);
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    return hypotheses[a].log_predictive > hypotheses[b].log_predictive;
  });
  const double pairs =
      0.5 * static_cast<double>(left_out.size()) * static_cast<double>(left_out.size() - 1);
  const size_t partners = settings.max_effects > 1 ? kPairPartners : 0;
  for (size_t a = 0; a < std::min(partners, order.size()); ++a) {
    for (size_t b = a + 1; b < order.size(); ++b) {
      if (cancelled()) return absl::CancelledError("cancelled");
      const Hypothesis& first = hypotheses[order[a]];
      const Hypothesis& second = hypotheses[order[b]];
      Hypothesis two;
      two.effects = {first.effects.front(), second.effects.front()};
      two.stage = first.stage;
      two.log_prior = std::log(kPriorTwo / pairs);
      report(kTransportShare + 0.1, two.Name());
      // The best shape of each, found alone.
      PathChoice paths = nominal;
      paths.push_back(first.best.paths.back());
      paths.push_back(second.best.paths.back());
      consider(&two, std::move(paths),
               -std::log(static_cast<double>(left_out[two.effects[0]].size() *
                                             left_out[two.effects[1]].size())));
      hypotheses.push_back(std::move(two));
    }
  }
  report(kTransportShare + 0.15, "free map");
  std::vector<std::vector<LightPath>> maps;
  Hypothesis unknown;
  unknown.effects = {"unknown"};
  unknown.log_prior = std::log(kPriorUnknown);
  for (const double scale : kMapScales_electrons) {
    if (cancelled()) return absl::CancelledError("cancelled");
    maps.push_back(FreeMap(scene, scale));
    PathChoice paths = nominal;
    for (const LightPath& path : maps.back()) paths.push_back(&path);
    consider(&unknown, std::move(paths),
             -std::log(static_cast<double>(std::size(kMapScales_electrons))));
  }
  unknown.stage = "illumination";
  hypotheses.push_back(std::move(unknown));

  double log_sum = -std::numeric_limits<double>::infinity();
  for (const Hypothesis& h : hypotheses) log_sum = LogAdd(log_sum, h.log_prior + h.log_predictive);
  for (Hypothesis& h : hypotheses) {
    h.probability = std::exp(h.log_prior + h.log_predictive - log_sum);
  }
  std::vector<const Hypothesis*> ranked;
  for (const Hypothesis& h : hypotheses) ranked.push_back(&h);
  std::stable_sort(ranked.begin(), ranked.end(), [](const Hypothesis* a, const Hypothesis* b) {
    return a->log_prior + a->log_predictive > b->log_prior + b->log_predictive;
  });
  const Hypothesis& best = *ranked.front();
  const PathFit& null_fit = hypotheses.front().best;

  // What the best explanation adds to the null model.
  Eigen::VectorXd added = Eigen::VectorXd::Zero(blocks.count());
  double added_sum = 0, laser_sum = 0;
  for (size_t k = 0; k < best.best.paths.size(); ++k) {
    const LightPath& path = *best.best.paths[k];
    const Eigen::VectorXd electrons =
        best.best.factors[static_cast<Eigen::Index>(k)] * blocks.PathElectrons(path);
    if (path.effect == "laser_factor") laser_sum = electrons.sum();
    if (path.nominal) continue;
    added += electrons;
    added_sum += electrons.sum();
  }
  const Excess excess = best.effects.empty()
                            ? Excess()
                            : FindExcess(scene, *light, blocks, null_fit.residuals, added);

  const double null_held_out = null_fit.held_out_chi_squared / null_fit.held_out_count;
  const double model_held_out = best.best.held_out_chi_squared / best.best.held_out_count;
  v1::Diagnosis diagnosis;
  diagnosis.set_set(scene.recordings.name);
  diagnosis.set_seed(static_cast<int64_t>(settings.seed));
  diagnosis.set_verdict(best.effects.empty() ? "none" : "effect");
  std::string finding;
  if (best.effects.empty()) {
    finding = absl::StrFormat(
        "Nothing is missing from the model that these recordings could show (probability %.2f); "
        "held-out chi^2 per degree of freedom %.2f.",
        best.probability, null_held_out);
  } else {
    std::vector<std::string> words;
    for (const LightPath* path : best.best.paths) {
      if (!path->nominal && path->effect != "unknown") words.push_back(path->words);
    }
    if (words.empty()) words.push_back("light that none of the known paths explains");
    finding = absl::StrCat("Left out of the model: ", absl::StrJoin(words, "; "));
    if (added_sum > 0 && laser_sum > 0) {
      absl::StrAppendFormat(&finding, ", %.2g %% of the direct laser light",
                            100 * added_sum / laser_sum);
    }
    if (!excess.surface.empty()) {
      absl::StrAppendFormat(
          &finding, ", most on surface \"%s\", %.1f electrons a pixel in %s", excess.surface,
          excess.mean_electrons,
          scene.recordings.recordings[static_cast<size_t>(excess.recording)].file);
    }
    absl::StrAppendFormat(&finding,
                          "; with it held-out chi^2 per degree of freedom falls from %.2f to %.2f.",
                          null_held_out, model_held_out);
  }
  diagnosis.set_finding(finding);
  std::map<std::string, double> stages;
  for (const Hypothesis* hypothesis : ranked) {
    if (!hypothesis->stage.empty()) stages[hypothesis->stage] += hypothesis->probability;
    v1::Explanation* explanation = diagnosis.add_ranked();
    explanation->set_effect(hypothesis->effects.empty() ? "none" : hypothesis->effects.front());
    explanation->set_stage(hypothesis->stage);
    explanation->set_probability(hypothesis->probability);
    explanation->set_log_evidence_gain(hypothesis->log_predictive - hypotheses[0].log_predictive);
    explanation->set_held_out_chi_squared_per_dof(hypothesis->best.held_out_chi_squared /
                                                  hypothesis->best.held_out_count);
    DescribeEffects(hypothesis->best, hypothesis == &best ? excess : Excess(), scene, explanation);
    const char* switch_on = best.Name() == "illumination.interreflection"
                                ? "; render.laser_interreflection switches it on"
                                : "";
    explanation->set_reason(
        hypothesis == &best ? absl::StrCat("the most probable", switch_on)
                            : absl::StrFormat("log evidence %.1f below the most probable",
                                              best.log_predictive - hypothesis->log_predictive));
  }
  for (const auto& [stage, probability] : stages) {
    v1::StageEvidence* evidence = diagnosis.add_stages();
    evidence->set_stage(stage);
    evidence->set_probability(probability);
  }
  v1::HeldOutImprovement* improvement = diagnosis.mutable_held_out_improvement();
  improvement->set_measure("chi^2 per degree of freedom of held-out tiles");
  improvement->set_null(null_held_out);
  improvement->set_with_effect(model_held_out);
  for (int r = 0; r < blocks.recordings(); ++r) improvement->add_recordings(r);
  *diagnosis.mutable_null_fit() = DescribeFit(blocks, null_fit);
  *diagnosis.mutable_model_fit() = DescribeFit(blocks, best.best);
  DescribeCalibration(scene, best.best, &diagnosis);
  // Smallest factors these recordings show: expected gain 5 is chi^2 of 10.
  for (const Hypothesis& hypothesis : hypotheses) {
    if (hypothesis.effects.size() != 1 || hypothesis.effects[0] == "unknown") continue;
    const LightPath& path = *hypothesis.best.paths.back();
    const Eigen::Index k = hypothesis.best.factors.size() - 1;
    const double information =
        1 / hypothesis.best.covariance(k, k) - 1 / std::pow(path.prior_standard_deviation, 2);
    if (information <= 0) continue;
    v1::DetectableStrength* strength = diagnosis.add_power();
    strength->set_effect(path.effect);
    strength->set_parameter(path.parameter);
    strength->set_strength(std::sqrt(10 / information));
    if (!path.shape_name.empty()) {
      strength->set_unit_note(absl::StrCat(path.shape_name, " = ", path.shape));
    }
  }
  for (int r = 0; r < blocks.recordings(); ++r) {
    v1::RegionMap* map = diagnosis.add_region_maps();
    map->set_recording(r);
    map->set_rows(blocks.rows());
    map->set_columns(blocks.columns());
    for (int i = 0; i <= blocks.rows(); ++i) map->add_row_edges_px(i * blocks.block_px());
    for (int j = 0; j <= blocks.columns(); ++j) map->add_column_edges_px(j * blocks.block_px());
    for (int i = 0; i < blocks.rows(); ++i) {
      for (int j = 0; j < blocks.columns(); ++j) {
        const int block = blocks.Index(r, i, j);
        map->add_null_z(static_cast<float>(null_fit.residuals[block]));
        map->add_model_z(static_cast<float>(best.best.residuals[block]));
      }
    }
  }
  if (model_held_out > 1.5) {
    diagnosis.add_warnings(absl::StrFormat(
        "held-out chi^2 per degree of freedom is still %.2f: something else differs too",
        model_held_out));
  }
  report(1, "done");
  return diagnosis;
}

}  // namespace sightline
