// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/command_options/option_values.h"
#include "core/json/strict_json.h"
#include "core/spelling/nearest_name.h"
#include "core/text/number_text.h"
#include "planner_client/command_line/help/terminal.h"
#include "planner_client/command_line/process/exit_code.h"
#include "planner_client/command_line/process/print.h"
#include "planner_client/commands/commands.h"
#include "planner_client/effect_list/effect_list.h"

namespace sightline {
namespace {

constexpr size_t kColumns = 80;

std::string WithUnit(const std::string& numbers, const std::string& unit) {
  return unit == "1" ? numbers : absl::StrCat(numbers, " ", unit);
}

std::string Range(const ListedParameter& p) {
  return WithUnit(absl::StrFormat("%.4g to %.4g", p.lower, p.upper), p.unit);
}

void PrintList(const std::vector<const ListedEffect*>& effects) {
  std::string stage;
  for (const ListedEffect* effect : effects) {
    if (effect->stage != stage) {
      PrintText("%sStage: %s\n", stage.empty() ? "" : "\n", effect->stage.c_str());
      stage = effect->stage;
    }
    PrintText("\n%s\n", effect->effect.c_str());
    PrintText("%s\n", WrapText("  " + effect->summary, kColumns, "  ").c_str());
    for (const ListedParameter& p : effect->parameters) {
      PrintText("    %-28s %s\n", p.name.c_str(), Range(p).c_str());
    }
  }
}

// A file for --effects that shows the effect clearly: twice its usual deviation.
std::string Example(const ListedEffect& effect) {
  std::string parameters;
  if (!effect.parameters.empty()) {
    const ListedParameter& p = effect.parameters.front();
    const double up = std::min(p.without + 2 * p.usual, p.upper);
    const double value = up > p.without ? up : std::max(p.without - 2 * p.usual, p.lower);
    // As a person would write it.
    double shown = 0;
    std::sscanf(absl::StrFormat("%.3g", value).c_str(), "%lf", &shown);
    parameters = absl::StrCat(", \"parameters\": {\"", p.name, "\": ", NumberText(shown), "}");
  }
  return absl::StrCat("{\"effects\": [{\"effect\": \"", effect.effect, "\"", parameters, "}]}");
}

void PrintOne(const ListedEffect& effect) {
  PrintText("%s (stage: %s)\n%s\n%s\n\n", effect.effect.c_str(), effect.stage.c_str(),
            WrapText(effect.summary, kColumns).c_str(),
            WrapText("Source: " + effect.source, kColumns, "  ").c_str());
  for (const ListedParameter& p : effect.parameters) {
    PrintText(
        "%s\n  allowed          %s\n  without effect   %s\n  usual deviation  %s%s\n",
        p.name.c_str(), Range(p).c_str(),
        WithUnit(absl::StrFormat("%.4g", p.without), p.unit).c_str(),
        WithUnit(absl::StrFormat("%.4g", p.usual), p.unit).c_str(),
        p.decades > 0 ? absl::StrFormat(", or up to %.3g decades less", p.decades).c_str() : "");
  }
  PrintText("\nfor `sightline render ... --effects FILE`, or `effects` of an inspection:\n%s\n",
            Example(effect).c_str());
}

int Print(const std::string& name) {
  std::vector<const ListedEffect*> found;
  std::vector<std::string> names;
  for (const ListedEffect& effect : ListedEffects()) {
    names.push_back(effect.effect);
    if (effect.effect == name) {
      PrintOne(effect);
      return kExitDone;
    }
    if (absl::StrContains(absl::AsciiStrToLower(effect.effect), absl::AsciiStrToLower(name)))
      found.push_back(&effect);
  }
  if (found.empty()) {
    const std::string nearest = NearestName(name, names);
    return ReportError(absl::InvalidArgumentError(
        absl::StrCat("\"", name, "\" is no effect; the nearest is \"", nearest,
                     "\"; `sightline effects` lists all ", names.size())));
  }
  PrintList(found);
  if (name.empty()) {
    PrintText(
        "\n%zu effects; `sightline effects NAME` tells more of one, or lists those whose "
        "name\ncontains NAME\n",
        found.size());
  }
  return kExitDone;
}

}  // namespace

Command AddEffectsCommand(CLI::App& app) {
  struct Options {
    std::string name;
    bool json = false;
  };
  auto options = std::make_shared<Options>();
  app.add_option("name", options->name,
                 "name of an effect, or a part of names, e.g. optics; default: all");
  app.add_flag("--json", options->json, "the whole vocabulary as JSON");
  return [&app, options] {
    if (!options->json) return Print(options->name);
    if (absl::Status s = CheckExcluded(app, "--json", {"name"}); !s.ok()) return ReportError(s);
    const std::string_view json = EffectListJson();
    std::fwrite(json.data(), 1, json.size(), stdout);
    return kExitDone;
  };
}

}  // namespace sightline
