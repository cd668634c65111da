// SPDX-License-Identifier: Apache-2.0
// A concealed set and its truth, as make_concealed_sets wrote them.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "render_worker/effects/effect.h"
#include "render_worker/recordings/recorded_set.h"

namespace sightline::bench {

// Ends the program: these are command-line tools.
[[noreturn]] void Fail(const std::string& message);

nlohmann::ordered_json ReadJson(const std::filesystem::path& path);
// Description and images of a folder.
RecordedSet ReadSet(const std::filesystem::path& folder);
// {"effect": id, "parameters": {name: value}}, of the vocabulary, a variant law or a law
// outside it.
ActiveEffect TrueEffect(const nlohmann::ordered_json& json);
// `nuisance` of a truth; the shift of every position is not in it.
SetupDeviation TrueDeviation(const nlohmann::ordered_json& json);

}  // namespace sightline::bench
