// How much of what a concealed set's effect changes the effects that were answered instead explain.
//   prove_equivalents OUT ANSWERS: writes ANSWERS/equivalents.json
#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "bench/concealed/equivalents.h"
#include "bench/concealed/variant_laws.h"
#include "core/recordings/recordings.h"
#include "render_worker/diagnosis/fit.h"
#include "render_worker/diagnosis/linear_fit.h"
#include "render_worker/diagnosis/recorded_set.h"
#include "render_worker/image_file/image_file.h"

namespace sightline::bench {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

[[noreturn]] void Fail(const std::string& message) {
  std::fprintf(stderr, "prove_equivalents: %s\n", message.c_str());
  std::exit(1);
}

Json ReadJson(const fs::path& path) {
  std::ifstream file(path);
  Json json = Json::parse(file, nullptr, false);
  if (json.is_discarded()) Fail(path.string() + ": not there, or no JSON");
  return json;
}

RecordedSet ReadSet(const fs::path& folder) {
  auto description = ReadRecordings((folder / "recordings.json").string());
  if (!description.ok()) Fail(description.status().ToString());
  std::vector<Image<uint16_t>> images;
  for (const RecordedImage& recording : description->recordings) {
    auto image = ReadRawImage((folder / recording.file).string());
    if (!image.ok()) Fail(image.status().ToString());
    images.push_back(*std::move(image));
  }
  return MakeRecordedSet(*std::move(description), std::move(images));
}

ActiveEffect TrueEffect(const Json& json) {
  const std::string id = json["effect"];
  const Effect* effect = FindEffect(id);
  for (const VariantLaw& law : VariantLaws()) {
    if (law.effect->description().id == id) effect = law.effect;
  }
  if (effect == nullptr) Fail(id + ": no such effect");
  ActiveEffect active{effect, {}};
  for (const EffectParameter& parameter : effect->description().parameters) {
    active.parameters.push_back(json["parameters"][std::string(parameter.name)]);
  }
  return active;
}

// Effects among the first three explanations of every answer about a set.
std::set<std::string> Answered(const fs::path& answers, const std::string& set) {
  std::set<std::string> ids;
  for (const fs::path& path :
       {answers / (set + ".json"), answers / "leave_one_out" / (set + ".json")}) {
    if (!fs::exists(path)) continue;
    const Json answer = ReadJson(path);
    if (!answer.contains("ranked")) continue;
    for (size_t i = 0; i < answer["ranked"].size() && i < 3; ++i) {
      ids.insert(answer["ranked"][i]["effect"].get<std::string>());
    }
  }
  return ids;
}

Json Explained(const fs::path& folder, const ActiveEffect& truth,
               const std::vector<const Effect*>& others) {
  // Coarser than the diagnosis: shares, not numbers, are wanted.
  SetModelSettings settings;
  settings.blocks_along_line = 3;
  settings.speckle_levels = 6;
  const RecordedSet set = ReadSet(folder);
  const SetModel model(set, settings);
  const FitResult fit = LineariseSet(model, {});
  const LinearFit linear(fit);
  ChangeModel changes;
  changes.change = [&](const std::vector<ActiveEffect>& effects) {
    SetParameters parameters;
    parameters.effects = effects;
    Eigen::VectorXd change = linear.Change(model.Expect(parameters, false).mean);
    // Beyond sense, e.g. a closed pupil: like nothing else.
    if (!change.allFinite()) change.setZero();
    return change;
  };
  changes.project = [&](const Eigen::VectorXd& change) { return linear.Project(change); };
  Alternatives alternatives(changes, set.description.camera);
  Json shares = Json::object();
  for (const Effect* other : others) {
    shares[std::string(other->description().id)] = alternatives.Explained(truth, *other);
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
    // Of pairs the scorer asks for the effects themselves.
    if (truth["effects"].size() != 1) continue;
    const ActiveEffect effect = TrueEffect(truth["effects"][0]);
    std::vector<const Effect*> others;
    for (const std::string& id : Answered(answers, name)) {
      const Effect* other = FindEffect(id);
      const bool known = proven.contains(name) && proven[name].contains(id);
      if (other != nullptr && other != effect.effect && !known) others.push_back(other);
    }
    if (others.empty()) continue;
    proven[name].update(Explained(out / "sets" / name, effect, others));
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
