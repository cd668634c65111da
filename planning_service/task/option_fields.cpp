// SPDX-License-Identifier: Apache-2.0
#include "planning_service/task/option_fields.h"

#include <algorithm>
#include <cassert>
#include <initializer_list>

#include "absl/strings/ascii.h"

namespace sightline {
namespace {

constexpr OptionField kPlan[] = {
    {"--strategy", "plan_options.strategy"},
    {"--goal", "plan_options.goal"},
    {"--max-scans", "plan_options.max_scans"},
    {"--max-time-s", "plan_options.max_time_s"},
    {"--evaluations-per-scan", "plan_options.evaluations_per_scan"},
    {"--bound-evaluations", "plan_options.bound_evaluations"},
    {"--starts", "plan_options.starts"},
    {"--no-pictures", "plan_options.no_pictures"},
    {"--no-point-clouds", "plan_options.no_point_clouds"},
};
// Lengths of fields are metres, those of options millimetres.
constexpr OptionField kInspect[] = {
    {"--measured", "inspect_options.measured"},
    {"--measured-unit", "inspect_options.measured_unit"},
    {"--pose", "inspect_options.pose_file"},
    {"--pose-prior-mm", "inspect_options.pose_prior_m"},
    {"--pose-prior-deg", "inspect_options.pose_prior_deg"},
    {"--tolerated-distance-mm", "inspect_options.tolerated_distance_m"},
    {"--no-next-scan", "inspect_options.no_next_scan"},
    {"--evaluations-per-scan", "inspect_options.evaluations_per_scan"},
};
constexpr OptionField kAccept[] = {
    {"--no-images", "accept_options.no_images"},
};
constexpr OptionField kOptics[] = {
    {"--scan", "optics_options.scan"},
    {"--frame", "optics_options.frame"},
    {"--stage-position", "optics_options.stage_position_m"},
};
constexpr OptionField kRender[] = {
    {"--scan", "render_options.frames.scan"},
    {"--frame", "render_options.frames.frame"},
    {"--stage-position", "render_options.frames.stage_position_m"},
    {"--exposure", "render_options.exposure_time_s"},
    {"--f-number", "render_options.f_number"},
    {"--layers", "render_options.layers"},
    {"--demosaic", "render_options.demosaic"},
    {"--no-speckle", "render_options.no_speckle"},
    {"--format", "render_options.tiff"},
};
constexpr OptionField kDiagnose[] = {
    {"--inspection", "inspection"},
    {"--part", "diagnose_options.part_file"},
    {"--part-unit", "diagnose_options.part_unit"},
    {"--exclude", "diagnose_options.excluded_effects"},
    {"--max-effects", "diagnose_options.max_effects"},
};
// Options that all kinds of tasks have, and options that messages about files name.
constexpr OptionField kCommon[] = {
    {"--seed", "seed"},
    {"--plan", "plan"},
    {"--other-part", "other_part"},
    {"--unit", "inspection.part.unit"},
    {"--construction-geometry", "inspection.part.construction_geometry"},
    {"--tolerances", "inspection.tolerances.file"},
    {"--tolerances-unit", "inspection.tolerances.unit"},
};

const OptionField* FindOption(std::span<const OptionField> table, std::string_view option) {
  const auto found = std::ranges::find(table, option, &OptionField::option);
  return found == table.end() ? nullptr : &*found;
}

bool IsOptionCharacter(char c) {
  return absl::ascii_islower(static_cast<unsigned char>(c)) || c == '-' ||
         absl::ascii_isdigit(static_cast<unsigned char>(c));
}

// Removes remarks in brackets about the options of other commands: " (--unit of `sightline
// part`)".
std::string WithoutOtherCommands(std::string_view message) {
  std::string text;
  while (true) {
    const size_t command = message.find("`sightline ");
    const size_t open = message.substr(0, command).rfind(" (");
    const size_t close = command == message.npos ? message.npos : message.find(')', command);
    if (close == message.npos) break;
    const bool in_brackets =
        open != message.npos && message.substr(open, command - open).find(')') == message.npos;
    text += message.substr(0, in_brackets ? open : close + 1);
    message.remove_prefix(close + 1);
  }
  return text += message;
}

}  // namespace

std::span<const OptionField> OptionFields(std::string_view kind) {
  if (kind == "plan") return kPlan;
  if (kind == "inspect") return kInspect;
  if (kind == "accept") return kAccept;
  if (kind == "optics") return kOptics;
  if (kind == "render") return kRender;
  if (kind == "diagnose") return kDiagnose;
  return {};
}

std::string OptionOf(std::string_view kind, std::string_view field) {
  for (const std::span<const OptionField> table :
       std::initializer_list<std::span<const OptionField>>{OptionFields(kind), kCommon}) {
    const auto found = std::ranges::find(table, field, &OptionField::field);
    if (found != table.end()) return std::string(found->option);
  }
  assert(false);
  return "";
}

std::string WithFieldNames(std::string_view kind, std::string_view given) {
  const std::string message = WithoutOtherCommands(given);
  std::string text;
  for (size_t at = 0; at < message.size();) {
    const bool begins_word =
        at == 0 || (!IsOptionCharacter(message[at - 1]) && !absl::ascii_isalnum(message[at - 1]) &&
                    message[at - 1] != '/' && message[at - 1] != '_');
    if (!begins_word || message.compare(at, 2, "--") != 0) {
      text += message[at++];
      continue;
    }
    size_t end = at + 2;
    while (end < message.size() && IsOptionCharacter(message[end])) ++end;
    const std::string_view option = std::string_view(message).substr(at, end - at);
    const OptionField* known = FindOption(OptionFields(kind), option);
    if (known == nullptr) known = FindOption(kCommon, option);
    text += known == nullptr ? option : known->field;
    at = end;
  }
  return text;
}

}  // namespace sightline
