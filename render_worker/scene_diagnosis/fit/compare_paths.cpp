// SPDX-License-Identifier: Apache-2.0
#include "render_worker/scene_diagnosis/fit/compare_paths.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <map>
#include <span>
#include <utility>

#include "render_worker/evidence/model_prior.h"
#include "render_worker/scene_diagnosis/fit/judge_paths.h"
#include "render_worker/scene_diagnosis/fit/smooth_map.h"
#include "render_worker/scene_diagnosis/light/path_names.h"

namespace sightline {
namespace {

// So many of the best single effects are combined with all others. Chosen to bound the number of
// fits.
constexpr size_t kPairPartners = 3;

double LogAdd(double a, double b) {
  const double larger = std::max(a, b);
  return std::isinf(larger) ? larger : larger + std::log1p(std::exp(std::min(a, b) - larger));
}

// Paths of the null model, and by effect the shapes of the paths that it may lack.
struct SortedPaths {
  PathChoice nominal;
  std::map<std::string, PathChoice> left_out;
};

SortedPaths SortPaths(const SceneLight& light, const std::vector<std::string>& excluded) {
  SortedPaths sorted;
  for (const LightPath& path : light.paths) {
    if (path.nominal) {
      sorted.nominal.push_back(&path);
    } else if (std::find(excluded.begin(), excluded.end(), path.effect) == excluded.end()) {
      sorted.left_out[path.effect].push_back(&path);
    }
  }
  return sorted;
}

// The effects of the comparison, and the smooth map as the one discrepancy term of one stage.
ModelCounts CountsOf(const SortedPaths& paths) {
  return {.effects = std::max(1, static_cast<int>(paths.left_out.size())),
          .discrepancy_terms = 1,
          .stages = 1};
}

// Logarithm of the prior of the smooth map alone and in addition to each effect. It is only fitted
// alone, since it is flexible enough to contain any additional effect.
double LogPriorOfMap(const ModelCounts& counts) {
  const double beside = LogPriorOfDiscrepancy(counts, true) + std::log(counts.effects);
  return LogAdd(LogPriorOfDiscrepancy(counts, false), beside);
}

size_t PairPartners(const PathComparisonSettings& settings) {
  return settings.max_effects > 1 ? kPairPartners : 0;
}

size_t CountFits(const SortedPaths& paths, const PathComparisonSettings& settings) {
  size_t shapes = 0, pairs = 0;
  for (const auto& [effect, choices] : paths.left_out) shapes += choices.size();
  for (size_t a = 0; a < std::min(PairPartners(settings), paths.left_out.size()); ++a) {
    pairs += paths.left_out.size() - a - 1;
  }
  return 1 + shapes + (settings.singles_only ? 0 : pairs + std::size(kMapScales_electrons));
}

// The inputs of every stage of the comparison.
struct ComparisonInputs {
  const RecordedScene& scene;
  const BlockMeans& blocks;
  const PathComparisonSettings& settings;
  const PathComparisonProgress& progress;
  SortedPaths paths;
  size_t fits;  // of the whole comparison

  // False: stop. `done`: fits so far.
  bool Report(size_t done, std::string_view what) const {
    return progress(static_cast<double>(done) / static_cast<double>(fits), what);
  }
};

// Hypotheses of one stage. Every stage gets the number of fits before it, for its progress.
struct ComparisonStage {
  std::vector<PathHypothesis> hypotheses;
  size_t fits = 0;
  bool finished = true;
};

// The hypothesis with one more choice of shapes, which has this prior share of it.
PathHypothesis WithFit(PathHypothesis hypothesis, const BlockMeans& blocks, PathChoice paths,
                       double log_share) {
  PathFit fit = FitPaths(blocks, std::move(paths));
  const bool better =
      hypothesis.best.paths.empty() || fit.LogPredictive() > hypothesis.best.LogPredictive();
  hypothesis.log_predictive = LogAdd(hypothesis.log_predictive, fit.LogPredictive() + log_share);
  if (better) hypothesis.best = std::move(fit);
  return hypothesis;
}

PathHypothesis FitNullModel(const ComparisonInputs& inputs) {
  PathHypothesis none;
  none.log_prior = LogPriorOfNoEffect();
  return WithFit(std::move(none), inputs.blocks, inputs.paths.nominal, 0);
}

ComparisonStage FitSingles(const ComparisonInputs& inputs, size_t done) {
  ComparisonStage stage;
  for (const auto& [effect, shapes] : inputs.paths.left_out) {
    if (!inputs.Report(done + stage.fits, effect)) {
      stage.finished = false;
      return stage;
    }
    PathHypothesis one;
    one.effects = {effect};
    one.stage = shapes.front()->stage;
    one.log_prior = LogPriorOfNamed(CountsOf(inputs.paths), 1);
    for (const LightPath* shape : shapes) {
      PathChoice paths = inputs.paths.nominal;
      paths.push_back(shape);
      one = WithFit(std::move(one), inputs.blocks, std::move(paths),
                    -std::log(static_cast<double>(shapes.size())));
      ++stage.fits;
    }
    stage.hypotheses.push_back(std::move(one));
  }
  return stage;
}

// The hypothesis of two effects, not yet fitted.
PathHypothesis PairOf(const ComparisonInputs& inputs, const PathHypothesis& first,
                      const PathHypothesis& second) {
  PathHypothesis two;
  two.effects = {first.effects.front(), second.effects.front()};
  two.stage = first.stage;
  two.log_prior = LogPriorOfNamed(CountsOf(inputs.paths), 2);
  return two;
}

// Pairs of effects, each with the shape that is best when it is alone.
ComparisonStage FitPairs(const ComparisonInputs& inputs, std::span<const PathHypothesis> singles,
                         size_t done) {
  std::vector<const PathHypothesis*> order;
  for (const PathHypothesis& single : singles) order.push_back(&single);
  std::stable_sort(order.begin(), order.end(),
                   [](const PathHypothesis* a, const PathHypothesis* b) {
                     return a->log_predictive > b->log_predictive;
                   });
  const auto& left_out = inputs.paths.left_out;
  ComparisonStage stage;
  for (size_t a = 0; a < std::min(PairPartners(inputs.settings), order.size()); ++a) {
    for (size_t b = a + 1; b < order.size(); ++b) {
      const PathHypothesis &first = *order[a], &second = *order[b];
      PathHypothesis two = PairOf(inputs, first, second);
      if (!inputs.Report(done + stage.fits, two.Name())) {
        stage.finished = false;
        return stage;
      }
      PathChoice paths = inputs.paths.nominal;
      paths.push_back(first.best.paths.back());
      paths.push_back(second.best.paths.back());
      const size_t choices =
          left_out.at(two.effects[0]).size() * left_out.at(two.effects[1]).size();
      stage.hypotheses.push_back(WithFit(std::move(two), inputs.blocks, std::move(paths),
                                         -std::log(static_cast<double>(choices))));
      ++stage.fits;
    }
  }
  return stage;
}

// Appends the paths of the map to `maps`, which outlives the fits.
ComparisonStage FitSmoothMap(const ComparisonInputs& inputs, size_t done,
                             std::vector<std::vector<LightPath>>* maps) {
  PathHypothesis unknown;
  unknown.effects = {std::string(kUnknownLight)};
  unknown.log_prior = LogPriorOfMap(CountsOf(inputs.paths));
  // No stage is measured; light is the most general description.
  unknown.stage = "illumination";
  ComparisonStage stage;
  for (const double scale : kMapScales_electrons) {
    if (!inputs.Report(done + stage.fits, "free map")) {
      stage.finished = false;
      return stage;
    }
    maps->push_back(SmoothMap(inputs.scene, inputs.blocks.grid().recordings, scale));
    PathChoice paths = inputs.paths.nominal;
    for (const LightPath& path : maps->back()) paths.push_back(&path);
    unknown = WithFit(std::move(unknown), inputs.blocks, std::move(paths),
                      -std::log(static_cast<double>(std::size(kMapScales_electrons))));
    ++stage.fits;
  }
  stage.hypotheses.push_back(std::move(unknown));
  return stage;
}

void FindProbabilities(PathComparison* comparison) {
  const JudgedPaths judged = JudgePaths(comparison->hypotheses);
  for (size_t h = 0; h < comparison->hypotheses.size(); ++h) {
    comparison->hypotheses[h].probability = judged.probability[h];
    comparison->hypotheses[h].predicts = judged.predicts[h];
  }
  comparison->remainder = judged.remainder;
}

}  // namespace

PathComparison ComparePaths(const RecordedScene& scene, const SceneLight& light,
                            const BlockMeans& blocks, const PathComparisonSettings& settings,
                            const PathComparisonProgress& progress) {
  ComparisonInputs inputs{
      scene, blocks, settings, progress, SortPaths(light, settings.excluded_effects), 0};
  inputs.fits = CountFits(inputs.paths, settings);
  PathComparison comparison;
  size_t done = 0;
  const auto keep = [&](ComparisonStage stage) {
    done += stage.fits;
    for (PathHypothesis& h : stage.hypotheses) comparison.hypotheses.push_back(std::move(h));
    comparison.finished = stage.finished;
  };

  inputs.Report(done, "null model");  // fitted whether it stops or not
  comparison.hypotheses.push_back(FitNullModel(inputs));
  done = 1;
  keep(FitSingles(inputs, done));
  if (comparison.finished && !settings.singles_only) {
    keep(FitPairs(inputs, std::span(comparison.hypotheses).subspan(1), done));
  }
  if (comparison.finished && !settings.singles_only) {
    keep(FitSmoothMap(inputs, done, &comparison.maps));
  }
  FindProbabilities(&comparison);
  return comparison;
}

}  // namespace sightline
