// SPDX-License-Identifier: Apache-2.0
// How far the nearest other explanation of each concealed set is, in nats, and which it is.
//   distinguishability OUT [--quick] [--only SET...]: writes OUT/distinguishability.json
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "bench/concealed/nearest_explanation.h"
#include "bench/concealed/truth_file.h"

namespace sightline::bench {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

std::string IdOf(const OtherExplanation& other) {
  return other.effect == nullptr ? "none" : std::string(other.effect->description().id);
}

Json Measure(const fs::path& out, const Json& truth, const NearestSettings& settings) {
  const RecordedSet set = ReadSet(out / "sets" / truth["set"].get<std::string>());
  SetParameters at;
  at.deviations = TrueDeviation(truth["nuisance"]);
  std::vector<ActiveEffect> effects;
  std::vector<std::string> not_these;
  Json json;
  for (const Json& effect : truth["effects"]) {
    effects.push_back(TrueEffect(effect));
    json["truth"].push_back(effect["effect"]);
    for (const Json& id : effect["accepted"]) not_these.push_back(id);
  }
  // An effect of a pair alone is another explanation.
  if (effects.size() > 1) not_these.clear();
  const Distinguishability found = NearestExplanation(set, effects, at, not_these, settings);
  json["gain_nats"] = found.gain_nats;
  json["nearest"] = IdOf(found.others.front());
  json["d_nats"] = found.nats();
  json["bin"] = BinOfNats(found.nats());
  json["others"] = Json::object();
  for (const OtherExplanation& other : found.others) json["others"][IdOf(other)] = other.left_nats;
  return json;
}

void Run(const fs::path& out, const std::vector<std::string>& only,
         const NearestSettings& settings) {
  const fs::path result = out / "distinguishability.json";
  Json measured = fs::exists(result) ? ReadJson(result) : Json::object();
  std::set<fs::path> truths;
  for (const auto& entry : fs::directory_iterator(out / "truth")) truths.insert(entry.path());
  std::printf("%-14s %-34s %9s %9s  %-5s %s\n", "set", "truth", "gain", "D", "bin", "nearest");
  std::map<std::string, int> bins;
  for (const fs::path& path : truths) {
    const Json truth = ReadJson(path);
    const std::string name = truth["set"];
    const bool wanted = only.empty() || std::find(only.begin(), only.end(), name) != only.end();
    if (!wanted || truth["effects"].empty()) continue;
    // A law that the expectation does not show has no expected loss.
    if (truth["effects"][0]["gain_expected"] == "unknown") {
      std::printf("%-14s %-34s no expected gain\n", name.c_str(),
                  truth["effects"][0]["effect"].get<std::string>().c_str());
      continue;
    }
    const auto start = std::chrono::steady_clock::now();
    if (!measured.contains(name)) {
      measured[name] = Measure(out, truth, settings);
      std::ofstream file(result);
      file << measured.dump(1) << "\n";
      if (!file) Fail(result.string() + ": cannot be written");
    }
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
    const Json& one = measured[name];
    ++bins[one["bin"].get<std::string>()];
    std::printf("%-14s %-34s %9.1f %9.1f  %-5s %s, %.0f s\n", name.c_str(),
                one["truth"][0].get<std::string>().c_str(), one["gain_nats"].get<double>(),
                one["d_nats"].get<double>(), one["bin"].get<std::string>().c_str(),
                one["nearest"].get<std::string>().c_str(), taken.count());
    std::fflush(stdout);
  }
  for (const char* bin : {"< 3", "3-10", "> 10"}) std::printf("D %s: %d sets\n", bin, bins[bin]);
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) {
  CLI::App app("Opens the truth of concealed sets: how far is the nearest other explanation?");
  std::string out;
  std::vector<std::string> only;
  bool quick = false;
  sightline::bench::NearestSettings settings;
  app.add_option("OUT", out, "as make_concealed_sets wrote it")->required();
  app.add_option("--only", only, "sets; default all");
  app.add_flag("--quick", quick, "refit three other effects instead of eight");
  app.add_option("--threads", settings.threads)->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  if (!std::filesystem::is_directory(std::filesystem::path(out) / "truth")) {
    sightline::bench::Fail(out + "/truth: no such folder");
  }
  if (quick) settings.refits = 3;
  sightline::bench::Run(out, only, settings);
  return 0;
}
