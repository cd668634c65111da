// SPDX-License-Identifier: Apache-2.0
// How much does the further recording tell that a diagnosis asked for? Writes every concealed set
// again with that recording, rendered from its truth.
//   record_proposed OUT ANSWERS MORE
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "bench/concealed/truth_file.h"
#include "core/recordings/recordings.h"
#include "render_worker/image_chain/form_image.h"
#include "render_worker/image_file/image_file.h"
#include "render_worker/recordings/plate_frames.h"

namespace sightline::bench {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr char kFile[] = "images/proposed.png";

void WriteJson(const Json& json, const fs::path& path) {
  std::ofstream file(path);
  file << json.dump(1) << "\n";
  if (!file) Fail(path.string() + ": cannot be written");
}

// The recording that the answer asks for first; null: it asks for none.
Json Proposed(const Json& answer) {
  if (!answer.contains("full") || !answer["full"].contains("next_recordings")) return nullptr;
  const Json& next = answer["full"]["next_recordings"];
  return next.empty() ? Json(nullptr) : next[0]["recording"];
}

// Adds `proposed` to a description, at a plate position and in a repeat group of its own.
void Append(Json proposed, Json* description) {
  for (const char* id : {"plate_position_id", "repeat_group"}) {
    int largest = 0;
    for (const Json& recording : (*description)["recordings"]) {
      // Dark frames have no plate position: null.
      if (!recording.contains(id) || recording[id].is_null()) continue;
      largest = std::max(largest, recording[id].get<int>());
    }
    const bool is_dark = proposed["kind"] == "dark";
    if (std::string(id) == "repeat_group" || !is_dark) {
      proposed[id] = largest + 1;
    } else {
      proposed[id] = nullptr;
    }
  }
  proposed["file"] = kFile;
  (*description)["recordings"].push_back(std::move(proposed));
}

Image<uint16_t> RenderLast(const RecordingSet& set, const Json& truth) {
  std::vector<ActiveEffect> effects;
  for (const Json& effect : truth["effects"]) effects.push_back(TrueEffect(effect));
  if (effects.size() > 1) {
    if (const absl::Status status = OrderEffects(&effects); !status.ok()) Fail(status.ToString());
  }
  PlateFrameOptions options;
  options.deviation = TrueDeviation(truth["nuisance"]);
  options.deviation.line_position_each_px = truth["nuisance"]["line_position_each_px"];
  options.seed = truth["seed"];
  const int last = static_cast<int>(set.recordings.size()) - 1;
  auto image = RenderPlateFrame(PlateFrame(set, last, options), effects, nullptr, 1);
  if (!image.ok()) Fail(image.status().ToString());
  return std::move(image->raw_dn);
}

void Run(const fs::path& out, const fs::path& answers, const fs::path& more) {
  fs::create_directories(more / "sets");
  fs::create_directories(more / "truth");
  std::set<fs::path> truths;
  for (const auto& entry : fs::directory_iterator(out / "truth")) truths.insert(entry.path());
  int written = 0;
  for (const fs::path& path : truths) {
    const Json truth = ReadJson(path);
    const std::string name = truth["set"];
    const fs::path folder = more / "sets" / name;
    if (fs::exists(folder) || !fs::exists(answers / (name + ".json"))) continue;
    Json proposed = Proposed(ReadJson(answers / (name + ".json")));
    if (proposed.is_null()) continue;
    Json description = ReadJson(out / "sets" / name / "recordings.json");
    Append(std::move(proposed), &description);
    fs::copy(out / "sets" / name, folder, fs::copy_options::recursive);
    WriteJson(description, folder / "recordings.json");
    const auto set = ReadRecordings((folder / "recordings.json").string());
    if (!set.ok()) Fail(set.status().ToString());
    const absl::Status status = WriteRawImage((folder / kFile).string(), RenderLast(*set, truth),
                                              "laser line on a plate", ImageFormat::kPng);
    if (!status.ok()) Fail(status.ToString());
    fs::copy_file(path, more / "truth" / path.filename());
    ++written;
  }
  std::printf("%d of %zu sets have one more recording\n", written, truths.size());
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) {
  CLI::App app("Adds to concealed sets the recording that their diagnosis asked for");
  std::string out, answers, more;
  app.add_option("OUT", out, "as make_concealed_sets wrote it")->required();
  app.add_option("ANSWERS", answers, "as run_concealed.py wrote them")->required();
  app.add_option("MORE", more, "folder of the new sets; sets that are there are kept")->required();
  CLI11_PARSE(app, argc, argv);
  for (const std::string& folder : {out + "/truth", answers}) {
    if (!std::filesystem::is_directory(folder)) {
      sightline::bench::Fail(folder + ": no such folder");
    }
  }
  sightline::bench::Run(out, answers, more);
  return 0;
}
