// SPDX-License-Identifier: Apache-2.0
// How much of what a concealed set's effect changes the effects that were answered instead explain.
//   prove_equivalents OUT ANSWERS: writes ANSWERS/equivalents.json
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "bench/concealed/truth_file.h"
#include "render_worker/diagnosis/fit/power.h"

namespace sightline::bench {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// Effects among the first three explanations of every answer about a set, as fitted there.
std::map<std::string, ActiveEffect> Answered(const fs::path& answers, const std::string& set) {
  std::map<std::string, ActiveEffect> answered;
  for (const fs::path& path :
       {answers / (set + ".json"), answers / "leave_one_out" / (set + ".json")}) {
    if (!fs::exists(path)) continue;
    const Json answer = ReadJson(path);
    if (!answer.contains("ranked")) continue;
    for (size_t i = 0; i < answer["ranked"].size() && i < 3; ++i) {
      const std::string id = answer["ranked"][i]["effect"];
      if (FindEffect(id) == nullptr) continue;  // none, unknown
      answered.emplace(id, TrueEffect(answer["ranked"][i]));
    }
  }
  return answered;
}

// Fraction of the gain expected from the truth that each of the others gains as well, refitted.
Json Explained(const RecordedSet& set, const Json& truth,
               const std::map<std::string, ActiveEffect>& others) {
  SetParameters at;
  at.deviations = TrueDeviation(truth["nuisance"]);
  const NullInformation information(set, {}, at);
  const std::vector<ActiveEffect> effect = {TrueEffect(truth["effects"][0])};
  const double none = information.ExpectedGain({});  // deviations moved towards the nominal ones
  const double gain = information.ExpectedGain(effect) - none;
  Json shares = Json::object();
  for (const auto& [id, other] : others) {
    const double left = information.GainLeft(effect, {other}) - none;
    shares[id] = gain > 0 ? std::clamp(1 - left / gain, 0.0, 1.0) : 0.0;
  }
  return shares;
}

void Run(const fs::path& out, const fs::path& answers) {
  const fs::path result = answers / "equivalents.json";
  Json proven = fs::exists(result) ? ReadJson(result) : Json::object();
  std::set<fs::path> truths;
  for (const auto& entry : fs::directory_iterator(out / "truth")) truths.insert(entry.path());
  for (const fs::path& path : truths) {
    const Json truth = ReadJson(path);
    const std::string name = truth["set"];
    // For pairs the scorer asks for the effects themselves; what is drawn anew has no expected
    // gain.
    if (truth["effects"].size() != 1 || truth["effects"][0]["gain_expected"] == "unknown") continue;
    std::map<std::string, ActiveEffect> others = Answered(answers, name);
    std::erase_if(others, [&](const auto& other) {
      return other.first == truth["effects"][0]["effect"] ||
             (proven.contains(name) && proven[name].contains(other.first));
    });
    if (others.empty()) continue;
    proven[name].update(Explained(ReadSet(out / "sets" / name), truth, others));
    std::printf("%s\n", name.c_str());
    std::fflush(stdout);
    std::ofstream file(result);
    file << proven.dump(1) << "\n";
    if (!file) Fail(result.string() + ": cannot be written");
  }
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) {
  CLI::App app("Opens the truth of concealed sets: which answers are as good as the true effect");
  std::string out, answers;
  app.add_option("OUT", out, "as make_concealed_sets wrote it")->required();
  app.add_option("ANSWERS", answers, "as run_concealed.py wrote them")->required();
  CLI11_PARSE(app, argc, argv);
  if (!std::filesystem::is_directory(std::filesystem::path(out) / "truth")) {
    sightline::bench::Fail(out + "/truth: no such folder");
  }
  if (!std::filesystem::is_directory(answers)) {
    sightline::bench::Fail(answers + ": no such folder");
  }
  sightline::bench::Run(out, answers);
  return 0;
}
