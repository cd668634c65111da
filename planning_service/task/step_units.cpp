// SPDX-License-Identifier: Apache-2.0
#include "planning_service/task/step_units.h"

#include <map>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "core/part/load_part.h"
#include "core/text/step_length_unit.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

// Some two seconds of one core.
constexpr size_t kMostScannedBytes = size_t{64} << 20;

struct UnitOfFile {
  std::string field;  // that states the unit
  std::string file, unit;
};

std::vector<UnitOfFile> UnitsOfTask(const v1::PlanningTask& task) {
  const v1::Inspection& inspection = task.inspection();
  std::vector<UnitOfFile> units = {
      {"inspection.part.unit", inspection.part().file(), inspection.part().unit()}};
  for (int i = 0; i < inspection.obstacles_size(); ++i) {
    units.push_back({absl::StrCat("inspection.obstacles[", i, "].unit"),
                     inspection.obstacles(i).file(), inspection.obstacles(i).unit()});
  }
  // The part's own file has the part's unit.
  if (inspection.tolerances().file() != inspection.part().file()) {
    units.push_back({"inspection.tolerances.unit", inspection.tolerances().file(),
                     inspection.tolerances().unit()});
  }
  units.push_back({"diagnose_options.part_unit", task.diagnose_options().part_file(),
                   task.diagnose_options().part_unit()});
  return units;
}

absl::StatusOr<bool> StatesNoUnit(const std::string& file, const TaskFilePieces& read) {
  StepLengthUnitScan scan;
  size_t bytes = 0;
  absl::Status status = read(file, [&](std::string_view piece) {
    scan.Add(piece);
    bytes += piece.size();
    return !scan.found() && bytes <= kMostScannedBytes;
  });
  if (!status.ok()) return status;
  return scan.StatesNone() && bytes <= kMostScannedBytes;
}

}  // namespace

absl::Status CheckStepUnits(const v1::PlanningTask& task, const TaskFilePieces& read) {
  std::map<std::string, bool> states_none;  // of the files that were read
  for (const UnitOfFile& given : UnitsOfTask(task)) {
    if (given.file.empty() || !given.unit.empty() || !IsStepFileName(given.file)) continue;
    auto known = states_none.find(given.file);
    if (known == states_none.end()) {
      const absl::StatusOr<bool> none = StatesNoUnit(given.file, read);
      if (!none.ok()) return none.status();
      known = states_none.emplace(given.file, *none).first;
    }
    if (!known->second) continue;
    return WithErrorInfo(
        InvalidFields({{given.field, absl::StrCat("is missing: ", given.file,
                                                  " states no length unit, must be m, cm, mm, um "
                                                  "or inch")}}),
        "INVALID_FIELD");
  }
  return absl::OkStatus();
}

}  // namespace sightline
