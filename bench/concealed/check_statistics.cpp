// SPDX-License-Identifier: Apache-2.0
// Do the statistics scatter as their covariance says, once the truth is known? Fits a set's true
// effects and the known parameters from their true values and prints, by statistic, what is left;
// and what the effects gain.
//   check_statistics OUT [--only SET...]
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "bench/concealed/truth_file.h"
#include "render_worker/diagnosis/fit/fit.h"
#include "render_worker/diagnosis/fit/set_model.h"

namespace sightline::bench {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct Left {
  double chi_squared = 0, common = 0;
  int count = 0, entries = 0;
};

// Chi squared, and that of each entry's amount: what all its numbers have in common with what is
// expected of them. Neighbouring numbers share little else, so that alone shows errors of a per
// cent.
std::map<std::string, Left> LeftByStatistic(const SetModel& model, const FitResult& fit) {
  constexpr double kWellKnown = 10;  // amounts over their errors; others are uninformative
  std::map<std::string, Left> by_statistic;
  for (int e = 0; e < model.blocks(); ++e) {
    Left& left = by_statistic[std::string(model.StatisticOf(e).name())];
    left.chi_squared += fit.residual[e].squaredNorm();
    left.count += static_cast<int>(fit.residual[e].size());
    const Eigen::VectorXd expected = (*fit.whitening)(e, fit.mean[e]);
    if (expected.norm() < kWellKnown) continue;
    const double amount = expected.dot(fit.residual[e]) / expected.norm();
    left.common += amount * amount;
    ++left.entries;
  }
  return by_statistic;
}

// Gain of the recordings over no effects, to compare with ExpectedGain. Both use the covariance of
// `fit`.
double GainOverNone(const SetModel& model, const FitResult& fit, FitSettings fitting) {
  fitting.rounds.clear();
  fitting.max_iterations = 40;
  fitting.most_renewals = 3;
  SetParameters none = fit.parameters;
  none.effects.clear();
  const FitResult null = FitSet(model, none, {}, fitting, &fit);
  return 0.5 * (null.chi_squared + null.prior - fit.chi_squared - fit.prior);
}

void Check(const RecordedSet& set, const Json& truth, int threads) {
  SetModelSettings settings;
  settings.threads = threads;
  const SetModel model(set, settings);
  SetParameters start;
  start.deviations = TrueDeviation(truth["nuisance"]);
  for (const Json& effect : truth["effects"]) start.effects.push_back(TrueEffect(effect));
  start.line_shift_px = EstimateLineShifts(model, start);
  FitSettings fitting;
  fitting.rounds = {{0.1, 0.1}, {0, 0.02}, {0, 0}, {0, 0}};
  const FitResult fit = FitSet(model, start, FreeParameters(start.effects), fitting, nullptr);
  std::printf("%s: chi squared %.0f of %d\n", truth["set"].get<std::string>().c_str(),
              fit.chi_squared, fit.data_count);
  for (size_t f = 0; f < fit.free.size(); ++f) {
    const auto [effect, parameter] = fit.free[f];
    const EffectDescription& description = start.effects[effect].effect->description();
    std::printf("  %s %s: %.6g +- %.2g, truth %.6g\n", std::string(description.id).c_str(),
                std::string(description.parameters[parameter].name).c_str(),
                fit.parameters.effects[effect].parameters[parameter], fit.effect_standard_errors[f],
                start.effects[effect].parameters[parameter]);
  }
  if (!start.effects.empty()) {
    std::printf("  gain over none: %.1f nats, expected %s\n", GainOverNone(model, fit, fitting),
                truth["effects"][0]["gain_expected"].dump().c_str());
  }
  for (const auto& [name, left] : LeftByStatistic(model, fit)) {
    std::printf("  %-16s %7.2f per number (%d)", name.c_str(), left.chi_squared / left.count,
                left.count);
    if (left.entries > 0) {
      std::printf(", %7.2f of amounts (%d)", left.common / left.entries, left.entries);
    }
    std::printf("\n");
  }
  std::fflush(stdout);
}

void Run(const fs::path& out, const std::vector<std::string>& only, int threads) {
  std::set<fs::path> truths;
  for (const auto& entry : fs::directory_iterator(out / "truth")) truths.insert(entry.path());
  for (const fs::path& path : truths) {
    const std::string name = path.stem().string();
    if (!only.empty() && std::find(only.begin(), only.end(), name) == only.end()) continue;
    Check(ReadSet(out / "sets" / name), ReadJson(path), threads);
  }
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) {
  CLI::App app("Opens the truth of concealed sets: do the statistics scatter as expected?");
  std::string out;
  std::vector<std::string> only;
  int threads = 2;
  app.add_option("OUT", out, "as make_concealed_sets wrote it")->required();
  app.add_option("--only", only, "of these sets, those that have these names");
  app.add_option("--threads", threads)->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  if (!std::filesystem::is_directory(std::filesystem::path(out) / "truth")) {
    sightline::bench::Fail(out + "/truth: no such folder");
  }
  sightline::bench::Run(out, only, threads);
  return 0;
}
