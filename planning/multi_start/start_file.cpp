// SPDX-License-Identifier: Apache-2.0
#include "planning/multi_start/start_file.h"

#include <array>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

#include "core/digest/sha256.h"
#include "core/file/atomic_write.h"

namespace sightline {
namespace {

using nlohmann::json;

// Far more than the largest plan needs (1000 scans of nine numbers).
constexpr uintmax_t kMostBytes = 4 << 20;

// SHA-256 of the file without this field; it detects edited results.
constexpr char kCheckField[] = "check";

std::string CheckOf(const json& file) { return Sha256Hex(file.dump()); }

// Names of stop reasons in the files, since their numbers may change.
constexpr std::pair<StopReason, const char*> kStopReasons[] = {
    {StopReason::kGoalReached, "goal reached"}, {StopReason::kMaxScans, "max scans"},
    {StopReason::kMaxTime, "max time"},         {StopReason::kStalled, "stalled"},
    {StopReason::kInterrupted, "interrupted"},  {StopReason::kExecutionLimit, "execution limit"},
};

std::optional<StopReason> StopReasonOf(const std::string& text) {
  for (const auto& [value, name] : kStopReasons) {
    if (text == name) return value;
  }
  return std::nullopt;
}

// Throws json::exception where a field is missing or of another type.
std::optional<StartResult> FromJson(const json& file) {
  const auto reason = StopReasonOf(file.at("stop_reason").get<std::string>());
  if (!reason) return std::nullopt;
  StartResult start;
  start.stop_reason = *reason;
  start.seed = file.at("seed").get<int64_t>();
  start.evaluations = file.at("evaluations").get<int64_t>();
  start.satisfied = file.at("settled").get<double>();
  start.cost = file.at("cost").get<double>();
  for (const json& scan : file.at("scans")) {
    start.scans.push_back(
        {FromArray(scan.at("parameters").get<std::array<double, kMeasurementParameters>>()),
         scan.at("locked").get<bool>()});
  }
  if (file.contains("bound")) {
    const json& bound = file.at("bound");
    start.bound.emplace();
    start.bound->bound = bound.at("bound").get<double>();
    start.bound->scans = bound.at("scans").get<int>();
    start.bound->converged = bound.at("converged").get<bool>();
    start.bound->evaluations = bound.at("evaluations").get<int64_t>();
    start.bound->statement = bound.at("statement").get<std::string>();
  }
  return start;
}

}  // namespace

absl::Status WriteStart(const StartResult& start, const std::string& fingerprint,
                        const std::string& path) {
  json scans = json::array();
  for (const StartResult::Scan& scan : start.scans) {
    // Radians and metres as in memory: degrees would not read back as exactly the same numbers.
    scans.push_back({{"parameters", ToArray(scan.measurement)}, {"locked", scan.locked}});
  }
  json file = {
      {"fingerprint", fingerprint}, {"seed", start.seed}, {"evaluations", start.evaluations},
      {"settled", start.satisfied}, {"cost", start.cost}, {"scans", scans}};
  for (const auto& [value, name] : kStopReasons) {
    if (start.stop_reason == value) file["stop_reason"] = name;
  }
  if (start.bound) {
    file["bound"] = {{"bound", start.bound->bound},
                     {"scans", start.bound->scans},
                     {"converged", start.bound->converged},
                     {"evaluations", start.bound->evaluations},
                     {"statement", start.bound->statement}};
  }
  file[kCheckField] = CheckOf(file);
  return WriteFileAtomically(path, file.dump() + "\n");
}

std::optional<StartResult> ReadStart(const std::string& path, const std::string& fingerprint,
                                     int64_t seed, std::string* why) {
  std::error_code error;
  const uintmax_t bytes = std::filesystem::file_size(path, error);
  if (error) return std::nullopt;
  const auto refuse = [&](const char* reason) {
    if (why != nullptr) *why = reason;
    return std::nullopt;
  };
  constexpr char kDamaged[] = "is damaged, or of another version";
  if (bytes > kMostBytes) return refuse(kDamaged);
  std::ifstream stream(path, std::ios::binary);
  try {
    json file = json::parse(stream);
    const auto check = file.at(kCheckField).get<std::string>();
    file.erase(kCheckField);
    if (check != CheckOf(file)) return refuse(kDamaged);
    std::optional<StartResult> start = FromJson(file);
    if (!start) return refuse(kDamaged);
    if (file.at("fingerprint").get<std::string>() != fingerprint || start->seed != seed) {
      return refuse("is the result of another search (a file, an option or the program changed)");
    }
    return start;
  } catch (const json::exception&) {
    return refuse(kDamaged);
  }
}

}  // namespace sightline
