// SPDX-License-Identifier: Apache-2.0
#include "render_worker/scene_diagnosis/compare_paths.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace sightline {
namespace {

// Prior beliefs before the recordings are seen.
constexpr double kPriorNone = 0.5, kPriorOne = 0.35, kPriorTwo = 0.05, kPriorUnknown = 0.1;
// Singles that may be one of a pair.
constexpr size_t kPairPartners = 3;
// Cosines per axis of the free map, and standard deviations of their factors [electrons].
constexpr int kMapOrder = 5;
constexpr double kMapScales_electrons[] = {1, 4, 16, 64};

double LogAdd(double a, double b) {
  const double larger = std::max(a, b);
  return std::isinf(larger) ? larger : larger + std::log1p(std::exp(std::min(a, b) - larger));
}

// Cosines over the image, the same in every recording with light.
std::vector<LightPath> FreeMap(const RecordedScene& scene, int recordings, double scale_electrons) {
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
      for (int r = 0; r < recordings; ++r) {
        const RecordedImage& recorded = scene.recordings.recordings[static_cast<size_t>(r)];
        path.electrons.push_back(
            recorded.kind == RecordingKind::kDark ? Image<double>(columns, rows) : image);
      }
      map.push_back(std::move(path));
    }
  }
  return map;
}

class Comparing {
 public:
  Comparing(const RecordedScene& scene, const SceneLight& light, const BlockMeans& blocks,
            const PathComparisonSettings& settings,
            const std::function<bool(double, std::string_view)>& progress)
      : scene_(scene), blocks_(blocks), settings_(settings), progress_(progress) {
    const std::vector<std::string>& excluded = settings.excluded_effects;
    for (const LightPath& path : light.paths) {
      if (path.nominal) {
        nominal_.push_back(&path);
      } else if (std::find(excluded.begin(), excluded.end(), path.effect) == excluded.end()) {
        left_out_[path.effect].push_back(&path);
      }
    }
    const size_t partners = settings.max_effects > 1 ? kPairPartners : 0;
    size_t shapes = 0, pairs = 0;
    for (const auto& [effect, choices] : left_out_) shapes += choices.size();
    for (size_t a = 0; a < std::min(partners, left_out_.size()); ++a) {
      pairs += left_out_.size() - a - 1;
    }
    fits_ = 1 + shapes;
    if (!settings.singles_only) fits_ += pairs + std::size(kMapScales_electrons);
  }

  PathComparison Run() {
    Hypothesis none;
    none.log_prior = std::log(kPriorNone);
    progress_(0, "null model");
    Consider(&none, nominal_, 0);
    Keep(std::move(none));
    comparison_.finished = FitSingles() && (settings_.singles_only || (FitPairs() && FitFreeMap()));
    FindProbabilities();
    return std::move(comparison_);
  }

 private:
  // False: stop.
  bool Report(std::string_view what) {
    return progress_(static_cast<double>(done_) / static_cast<double>(fits_), what);
  }

  void Consider(Hypothesis* hypothesis, PathChoice paths, double log_share) {
    PathFit fit = FitPaths(blocks_, std::move(paths));
    ++done_;
    const bool better =
        hypothesis->best.paths.empty() || fit.LogPredictive() > hypothesis->best.LogPredictive();
    hypothesis->log_predictive =
        LogAdd(hypothesis->log_predictive, fit.LogPredictive() + log_share);
    if (better) hypothesis->best = std::move(fit);
  }

  void Keep(Hypothesis hypothesis) { comparison_.hypotheses.push_back(std::move(hypothesis)); }

  bool FitSingles() {
    for (const auto& [effect, shapes] : left_out_) {
      if (!Report(effect)) return false;
      Hypothesis one;
      one.effects = {effect};
      one.stage = shapes.front()->stage;
      one.log_prior = std::log(kPriorOne / static_cast<double>(left_out_.size()));
      for (const LightPath* shape : shapes) {
        PathChoice paths = nominal_;
        paths.push_back(shape);
        Consider(&one, std::move(paths), -std::log(static_cast<double>(shapes.size())));
      }
      Keep(std::move(one));
    }
    return true;
  }

  bool FitPairs() {
    const std::vector<Hypothesis>& hypotheses = comparison_.hypotheses;
    std::vector<size_t> order;
    for (size_t i = 1; i < hypotheses.size(); ++i) order.push_back(i);
    std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
      return hypotheses[a].log_predictive > hypotheses[b].log_predictive;
    });
    const auto effects = static_cast<double>(left_out_.size());
    const double pairs = 0.5 * effects * (effects - 1);
    const size_t partners = settings_.max_effects > 1 ? kPairPartners : 0;
    for (size_t a = 0; a < std::min(partners, order.size()); ++a) {
      for (size_t b = a + 1; b < order.size(); ++b) {
        const Hypothesis& first = hypotheses[order[a]];
        const Hypothesis& second = hypotheses[order[b]];
        Hypothesis two;
        two.effects = {first.effects.front(), second.effects.front()};
        two.stage = first.stage;
        two.log_prior = std::log(kPriorTwo / pairs);
        if (!Report(two.Name())) return false;
        // The best shape of each, found alone.
        PathChoice paths = nominal_;
        paths.push_back(first.best.paths.back());
        paths.push_back(second.best.paths.back());
        Consider(&two, std::move(paths),
                 -std::log(static_cast<double>(left_out_[two.effects[0]].size() *
                                               left_out_[two.effects[1]].size())));
        Keep(std::move(two));
      }
    }
    return true;
  }

  bool FitFreeMap() {
    Hypothesis unknown;
    unknown.effects = {"unknown"};
    unknown.log_prior = std::log(kPriorUnknown);
    unknown.stage = "illumination";
    for (const double scale : kMapScales_electrons) {
      if (!Report("free map")) return false;
      comparison_.maps.push_back(FreeMap(scene_, blocks_.recordings(), scale));
      PathChoice paths = nominal_;
      for (const LightPath& path : comparison_.maps.back()) paths.push_back(&path);
      Consider(&unknown, std::move(paths),
               -std::log(static_cast<double>(std::size(kMapScales_electrons))));
    }
    Keep(std::move(unknown));
    return true;
  }

  void FindProbabilities() {
    double log_sum = -std::numeric_limits<double>::infinity();
    for (const Hypothesis& h : comparison_.hypotheses) {
      log_sum = LogAdd(log_sum, h.log_prior + h.log_predictive);
    }
    for (Hypothesis& h : comparison_.hypotheses) {
      h.probability = std::exp(h.log_prior + h.log_predictive - log_sum);
    }
  }

  const RecordedScene& scene_;
  const BlockMeans& blocks_;
  const PathComparisonSettings& settings_;
  const std::function<bool(double, std::string_view)>& progress_;
  PathChoice nominal_;
  std::map<std::string, PathChoice> left_out_;  // by effect: its shapes
  size_t fits_ = 0, done_ = 0;
  PathComparison comparison_;
};

}  // namespace

std::string Hypothesis::Name() const {
  return effects.empty() ? "none" : absl::StrJoin(effects, " + ");
}

PathComparison ComparePaths(const RecordedScene& scene, const SceneLight& light,
                            const BlockMeans& blocks, const PathComparisonSettings& settings,
                            const std::function<bool(double, std::string_view)>& progress) {
  return Comparing(scene, light, blocks, settings, progress).Run();
}

}  // namespace sightline
