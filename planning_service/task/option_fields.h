// SPDX-License-Identifier: Apache-2.0
// One table of the fields of a task and the options of the command that carries it out. It serves
// to make command lines (planning_task.cpp) and to translate messages of commands for clients, who
// know the fields but not the options.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace sightline {

struct OptionField {
  std::string_view option;  // "--max-scans"
  std::string_view field;   // "plan_options.max_scans"
};

// Option fields of a kind of task ("plan", "render", ...); none for another kind.
std::span<const OptionField> OptionFields(std::string_view kind);

// The option for a field of that kind. The field must be in the table.
std::string OptionOf(std::string_view kind, std::string_view field);

// Replaces options in the `message` of a command by the names of fields, and removes remarks in
// brackets about other commands ("(--unit of `sightline part`)"). Other words that begin with
// hyphens stay.
std::string WithFieldNames(std::string_view kind, std::string_view message);

}  // namespace sightline
