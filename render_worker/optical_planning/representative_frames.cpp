// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optical_planning/representative_frames.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace sightline {
namespace {

constexpr int kFeatures = 5;
constexpr int kMostMedoidRounds = 50;
using Features = std::array<double, kFeatures>;

Features FeaturesOf(const FrameGlance& glance) {
  return {static_cast<double>(glance.lit_samples), glance.mean_log_radiance,
          glance.deviation_log_radiance, glance.mean_depth_m, glance.deviation_depth_m};
}

double Distance2(const Features& a, const Features& b) {
  double sum = 0;
  for (int k = 0; k < kFeatures; ++k) sum += (a[k] - b[k]) * (a[k] - b[k]);
  return sum;
}

}  // namespace

Representatives ChooseRepresentatives(const std::vector<FrameGlance>& glances, int count) {
  std::vector<int> lit;
  for (size_t i = 0; i < glances.size(); ++i) {
    if (glances[i].lit_samples > 0) lit.push_back(static_cast<int>(i));
  }
  Representatives result;
  if (lit.empty()) return result;
  std::vector<Features> features;
  std::vector<double> weights;
  double total = 0;
  for (const int i : lit) {
    features.push_back(FeaturesOf(glances[i]));
    weights.push_back(glances[i].lit_samples);
    total += glances[i].lit_samples;
  }
  Features mean{}, deviation{};
  for (size_t i = 0; i < lit.size(); ++i) {
    for (int k = 0; k < kFeatures; ++k) mean[k] += weights[i] / total * features[i][k];
  }
  for (size_t i = 0; i < lit.size(); ++i) {
    for (int k = 0; k < kFeatures; ++k) {
      deviation[k] += weights[i] / total * std::pow(features[i][k] - mean[k], 2);
    }
  }
  double variance = 0;
  for (int k = 0; k < kFeatures; ++k) {
    // Differences by rounding alone do not count.
    const bool differs = std::sqrt(deviation[k]) > 1e-9 * std::max(std::abs(mean[k]), 1e-12);
    const double scale = differs ? 1 / std::sqrt(deviation[k]) : 0;
    if (differs) variance += 1;
    for (Features& f : features) f[k] = (f[k] - mean[k]) * scale;
  }
  const int n = static_cast<int>(lit.size());
  const int groups = std::min(count, n);

  // Cost of a medoid for its group, and the best one of a group.
  const auto best_medoid = [&](const std::vector<int>& members) {
    int best = members[0];
    double least = std::numeric_limits<double>::infinity();
    for (const int candidate : members) {
      double sum = 0;
      for (const int member : members) {
        sum += weights[member] * Distance2(features[candidate], features[member]);
      }
      if (sum < least) {
        least = sum;
        best = candidate;
      }
    }
    return best;
  };
  std::vector<int> all(static_cast<size_t>(n));
  for (int i = 0; i < n; ++i) all[i] = i;
  std::vector<int> medoids = {best_medoid(all)};
  const auto nearest = [&](int i) {
    int best = 0;
    for (int m = 1; m < static_cast<int>(medoids.size()); ++m) {
      if (Distance2(features[i], features[medoids[m]]) <
          Distance2(features[i], features[medoids[best]])) {
        best = m;
      }
    }
    return best;
  };
  while (static_cast<int>(medoids.size()) < groups) {
    int farthest = -1;
    double most = 0;
    for (int i = 0; i < n; ++i) {
      const double d = weights[i] * Distance2(features[i], features[medoids[nearest(i)]]);
      if (d > most) {
        most = d;
        farthest = i;
      }
    }
    if (farthest < 0) break;  // the rest is alike
    medoids.push_back(farthest);
  }
  std::vector<std::vector<int>> members;
  for (int round = 0; round < kMostMedoidRounds; ++round) {
    members.assign(medoids.size(), {});
    for (int i = 0; i < n; ++i) members[nearest(i)].push_back(i);
    std::vector<int> moved;
    for (const std::vector<int>& group : members) moved.push_back(best_medoid(group));
    if (moved == medoids) break;
    medoids = moved;
  }
  members.assign(medoids.size(), {});
  for (int i = 0; i < n; ++i) members[nearest(i)].push_back(i);

  double within = 0, most = 0;
  for (size_t m = 0; m < medoids.size(); ++m) {
    double weight = 0;
    Features centre{};
    for (const int i : members[m]) {
      weight += weights[i];
      for (int k = 0; k < kFeatures; ++k) centre[k] += weights[i] * features[i][k];
    }
    for (double& c : centre) c /= weight;
    for (const int i : members[m]) {
      within += weights[i] / total * Distance2(features[i], centre);
      const double d = Distance2(features[i], features[medoids[m]]);
      if (d > most) {
        most = d;
        result.farthest = lit[i];
      }
    }
    result.frames.push_back({lit[medoids[m]], weight / total});
  }
  std::sort(result.frames.begin(), result.frames.end(),
            [](const auto& a, const auto& b) { return a.index < b.index; });
  result.represented_fraction = variance > 0 ? std::clamp(1 - within / variance, 0.0, 1.0) : 1;
  return result;
}

}  // namespace sightline
