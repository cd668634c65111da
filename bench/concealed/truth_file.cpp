// SPDX-License-Identifier: Apache-2.0
#include "bench/concealed/truth_file.h"

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <numbers>
#include <utility>
#include <vector>

#include "bench/concealed/outside_laws/outside_laws.h"
#include "bench/concealed/variant_laws.h"
#include "core/recordings/recordings.h"
#include "render_worker/image_file/image_file.h"

namespace sightline::bench {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

void Fail(const std::string& message) {
  std::fprintf(stderr, "concealed sets: %s\n", message.c_str());
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
  if (const OutsideLaw* law = FindOutsideLaw(id)) effect = law->effect;
  if (effect == nullptr) Fail(id + ": no such effect");
  ActiveEffect active{effect, {}};
  for (const EffectParameter& parameter : effect->description().parameters) {
    active.parameters.push_back(json["parameters"][std::string(parameter.name)]);
  }
  return active;
}

SetupDeviation TrueDeviation(const Json& json) {
  SetupDeviation deviation;
  for (int i = 0; i < kDeviations; ++i) {
    const std::string name = kDeviationNames[i];
    if (name == "line_position_each_px") continue;  // of every position, not known here
    const double unit = name.ends_with("_deg") ? std::numbers::pi / 180 : 1.0;
    DeviationAt(deviation, i) = json[name].get<double>() * unit;
  }
  return deviation;
}

}  // namespace sightline::bench
