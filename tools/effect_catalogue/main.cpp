// SPDX-License-Identifier: Apache-2.0
// Writes the catalogue of effects from the registry: docs/effects.md with a picture of each, and
// docs/effects.json for programs. What the renderer can switch on and the diagnosis can name.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"
#include "core/file/atomic_write.h"
#include "render_worker/effects/effect.h"
#include "render_worker/effects/stage_name.h"
#include "render_worker/image_chain/form_image.h"
#include "render_worker/image_file/grey_png.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

// Pictures show this many prior scales of the first parameter: clearly visible, still usual.
constexpr double kShownScales = 3;
constexpr int kGap_px = 4;

// A quiet colourless camera that sees a line a little out of focus, so that every stage has
// something to act on.
FrameSetup CatalogueFrame() {
  FrameSetup frame;
  frame.sensor.quantum_efficiency[0] = {{600e-9, 700e-9}, {0.5, 0.4}};
  frame.sensor.dark_mean_electrons = 30;
  frame.sensor.dark_noise_electrons = 6;
  frame.lens.focal_length_m = 0.016;
  frame.lens.f_number = 4;
  frame.lens.focus_distance_m = 0.337;
  frame.lens.transmission = 0.9;
  frame.laser.power_w = 5e-4;
  frame.laser.divergence_rad = 1e-3;
  frame.laser.beam_focus_distance_m = 0.4;
  frame.laser.fan_angle_rad = 0.7;
  frame.plate = {0.34, 0.39, std::numbers::pi / 4, 0};
  frame.roi = {-60, -40, 120, 80};
  frame.seeds = {11, 12, 13, 14};
  frame.exposure_time_s = 4e-3;
  frame.timestamp_s = 20;
  frame.burst_frame_index = 1;
  return frame;
}

std::vector<double> Shown(const EffectDescription& description, size_t parameters) {
  std::vector<double> values;
  for (const EffectParameter& parameter : description.parameters) {
    const double scale = kShownScales * parameter.prior_scale;
    const double up = std::min(parameter.null_value + scale, parameter.upper);
    const double down = std::max(parameter.null_value - scale, parameter.lower);
    const bool changes = values.size() < parameters;
    values.push_back(!changes ? parameter.null_value : up > parameter.null_value ? up : down);
  }
  return values;
}

// Without the effect, with it, and the difference about grey.
absl::StatusOr<std::string> Picture(const Effect& effect) {
  const FrameSetup frame = CatalogueFrame();
  FrameSetup before = frame;
  before.plate.line_offset_m = 4e-3;
  before.burst_frame_index = 0;
  const auto previous = RenderPlateFrame(before, {}, nullptr, 1);
  if (!previous.ok()) return previous.status();
  const auto without = RenderPlateFrame(frame, {}, &previous->mean_photo_electrons, 1);
  if (!without.ok()) return without.status();
  absl::StatusOr<FormedImage> with = absl::UnknownError("");
  const size_t count = effect.description().parameters.size();
  for (const size_t parameters : {size_t{1}, count}) {
    const std::vector<ActiveEffect> effects = {{&effect, Shown(effect.description(), parameters)}};
    with = RenderPlateFrame(frame, effects, &previous->mean_photo_electrons, 1);
    if (!with.ok()) return with.status();
    if (!(with->raw_dn == without->raw_dn)) break;
  }
  const int columns = frame.roi.columns_px, rows = frame.roi.rows_px;
  const auto brightest = static_cast<double>(
      *std::max_element(without->raw_dn.values.begin(), without->raw_dn.values.end()));
  Image<uint8_t> picture(3 * columns + 2 * kGap_px, rows, 255);
  double largest = 0;
  for (size_t i = 0; i < with->raw_dn.values.size(); ++i) {
    largest = std::max(
        largest, std::abs(static_cast<double>(with->raw_dn.values[i]) - without->raw_dn.values[i]));
  }
  const auto grey = [](double value) {
    return static_cast<uint8_t>(std::lround(std::clamp(value, 0.0, 1.0) * 255));
  };
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const double a = without->raw_dn.At(row, column) / brightest;
      const double b = with->raw_dn.At(row, column) / brightest;
      // The square root lets the dim parts be seen.
      picture.At(row, column) = grey(std::sqrt(a));
      picture.At(row, column + columns + kGap_px) = grey(std::sqrt(b));
      const double difference = (b - a) * brightest / std::max(largest, 1.0);
      picture.At(row, column + 2 * (columns + kGap_px)) = grey(0.5 + 0.5 * difference);
    }
  }
  return EncodeGreyPng(picture);
}

std::string Cell(std::string_view text) {
  return absl::StrReplaceAll(std::string(text), {{"|", "\\|"}});
}

std::string Number(double value) { return absl::StrFormat("%.4g", value); }

std::string Section(const Effect& effect) {
  const EffectDescription& d = effect.description();
  const std::string id(d.id);
  std::string text =
      absl::StrCat("### ", id, "\n\n", std::string(d.summary), ".\n\n![", id,
                   ": without, with, difference](effects/", id, ".png)\n\n",
                   "Source: ", std::string(d.reference), ".\n\n",
                   "| parameter | without the effect | range | prior |\n", "|---|---|---|---|\n");
  for (const EffectParameter& parameter : d.parameters) {
    absl::StrAppend(&text, "| `", Cell(parameter.name), "` | ", Number(parameter.null_value), " | ",
                    Number(parameter.lower), " to ", Number(parameter.upper), " | ",
                    Number(parameter.prior_scale),
                    parameter.decades > 0
                        ? absl::StrCat(" and ", Number(parameter.decades), " decades below")
                        : std::string(),
                    " |\n");
  }
  return text + "\n";
}

// Names of parameters end with their unit.
std::string UnitOf(std::string_view name) {
  constexpr std::pair<std::string_view, std::string_view> kUnits[] = {
      {"_w_m2_sr", "W/(m^2 sr)"},
      {"_electrons_per_s", "electrons/s"},
      {"_per_electron", "1/electron"},
      {"_per_tangent_m", "m"},
      {"_per_m", "1/m"},
      {"_m_s", "m/s"},
      {"_hz", "Hz"},
      {"_deg", "deg"},
      {"_px", "px"},
      {"_dn", "DN"},
      {"_electrons", "electrons"},
      {"_waves", "wavelengths"},
      {"_m", "m"},
      {"_s", "s"}};
  for (const auto& [suffix, unit] : kUnits) {
    if (name.ends_with(suffix)) return std::string(unit);
  }
  return "1";
}

nlohmann::ordered_json Entry(const EffectDescription& d) {
  nlohmann::ordered_json parameters = nlohmann::ordered_json::array();
  for (const EffectParameter& parameter : d.parameters) {
    parameters.push_back({{"name", parameter.name},
                          {"unit", UnitOf(parameter.name)},
                          {"without", parameter.null_value},
                          {"lower", parameter.lower},
                          {"upper", parameter.upper},
                          {"usual", parameter.prior_scale},
                          {"decades", parameter.decades}});
  }
  return {{"effect", d.id},
          {"stage", StageName(d.stage)},
          {"summary", d.summary},
          {"source", d.reference},
          {"parameters", parameters}};
}

int Write(const fs::path& docs) {
  std::error_code error;
  fs::create_directories(docs / "effects", error);
  std::string text = absl::StrCat(
      "# Effects\n\nWhat the renderer can switch on (`--effects`, `effects` of an inspection) and "
      "the "
      "diagnosis of plates can name: ",
      AllEffects().size(),
      " effects. This page is generated from their descriptions in\n"
      "[render_worker/effects](../render_worker/effects) by `tools/effect_catalogue`.\n\n"
      "Pictures: without the effect, with it (three prior scales of its first parameter, or of all "
      "where one does nothing), and the difference; square roots of the numbers. An effect that "
      "acts "
      "from recording to recording or in colour only shows no difference. Prior: half of all rigs "
      "with the effect are believed to deviate from the value without it by less. Angles are in "
      "degrees where the name ends in `_deg`, everything else in SI units with the unit in the "
      "name.\n");
  nlohmann::ordered_json entries = nlohmann::ordered_json::array();
  for (const Stage stage : {Stage::kIllumination, Stage::kSurface, Stage::kOptics, Stage::kGeometry,
                            Stage::kSensor, Stage::kTime}) {
    absl::StrAppend(&text, "\n## Stage: ", std::string(StageName(stage)), "\n\n");
    for (const Effect* effect : AllEffects()) {
      if (effect->description().stage != stage) continue;
      text += Section(*effect);
      entries.push_back(Entry(effect->description()));
      const std::string id(effect->description().id);
      const auto picture = Picture(*effect);
      const absl::Status status =
          picture.ok() ? WriteFileAtomically((docs / "effects" / (id + ".png")).string(), *picture)
                       : picture.status();
      if (status.ok()) continue;
      std::fprintf(stderr, "%s: %s\n", id.c_str(), std::string(status.message()).c_str());
      return 1;
    }
  }
  const nlohmann::ordered_json list = {{"effects", entries}};
  for (const auto& [name, contents] :
       {std::pair("effects.md", text), std::pair("effects.json", list.dump(1) + "\n")}) {
    if (!WriteFileAtomically((docs / name).string(), contents).ok()) return 1;
  }
  return 0;
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: effect_catalogue DOCS_FOLDER\n");
    return 2;
  }
  return sightline::Write(argv[1]);
}
