// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <chrono>
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
#include "core/command_options/option_values.h"
#include "core/file/atomic_write.h"
#include "core/inspection/inspection.h"
#include "core/json/strict_json.h"
#include "core/part/load_part.h"
#include "core/recordings/part_inspection.h"
#include "core/recordings/recordings.h"
#include "core/status/status_macros.h"
#include "planner_client/command_line/process/exit_code.h"
#include "planner_client/command_line/process/output_folder.h"
#include "planner_client/command_line/process/print.h"
#include "planner_client/commands/commands.h"
#include "planner_client/commands/part_assets.h"
#include "planner_client/commands/recordings/diagnose_sensor_set.h"
#include "planner_client/commands/recordings/time_left.h"
#include "planner_client/commands/worker_session.h"
#include "planner_client/diagnosis_client/answer_json.h"
#include "planner_client/diagnosis_client/calibrated_inspection.h"
#include "planner_client/diagnosis_client/calibrated_part.h"
#include "planner_client/diagnosis_client/diagnosis_client.h"
#include "planner_client/diagnosis_client/plate_inspection.h"
#include "planner_client/diagnosis_client/quick_set.h"
#include "planner_client/diagnosis_client/recorded_folder.h"
#include "planner_client/diagnosis_client/sensor_set_folder.h"
#include "report/diagnosis/diagnosis_report.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr int kShownExplanations = 5;

struct DiagnoseOptions {
  std::string input, out, inspection, part, part_unit;
  std::optional<int64_t> seed;
  std::vector<std::string> excluded;
  std::optional<int> max_effects;
  bool quick = false;
  WorkerSessionOptions worker;
};

// Name of the answer's file; none if the set's name is no file name of its own.
std::string AnswerFile(const std::string& set) {
  const bool file_name =
      !set.empty() && set[0] != '.' && set.find_first_of("/\\") == std::string::npos;
  const bool taken = set == "diagnosis" || set == "diagnosis_full" || set == "recordings";
  return file_name && !taken ? set + ".json" : "";
}

// The file of effects that `sightline render --effects` reads.
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
  PrintText("%s: %s\n\nprobability  explanation\n", diagnosis.set().c_str(),
            diagnosis.finding().c_str());
  for (int i = 0; i < std::min(kShownExplanations, diagnosis.ranked_size()); ++i) {
    PrintText("%11.3f  %s\n", diagnosis.ranked(i).probability(),
              Describe(diagnosis.ranked(i)).c_str());
  }
  if (!diagnosis.same_class().empty()) {
    PrintText("\nThese recordings cannot tell it from: %s\n",
              absl::StrJoin(diagnosis.same_class(), ", ").c_str());
  }
  if (!diagnosis.next_recordings().empty()) PrintText("\nRecord next:\n");
  for (const v1::NextRecording& next : diagnosis.next_recordings()) {
    PrintText("  %s (%.2g bits%s%s)\n", next.description().c_str(), next.expected_gain_bits(),
              next.tells_apart().empty() ? "" : ", tells apart ",
              absl::StrJoin(next.tells_apart(), ", ").c_str());
  }
  PrintText("\n");
}

bool IsInterrupted(const v1::Diagnosis& diagnosis) { return diagnosis.verdict() == "interrupted"; }

bool ShowsPart(const RecordedFolder& set) { return set.recordings.format_version() == 2; }

// The null model of recordings of a part: --inspection, or their own description; self-contained
// but for files, which are found from here.
absl::StatusOr<v1::Inspection> NominalPart(const DiagnoseOptions& options,
                                           const RecordedFolder& set) {
  v1::Inspection message;
  std::string context = options.inspection;
  if (!options.inspection.empty()) {
    SIGHTLINE_RETURN_IF_ERROR(ReadStrictJsonFile(options.inspection, &message));
  } else {
    context = set.description_file;
    SIGHTLINE_ASSIGN_OR_RETURN(message, InspectionOfRecordings(set.recordings, context));
  }
  const std::string folder = fs::absolute(context).lexically_normal().parent_path().string();
  SIGHTLINE_ASSIGN_OR_RETURN(auto inspection, InlineInspectionFiles(message, context, folder));
  v1::PartSource* part = inspection.mutable_part();
  if (!options.part.empty()) part->set_file(options.part);
  if (!options.part_unit.empty()) part->set_unit(options.part_unit);
  if (absl::Status unit = CheckPartUnit(part->file(), part->unit()); !unit.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat(context, ": part.unit ", unit.message(), "; give it with --part-unit"));
  }
  SIGHTLINE_RETURN_IF_ERROR(ParseInspection(inspection, context, "").status());
  if (!fs::is_regular_file(part->file())) {
    return absl::NotFoundError(absl::StrCat(options.part.empty() ? context + ": part.file: " : "",
                                            part->file(),
                                            ": cannot be read; give the part's file with --part"));
  }
  return inspection;
}

// The inspection with the fitted values, or none if it cannot be said; its plate's mesh goes into
// `files`.
absl::StatusOr<CalibratedInspection> Calibrated(
    const DiagnoseOptions& options, const RecordedFolder& set, const v1::Inspection& nominal_part,
    const v1::Diagnosis& diagnosis, const fs::path& folder,
    std::vector<std::pair<fs::path, std::string>>* files) {
  if (ShowsPart(set)) {
    CalibratedInspection result = CalibratePartInspection(nominal_part, diagnosis);
    SIGHTLINE_RETURN_IF_ERROR(
        ParseInspection(result.inspection, "calibrated inspection", "").status());
    NameFilesFrom(folder.string(), &result.inspection);
    return result;
  }
  if (!options.inspection.empty()) {
    return CalibrateInspectionFile(options.inspection, set.recordings, diagnosis, folder.string());
  }
  if (set.recordings.format_version() == 3) {
    return absl::FailedPreconditionError(
        "recordings of plates in poses have no rig; sightline calibrate makes an inspection of the "
        "frames");
  }
  constexpr char kPlateFile[] = "plate.obj";
  CalibratedInspection result =
      CalibrateInspection(InspectionOfPlate(set.recordings, kPlateFile), set.recordings, diagnosis);
  SIGHTLINE_RETURN_IF_ERROR(
      ParseInspection(result.inspection, "calibrated inspection", "").status());
  files->emplace_back(folder / kPlateFile, kPlateObj);
  return result;
}

// The files and the report; returns their paths, the report first.
absl::StatusOr<std::vector<std::string>> WriteFiles(
    const std::vector<std::pair<fs::path, std::string>>& files, const v1::Diagnosis& diagnosis,
    const std::string& set_folder, const fs::path& out) {
  std::vector<std::string> paths = {(out / "report.html").string(), (out / "report.json").string()};
  for (const auto& [path, text] : files) {
    SIGHTLINE_RETURN_IF_ERROR(WriteFileAtomically(path.string(), text));
    paths.push_back(path.string());
  }
  SIGHTLINE_RETURN_IF_ERROR(WriteDiagnosisReport(diagnosis, set_folder, paths.front()));
  return paths;
}

// A smaller set of tests: fewer recordings, one effect at a time. Returns a sentence on omissions.
std::string MakeQuick(RecordedFolder* set, v1::CreateDiagnosisRequest* request) {
  const std::vector<int> chosen = QuickChoice(set->recordings);
  const int all = set->recordings.recordings_size();
  v1::Recordings some = set->recordings;
  some.clear_recordings();
  std::vector<AssetFile> images;
  for (const int i : chosen) {
    *some.add_recordings() = set->recordings.recordings(i);
    images.push_back(std::move(set->images[static_cast<size_t>(i)]));
  }
  set->recordings = std::move(some);
  set->images = std::move(images);
  if (!request->has_max_effects()) request->set_max_effects(1);
  return absl::StrFormat(
      "--quick: from %d of %d recordings, with at most %d effect%s at once. Weak effects, and "
      "several together, may be missed; without it all recordings count.",
      chosen.size(), all, request->max_effects(), request->max_effects() == 1 ? "" : "s");
}

// Writes every file of the answer; returns their paths, the report first. `nominal_part`: of
// recordings of a part.
absl::StatusOr<std::vector<std::string>> WriteAnswer(const DiagnoseOptions& options,
                                                     const RecordedFolder& set,
                                                     const v1::Inspection& nominal_part,
                                                     const v1::Diagnosis& diagnosis,
                                                     std::vector<std::string>* warnings) {
  const fs::path out = options.out;
  const fs::path calibrated = out / "calibrated";
  SIGHTLINE_RETURN_IF_ERROR(MakeOutputFolder(calibrated.string()));
  std::vector<std::pair<fs::path, std::string>> files;
  const std::string answer = AnswerJson(diagnosis);
  if (const std::string name = AnswerFile(diagnosis.set()); !name.empty()) {
    files.emplace_back(out / name, answer);
  }
  files.emplace_back(out / "diagnosis.json", answer);
  files.emplace_back(out / "diagnosis_full.json", ToJson(diagnosis) + "\n");
  const fs::path inspection = calibrated / "inspection.json";
  // Files of an earlier run would not belong to this diagnosis.
  std::error_code error;
  for (const char* file : {"inspection.json", "recordings.json", "effects.json", "plate.obj"}) {
    fs::remove(calibrated / file, error);
  }
  if (IsInterrupted(diagnosis)) {
    warnings->push_back(
        "nothing is written into calibrated/: the values may still change; run the command again "
        "for a finding");
    fs::remove(calibrated, error);  // empty
    return WriteFiles(files, diagnosis, set.folder, out);
  }
  // The renderer takes these of a plate; of a part it takes the inspection.
  if (!ShowsPart(set)) {
    if (diagnosis.has_calibrated()) {
      v1::Recordings fitted = diagnosis.calibrated();
      // The answer has segments of the lines; the description is that of whole images.
      if (fitted.format_version() == 3) *fitted.mutable_recordings() = set.recordings.recordings();
      files.emplace_back(calibrated / "recordings.json", RecordingsToJson(fitted) + "\n");
    }
    files.emplace_back(calibrated / "effects.json", EffectsJson(diagnosis));
  }
  auto result = Calibrated(options, set, nominal_part, diagnosis, calibrated, &files);
  if (result.ok()) {
    files.emplace_back(inspection, ToJson(result->inspection) + "\n");
    warnings->insert(warnings->end(), result->warnings.begin(), result->warnings.end());
    for (const std::string& change : result->changes) PrintText("%s\n", change.c_str());
  } else {
    // The finding is useful even without it.
    warnings->push_back(
        absl::StrCat("calibrated/inspection.json is not written: ", result.status().message()));
  }
  return WriteFiles(files, diagnosis, set.folder, out);
}

// Flat-field and dark frames have neither plate nor part.
absl::StatusOr<int> DiagnoseCamera(const DiagnoseOptions& options) {
  for (const auto& [given, name] :
       {std::pair(!options.inspection.empty(), "--inspection"),
        std::pair(!options.part.empty(), "--part"),
        std::pair(!options.part_unit.empty(), "--part-unit"),
        std::pair(!options.excluded.empty(), "--exclude"), std::pair(options.quick, "--quick"),
        std::pair(options.max_effects.has_value(), "--max-effects")}) {
    if (!given) continue;
    return absl::InvalidArgumentError(
        absl::StrCat(name, " is for recordings of a plate or a part; ", options.input,
                     " has flat-field and dark frames of a camera (EMVA 1288)"));
  }
  return RunSensorSetDiagnosis({options.input, options.out, options.worker});
}

absl::StatusOr<int> Diagnose(DiagnoseOptions options) {
  if (IsSensorSet(options.input)) return DiagnoseCamera(options);
  SIGHTLINE_ASSIGN_OR_RETURN(
      auto set, ReadRecordedFolder(options.input, Shown::kPlateOrPart, MissingValues::kAssume));
  if (options.out.empty()) options.out = (fs::path(set.folder) / "diagnosis").string();
  // Reports mistakes before the long computation.
  v1::Inspection nominal_part;
  std::vector<AssetFile> assets;
  v1::CreateDiagnosisRequest request;
  if (ShowsPart(set)) {
    SIGHTLINE_ASSIGN_OR_RETURN(nominal_part, NominalPart(options, set));
    *request.mutable_inspection() = nominal_part;
    SIGHTLINE_RETURN_IF_ERROR(
        TakeAssets(set.description_file, request.mutable_inspection(), &assets));
  } else {
    for (const auto& [given, name] : {std::pair(!options.part.empty(), "--part"),
                                      std::pair(!options.part_unit.empty(), "--part-unit")}) {
      if (!given) continue;
      return absl::InvalidArgumentError(absl::StrCat(name, " is for recordings of a part; ",
                                                     set.description_file, " has format_version ",
                                                     set.recordings.format_version(), ": a plate"));
    }
    if (!options.inspection.empty() && set.recordings.format_version() == 3) {
      return absl::InvalidArgumentError(absl::StrCat("--inspection is for recordings with a rig; ",
                                                     set.description_file,
                                                     " has format_version 3: plates in poses"));
    }
    if (!options.inspection.empty()) {
      SIGHTLINE_RETURN_IF_ERROR(
          CalibrateInspectionFile(options.inspection, set.recordings, {}, ".").status());
    }
  }
  SIGHTLINE_ASSIGN_OR_RETURN(const auto out_lock, OpenOutputFolder(options.out));
  if (options.max_effects) request.set_max_effects(*options.max_effects);
  if (options.quick) set.assumptions.push_back(MakeQuick(&set, &request));
  *request.mutable_source()->mutable_recordings() = set.recordings;
  if (options.seed) request.set_seed(*options.seed);
  for (const std::string& effect : options.excluded) request.add_excluded_effects(effect);

  ProgressLine progress;
  WorkerClientOptions client;
  SIGHTLINE_ASSIGN_OR_RETURN(auto worker, StartWorkerSession(options.worker, &progress, &client));
  client.on_progress = [&progress, start = std::chrono::steady_clock::now()](
                           double fraction, const std::string& message) {
    progress.Show(fraction,
                  message + TimeLeftText(std::chrono::steady_clock::now() - start, fraction));
  };
  const auto on_waiting_for_rest = [&progress] {
    progress.Finish();
    PrintTextTo(stderr,
                "interrupted: what is known is written once the fit at hand has ended; Ctrl-C "
                "again ends at once\n");
  };
  auto diagnosis =
      DiagnoseRecordings(client, std::move(request), set.images, assets, on_waiting_for_rest);
  progress.Finish();
  if (!diagnosis.ok()) return AboutInput(diagnosis.status(), set.description_file);

  for (const std::string& assumption : set.assumptions) diagnosis->add_warnings(assumption);
  Print(*diagnosis);
  std::vector<std::string> warnings(diagnosis->warnings().begin(), diagnosis->warnings().end());
  const auto files = WriteAnswer(options, set, nominal_part, *diagnosis, &warnings);
  for (const std::string& warning : warnings) {
    PrintTextTo(stderr, "warning: %s\n", warning.c_str());
  }
  if (!files.ok()) return files.status();
  for (const std::string& file : *files) PrintText("%s\n", fs::absolute(file).c_str());
  return IsInterrupted(*diagnosis) ? kExitInterrupted : kExitDone;
}

}  // namespace

Command AddDiagnoseCommand(CLI::App& app) {
  auto options = std::make_shared<DiagnoseOptions>();
  app.add_option("input", options->input,
                 "folder of recordings of a plate or a part, or its recordings.json; or folder of "
                 "flat-field and dark frames of a camera, or its EMVA1288_Data.txt")
      ->required();
  app.add_option("--out", options->out, "folder for the answer; default: diagnosis/ in the set");
  app.add_option("--inspection", options->inspection,
                 "the inspection.json that gets the fitted values; of a part also the model that "
                 "the recordings are compared with");
  app.add_option("--part", options->part,
                 "file of the part that the recordings show; default: as it is named there, in "
                 "their folder");
  app.add_option("--part-unit", options->part_unit,
                 "of an STL, PLY or OBJ file: m, cm, mm, um, inch")
      ->transform(NameOfLengthUnit());
  app.add_option("--exclude", options->excluded, "effect not to consider; may be repeated")
      ->allow_extra_args(false);
  app.add_option("--max-effects", options->max_effects,
                 "at once; default 2, which is the most for a part")
      ->check(CLI::Range(1, 3));
  app.add_flag("--quick", options->quick,
               "a first answer: from at most 16 of the recordings, one effect at a time");
  app.add_option("--seed", options->seed, "of everything drawn at random; default 1");
  AddWorkerOptions(app, &options->worker);
  return [options]() -> int {
    const absl::StatusOr<int> code = Diagnose(*options);
    return code.ok() ? *code : ReportError(code.status());
  };
}

}  // namespace sightline
