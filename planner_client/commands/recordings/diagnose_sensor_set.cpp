// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/recordings/diagnose_sensor_set.h"

#include <cstdio>
#include <filesystem>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "core/file/atomic_write.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"
#include "planner_client/command_line/process/exit_code.h"
#include "planner_client/command_line/process/output_folder.h"
#include "planner_client/command_line/process/print.h"
#include "planner_client/diagnosis_client/sensor_set_client.h"
#include "planner_client/diagnosis_client/sensor_set_folder.h"
#include "report/sensor/sensor_report.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

void PrintQuantities(const v1::SensorDiagnosis& diagnosis) {
  if (diagnosis.quantities().empty()) return;
  PrintText("\n%-34s %12s  %-27s %12s  %s\n", "quantity", "value", "95 % interval", "EMVA 1288",
            "unit");
  const auto number = [](bool given, double value) {
    return given ? absl::StrFormat("%.5g", value) : "-";
  };
  for (const v1::SensorQuantity& q : diagnosis.quantities()) {
    const std::string interval = q.has_lower() && q.has_upper()
                                     ? absl::StrFormat("%.5g to %.5g", q.lower(), q.upper())
                                     : "-";
    PrintText("%-34s %12s  %-27s %12s  %s\n", q.name().c_str(),
              number(q.has_value(), q.value()).c_str(), interval.c_str(),
              number(q.has_emva_value(), q.emva_value()).c_str(), q.unit().c_str());
    // A quantity without a value says why.
    if (!q.has_value() && !q.note().empty()) PrintText("    %s\n", q.note().c_str());
  }
}

void PrintDepartures(const v1::SensorDiagnosis& diagnosis) {
  bool any = false;
  std::vector<std::string> absent, not_testable;
  for (const v1::SensorDeparture& departure : diagnosis.departures()) {
    if (!departure.found()) {
      (departure.testable() ? absent : not_testable).push_back(departure.effect());
      continue;
    }
    if (!any) PrintText("\nThe linear model leaves out:\n");
    any = true;
    PrintText("  %s (%s, p = %.2g): %s\n", departure.effect().c_str(), departure.stage().c_str(),
              departure.p_value(), departure.description().c_str());
  }
  if (!absent.empty()) {
    PrintText("\nLooked for and not found: %s\n", absl::StrJoin(absent, ", ").c_str());
  }
  if (!not_testable.empty()) {
    PrintText("\nNot testable with these images: %s\n", absl::StrJoin(not_testable, ", ").c_str());
  }
}

}  // namespace

absl::StatusOr<int> RunSensorSetDiagnosis(SensorSetOptions options) {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto set, ReadSensorSetFolder(options.input));
  if (options.out.empty()) options.out = (fs::path(set.folder) / "diagnosis").string();
  SIGHTLINE_ASSIGN_OR_RETURN(const auto out_lock, OpenOutputFolder(options.out));
  v1::CreateSensorDiagnosisRequest request;
  *request.mutable_set() = set.set;

  ProgressLine progress;
  WorkerClientOptions client;
  SIGHTLINE_ASSIGN_OR_RETURN(auto worker, StartWorkerSession(options.worker, &progress, &client));
  const auto diagnosis = DiagnoseSensorSet(client, std::move(request), set.images);
  progress.Finish();
  if (!diagnosis.ok()) return AboutInput(diagnosis.status(), set.description_file);

  PrintText("%s: %s\n", diagnosis->set().c_str(), diagnosis->finding().c_str());
  PrintQuantities(*diagnosis);
  PrintDepartures(*diagnosis);
  PrintText("\n");
  for (const std::string& warning : diagnosis->warnings()) {
    PrintTextTo(stderr, "warning: %s\n", warning.c_str());
  }
  const fs::path out = options.out;
  SIGHTLINE_RETURN_IF_ERROR(
      WriteFileAtomically((out / "diagnosis.json").string(), ToJson(*diagnosis) + "\n"));
  SIGHTLINE_RETURN_IF_ERROR(
      WriteFileAtomically((out / "camera.json").string(), ToJson(diagnosis->camera()) + "\n"));
  SIGHTLINE_RETURN_IF_ERROR(WriteSensorReport(*diagnosis, (out / "report.html").string()));
  for (const char* file : {"report.html", "report.json", "diagnosis.json", "camera.json"}) {
    PrintText("%s\n", fs::absolute(out / file).c_str());
  }
  return kExitDone;
}

}  // namespace sightline
