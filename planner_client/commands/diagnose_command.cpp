#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "core/json/strict_json.h"
#include "core/recordings/recordings.h"
#include "planner_client/commands/commands.h"
#include "planner_client/commands/exit_code.h"
#include "planner_client/commands/worker_session.h"
#include "planner_client/diagnosis_client/answer_json.h"
#include "planner_client/diagnosis_client/calibrated_inspection.h"
#include "planner_client/diagnosis_client/diagnosis_client.h"
#include "planner_client/diagnosis_client/recorded_folder.h"
#include "planner_client/report/diagnosis_report.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr int kShownExplanations = 5;

struct DiagnoseOptions {
  std::string input, out, inspection;
  std::optional<int64_t> seed;
  std::vector<std::string> excluded;
  std::optional<int> max_effects;
  WorkerSessionOptions worker;
};

// Name of the answer's file; none if the set's name is no file name of its own.
std::string AnswerFile(const std::string& set) {
  const bool file_name =
      !set.empty() && set[0] != '.' && set.find_first_of("/\\") == std::string::npos;
  const bool taken = set == "diagnosis" || set == "diagnosis_full" || set == "recordings";
  return file_name && !taken ? set + ".json" : "";
}

// What `sightline render --effects` reads.
std::string EffectsJson(const v1::Diagnosis& diagnosis) {
  v1::PlateRender effects;
  *effects.mutable_effects() = diagnosis.calibrated_effects();
  return ToJson(effects) + "\n";
}

std::string Describe(const v1::Explanation& explanation) {
  if (explanation.effects().empty()) {
    return explanation.stage().empty() || explanation.stage() == explanation.effect()
               ? explanation.effect()
               : absl::StrCat(explanation.effect(), " (stage: ", explanation.stage(), ")");
  }
  std::vector<std::string> effects;
  for (const v1::FittedEffect& effect : explanation.effects()) {
    std::vector<std::string> parameters;
    for (const v1::FittedParameter& parameter : effect.parameters()) {
      parameters.push_back(absl::StrFormat("%s %.4g", parameter.name(), parameter.value()));
      if (parameter.has_standard_error()) {
        absl::StrAppendFormat(&parameters.back(), " +- %.2g", parameter.standard_error());
      }
    }
    effects.push_back(parameters.empty()
                          ? effect.effect()
                          : absl::StrCat(effect.effect(), "  ", absl::StrJoin(parameters, ", ")));
  }
  return absl::StrJoin(effects, " + ");
}

void Print(const v1::Diagnosis& diagnosis) {
  std::printf("%s: %s\n\nprobability  explanation\n", diagnosis.set().c_str(),
              diagnosis.finding().c_str());
  for (int i = 0; i < std::min(kShownExplanations, diagnosis.ranked_size()); ++i) {
    std::printf("%11.3f  %s\n", diagnosis.ranked(i).probability(),
                Describe(diagnosis.ranked(i)).c_str());
  }
  if (!diagnosis.same_class().empty()) {
    std::printf("\nThese recordings cannot tell it from: %s\n",
                absl::StrJoin(diagnosis.same_class(), ", ").c_str());
  }
  if (!diagnosis.next_recordings().empty()) std::printf("\nRecord next:\n");
  for (const v1::NextRecording& next : diagnosis.next_recordings()) {
    std::printf("  %s (%.2g bits%s%s)\n", next.description().c_str(), next.expected_gain_bits(),
                next.tells_apart().empty() ? "" : ", tells apart ",
                absl::StrJoin(next.tells_apart(), ", ").c_str());
  }
  std::printf("\n");
}

// Writes every file of the answer; returns their paths, the report first.
absl::StatusOr<std::vector<std::string>> WriteAnswer(const DiagnoseOptions& options,
                                                     const RecordedFolder& set,
                                                     const v1::Diagnosis& diagnosis,
                                                     std::vector<std::string>* warnings) {
  const fs::path out = options.out;
  const fs::path calibrated = out / "calibrated";
  std::error_code error;
  fs::create_directories(calibrated, error);
  if (error) {
    return absl::InvalidArgumentError(
        absl::StrCat("cannot make folder ", calibrated.string(), ": ", error.message()));
  }
  std::vector<std::pair<fs::path, std::string>> files;
  const std::string answer = AnswerJson(diagnosis);
  if (const std::string name = AnswerFile(diagnosis.set()); !name.empty()) {
    files.emplace_back(out / name, answer);
  }
  files.emplace_back(out / "diagnosis.json", answer);
  files.emplace_back(out / "diagnosis_full.json", ToJson(diagnosis) + "\n");
  if (diagnosis.has_calibrated()) {
    files.emplace_back(calibrated / "recordings.json",
                       RecordingsToJson(diagnosis.calibrated()) + "\n");
  }
  files.emplace_back(calibrated / "effects.json", EffectsJson(diagnosis));
  const fs::path inspection = calibrated / "inspection.json";
  // One of an earlier run would not be that of this diagnosis.
  fs::remove(inspection, error);
  if (!options.inspection.empty()) {
    auto result =
        CalibrateInspectionFile(options.inspection, set.recordings, diagnosis, calibrated.string());
    if (!result.ok()) return result.status();
    files.emplace_back(inspection, ToJson(result->inspection) + "\n");
    warnings->insert(warnings->end(), result->warnings.begin(), result->warnings.end());
    for (const std::string& change : result->changes) std::printf("%s\n", change.c_str());
  }
  std::vector<std::string> paths;
  for (const auto& [path, text] : files) {
    absl::Status status = WriteFileAtomically(path.string(), text);
    if (!status.ok()) return status;
    paths.push_back(path.string());
  }
  const std::string report = (out / "report.html").string();
  absl::Status status = WriteDiagnosisReport(diagnosis, set.folder, report);
  if (!status.ok()) return status;
  paths.insert(paths.begin(), report);
  return paths;
}

absl::StatusOr<int> Diagnose(DiagnoseOptions options) {
  const auto set = ReadRecordedFolder(options.input);
  if (!set.ok()) return set.status();
  if (options.out.empty()) options.out = (fs::path(set->folder) / "diagnosis").string();
  if (!options.inspection.empty()) {
    // Its mistakes show before the long work, not after it.
    const auto inspection = CalibrateInspectionFile(options.inspection, set->recordings, {}, ".");
    if (!inspection.ok()) return inspection.status();
  }
  std::error_code error;
  fs::create_directories(options.out, error);
  if (error) {
    return absl::InvalidArgumentError(
        absl::StrCat("cannot make folder ", options.out, ": ", error.message()));
  }
  v1::CreateDiagnosisRequest request;
  *request.mutable_source()->mutable_recordings() = set->recordings;
  if (options.seed) request.set_seed(*options.seed);
  if (options.max_effects) request.set_max_effects(*options.max_effects);
  for (const std::string& effect : options.excluded) request.add_excluded_effects(effect);

  ProgressLine progress;
  WorkerClientOptions client;
  auto worker = StartWorkerSession(options.worker, &progress, &client);
  if (!worker.ok()) return worker.status();
  const auto diagnosis = DiagnoseRecordings(client, std::move(request), set->images);
  progress.Finish();
  if (!diagnosis.ok()) return AboutInput(diagnosis.status(), set->description_file);

  Print(*diagnosis);
  std::vector<std::string> warnings(diagnosis->warnings().begin(), diagnosis->warnings().end());
  const auto files = WriteAnswer(options, *set, *diagnosis, &warnings);
  for (const std::string& warning : warnings) {
    std::fprintf(stderr, "warning: %s\n", warning.c_str());
  }
  if (!files.ok()) return files.status();
  for (const std::string& file : *files) std::printf("%s\n", fs::absolute(file).c_str());
  return kExitDone;
}

}  // namespace

Command AddDiagnoseCommand(CLI::App& app) {
  auto options = std::make_shared<DiagnoseOptions>();
  app.add_option("input", options->input, "folder of recordings of a plate, or its recordings.json")
      ->required();
  app.add_option("--out", options->out, "folder for the answer; default: diagnosis/ in the set");
  app.add_option("--inspection", options->inspection,
                 "also write this inspection.json with the fitted values");
  app.add_option("--exclude", options->excluded, "effect not to consider; may be repeated")
      ->allow_extra_args(false);
  app.add_option("--max-effects", options->max_effects, "at once; default 2")
      ->check(CLI::Range(1, 3));
  app.add_option("--seed", options->seed, "of everything drawn at random; default 1");
  AddWorkerOptions(app, &options->worker);
  return [options]() -> int {
    const absl::StatusOr<int> code = Diagnose(*options);
    return code.ok() ? *code : ReportError(code.status());
  };
}

}  // namespace sightline
