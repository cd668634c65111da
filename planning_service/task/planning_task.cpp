// SPDX-License-Identifier: Apache-2.0
#include "planning_service/task/planning_task.h"

#include <stdlib.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "core/acceptance/acceptance_settings.h"
#include "core/digest/sha256.h"
#include "core/file/atomic_write.h"
#include "core/inspection/inspection.h"
#include "core/json/finite_numbers.h"
#include "core/json/strict_json.h"
#include "core/part/part_digest.h"
#include "core/process_folder/process_folder.h"
#include "core/recordings/assumed_values.h"
#include "core/recordings/recordings.h"
#include "core/status/status_macros.h"
#include "core/text/length_unit.h"
#include "core/text/number_text.h"
#include "planning_service/task/option_fields.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr char kInspectionFile[] = "inspection.json";
constexpr char kRecordingsFile[] = "recordings.json";
constexpr char kPlanFile[] = "plan.json";
constexpr size_t kMaxFileNameBytes = 200;
// Camera and material files are a few kilobytes.
constexpr size_t kMaxDescriptionBytes = 4 << 20;
constexpr int kMostFiles = 10000;
constexpr int kMostMessageDepth = 32;

absl::Status Invalid(const std::string& field, const std::string& description) {
  return WithErrorInfo(InvalidFields({{field, description}}), "INVALID_FIELD");
}

// --- file names in messages ---------------------------------------------------------------------

// A field of a message that names a file, with its path in the message.
struct NamedFile {
  std::string field;
  std::string file;
};

// Fields named `file`, `urdf` or `..._file` name files, in every message of sightline.v1.
bool NamesFile(const google::protobuf::FieldDescriptor& field) {
  return field.type() == google::protobuf::FieldDescriptor::TYPE_STRING &&
         (field.name() == "file" || field.name() == "urdf" ||
          absl::EndsWith(field.name(), "_file"));
}

void CollectFiles(const google::protobuf::Message& message, const std::string& path, int depth,
                  std::vector<NamedFile>* files) {
  if (depth > kMostMessageDepth) return;
  const google::protobuf::Reflection& reflection = *message.GetReflection();
  std::vector<const google::protobuf::FieldDescriptor*> fields;
  reflection.ListFields(message, &fields);
  for (const google::protobuf::FieldDescriptor* field : fields) {
    const std::string name = absl::StrCat(path, path.empty() ? "" : ".", field->name());
    const int count = field->is_repeated() ? reflection.FieldSize(message, field) : 1;
    for (int i = 0; i < count; ++i) {
      const std::string element = field->is_repeated() ? absl::StrCat(name, "[", i, "]") : name;
      if (NamesFile(*field)) {
        files->push_back({element, field->is_repeated()
                                       ? reflection.GetRepeatedString(message, field, i)
                                       : reflection.GetString(message, field)});
      } else if (field->cpp_type() == google::protobuf::FieldDescriptor::CPPTYPE_MESSAGE &&
                 !field->is_map()) {
        CollectFiles(field->is_repeated() ? reflection.GetRepeatedMessage(message, field, i)
                                          : reflection.GetMessage(message, field),
                     element, depth + 1, files);
      }
    }
  }
}

// "./a/./b" is "a/b". CheckFileName refuses names that lead elsewhere, such as "..".
std::string WithoutDotSteps(const std::string& name) {
  std::vector<absl::string_view> steps = absl::StrSplit(name, '/');
  if (std::count(steps.begin(), steps.end(), ".") == 0) return name;
  std::erase(steps, ".");
  return absl::StrJoin(steps, "/");
}

void NormaliseNamesIn(google::protobuf::Message* message, int depth) {
  if (depth > kMostMessageDepth) return;
  const google::protobuf::Reflection& reflection = *message->GetReflection();
  std::vector<const google::protobuf::FieldDescriptor*> fields;
  reflection.ListFields(*message, &fields);
  for (const google::protobuf::FieldDescriptor* field : fields) {
    const bool is_message =
        field->cpp_type() == google::protobuf::FieldDescriptor::CPPTYPE_MESSAGE && !field->is_map();
    if (NamesFile(*field) && !field->is_repeated()) {
      reflection.SetString(message, field, WithoutDotSteps(reflection.GetString(*message, field)));
    } else if (is_message && !field->is_repeated()) {
      NormaliseNamesIn(reflection.MutableMessage(message, field), depth + 1);
    }
    const int count = field->is_repeated() ? reflection.FieldSize(*message, field) : 0;
    for (int i = 0; i < count; ++i) {
      if (NamesFile(*field)) {
        reflection.SetRepeatedString(
            message, field, i, WithoutDotSteps(reflection.GetRepeatedString(*message, field, i)));
      } else if (is_message) {
        NormaliseNamesIn(reflection.MutableRepeatedMessage(message, field, i), depth + 1);
      }
    }
  }
}

absl::Status CheckNamed(const std::vector<NamedFile>& named, const std::set<std::string>& files) {
  for (const NamedFile& name : named) {
    if (name.file.empty()) continue;  // the readers say where one must be given
    if (absl::Status good = CheckFileName(name.file); !good.ok()) {
      return Invalid(name.field, std::string(good.message()));
    }
    if (files.contains(name.file)) continue;
    return WithErrorInfo(
        absl::NotFoundError(absl::StrCat(name.field, ": no file \"", absl::CHexEscape(name.file),
                                         "\" came with the task; it has ",
                                         files.empty() ? "none" : absl::StrJoin(files, ", "))),
        "FILE_UNKNOWN", {{"field", name.field}, {"file", name.file.substr(0, 200)}});
  }
  return absl::OkStatus();
}

// --- kinds --------------------------------------------------------------------------------------

enum class Need { kNo, kOptional, kRequired };

// Rules for the inputs of a kind of task.
struct KindRules {
  Need inspection, plan, recordings;
  // Name of its options' field, and whether a seed means something.
  std::string options;
  bool seed;
};

const std::map<std::string, KindRules>& Rules() {
  static const std::map<std::string, KindRules> rules = {
      {"plan", {Need::kRequired, Need::kNo, Need::kNo, "plan_options", true}},
      {"evaluate", {Need::kRequired, Need::kRequired, Need::kNo, "", false}},
      {"inspect", {Need::kRequired, Need::kRequired, Need::kNo, "inspect_options", true}},
      {"accept", {Need::kRequired, Need::kNo, Need::kNo, "accept_options", true}},
      {"optics", {Need::kRequired, Need::kOptional, Need::kNo, "optics_options", true}},
      {"render", {Need::kOptional, Need::kOptional, Need::kOptional, "render_options", true}},
      {"verify", {Need::kNo, Need::kNo, Need::kRequired, "", true}},
      {"diagnose", {Need::kOptional, Need::kNo, Need::kRequired, "diagnose_options", true}},
  };
  return rules;
}

absl::Status CheckGiven(const std::string& kind, const std::string& field, Need need, bool given) {
  if (need == Need::kRequired && !given) {
    return Invalid(field, absl::StrCat("is missing: a task of kind ", kind, " needs it"));
  }
  if (need == Need::kNo && given) {
    return Invalid(field, absl::StrCat("does not belong to a task of kind ", kind));
  }
  return absl::OkStatus();
}

absl::Status CheckKind(const v1::PlanningTask& task) {
  const auto rules = Rules().find(task.kind());
  if (rules == Rules().end()) {
    return Invalid("kind", absl::StrCat("is \"", absl::CHexEscape(task.kind().substr(0, 40)),
                                        "\", must be one of ", absl::StrJoin(TaskKinds(), ", ")));
  }
  const KindRules& rule = rules->second;
  const bool plan = task.has_plan() || !task.plan_job_id().empty();
  for (const auto& [field, need, given] :
       {std::tuple("inspection", rule.inspection, task.has_inspection()),
        std::tuple(task.plan_job_id().empty() ? "plan" : "plan_job_id", rule.plan, plan),
        std::tuple("recordings", rule.recordings, task.has_recordings())}) {
    SIGHTLINE_RETURN_IF_ERROR(CheckGiven(task.kind(), field, need, given));
  }
  if (task.other_part() && !plan) {
    return Invalid("other_part", "belongs to a task with plan or plan_job_id");
  }
  if (task.has_plan() && !task.plan_job_id().empty()) {
    return Invalid("plan_job_id", "cannot be given together with plan");
  }
  if (task.kind() == "render") {
    if (task.has_inspection() == task.has_recordings()) {
      return Invalid("inspection", "render needs either an inspection or recordings");
    }
    if (task.has_recordings() && plan) return Invalid("plan", "belongs to an inspection");
  }
  for (const auto& [field, given] : {std::pair("plan_options", task.has_plan_options()),
                                     std::pair("optics_options", task.has_optics_options()),
                                     std::pair("render_options", task.has_render_options()),
                                     std::pair("diagnose_options", task.has_diagnose_options()),
                                     std::pair("inspect_options", task.has_inspect_options()),
                                     std::pair("accept_options", task.has_accept_options())}) {
    if (given && rule.options != field) {
      return Invalid(field, absl::StrCat("does not belong to a task of kind ", task.kind()));
    }
  }
  if (task.has_seed() && !rule.seed) {
    return Invalid("seed", absl::StrCat("has no effect: kind ", task.kind(), " draws nothing"));
  }
  return absl::OkStatus();
}

template <typename Number>
absl::Status InRange(const std::string& field, Number value, Number least, Number greatest) {
  if (value >= least && value <= greatest) return absl::OkStatus();
  return Invalid(field, absl::StrCat("is ", value, ", must be in [", least, ", ", greatest, "]"));
}

absl::Status CheckPlanOptions(const v1::PlanJobOptions& options) {
  const std::string in = "plan_options.";
  absl::Status s;
  if (options.has_goal()) s.Update(InRange(in + "goal", options.goal(), 1e-6, 1.0));
  if (options.has_max_scans()) s.Update(InRange(in + "max_scans", options.max_scans(), 1, 1000));
  if (options.has_max_time_s()) {
    s.Update(InRange(in + "max_time_s", options.max_time_s(), 1e-3, 1e6));
  }
  if (options.has_evaluations_per_scan()) {
    s.Update(InRange<int64_t>(in + "evaluations_per_scan", options.evaluations_per_scan(), 1,
                              100000000));
  }
  if (options.has_bound_evaluations()) {
    s.Update(InRange<int64_t>(in + "bound_evaluations", options.bound_evaluations(), 0, 100000000));
  }
  if (options.has_starts()) s.Update(InRange(in + "starts", options.starts(), 1, 1000));
  // Only the command knows the strategies. The value must not look like an option.
  for (const char c : options.strategy()) {
    if (!absl::ascii_isalnum(static_cast<unsigned char>(c)) && c != '-') {
      return Invalid(in + "strategy", "may have letters, digits and hyphens only");
    }
  }
  if (absl::StartsWith(options.strategy(), "-") || options.strategy().size() > 40) {
    return Invalid(in + "strategy", "is not the name of a strategy");
  }
  return s;
}

absl::Status CheckFrameOptions(const std::string& in, const v1::FrameJobOptions& options) {
  absl::Status s;
  if (options.has_scan()) s.Update(InRange(in + ".scan", options.scan(), 1, 1000000));
  if (options.has_frame()) s.Update(InRange(in + ".frame", options.frame(), -10000000, 10000000));
  if (options.has_stage_position_m()) {
    s.Update(InRange(in + ".stage_position_m", options.stage_position_m(), -100.0, 100.0));
  }
  return s;
}

absl::Status CheckInspectOptions(const v1::InspectJobOptions& options) {
  const std::string in = "inspect_options.";
  absl::Status s = InRange(in + "measured", options.measured_size(), 1, 1000);
  for (int i = 0; i < options.measured_size(); ++i) {
    if (options.measured(i).file().empty()) {
      s.Update(Invalid(absl::StrCat(in, "measured[", i, "].file"), "is missing"));
    }
  }
  if (!options.measured_unit().empty()) {
    const auto unit = LengthUnitNamed(options.measured_unit());
    if (!unit.ok()) {
      s.Update(Invalid(in + "measured_unit", std::string(unit.status().message())));
    }
  }
  if (options.has_pose_prior_m()) {
    s.Update(InRange(in + "pose_prior_m", options.pose_prior_m(), 1e-6, 0.1));
  }
  if (options.has_pose_prior_deg()) {
    s.Update(InRange(in + "pose_prior_deg", options.pose_prior_deg(), 1e-3, 30.0));
  }
  if (options.has_tolerated_distance_m()) {
    s.Update(InRange(in + "tolerated_distance_m", options.tolerated_distance_m(), 1e-6, 5e-3));
  }
  if (options.has_evaluations_per_scan()) {
    s.Update(InRange<int64_t>(in + "evaluations_per_scan", options.evaluations_per_scan(), 1,
                              100000000));
  }
  return s;
}

absl::Status CheckOptions(const v1::PlanningTask& task) {
  absl::Status s;
  if (task.kind() == "inspect") s.Update(CheckInspectOptions(task.inspect_options()));
  if (task.has_plan_options()) s.Update(CheckPlanOptions(task.plan_options()));
  if (task.has_optics_options()) {
    s.Update(CheckFrameOptions("optics_options", task.optics_options()));
  }
  if (task.has_render_options()) {
    const v1::RenderJobOptions& options = task.render_options();
    s.Update(CheckFrameOptions("render_options.frames", options.frames()));
    if (options.has_exposure_time_s()) {
      s.Update(InRange("render_options.exposure_time_s", options.exposure_time_s(), 1e-9, 1e4));
    }
    if (options.has_f_number()) {
      s.Update(InRange("render_options.f_number", options.f_number(), 0.5, 128.0));
    }
  }
  if (task.has_diagnose_options()) {
    const v1::DiagnoseJobOptions& options = task.diagnose_options();
    if (options.has_max_effects()) {
      s.Update(InRange("diagnose_options.max_effects", options.max_effects(), 1, 3));
    }
    for (int i = 0; i < options.excluded_effects_size(); ++i) {
      const std::string& id = options.excluded_effects(i);
      const bool good =
          !id.empty() && id.size() <= 100 && id[0] != '-' &&
          std::all_of(id.begin(), id.end(), [](unsigned char c) { return absl::ascii_isgraph(c); });
      if (!good) {
        s.Update(Invalid(absl::StrCat("diagnose_options.excluded_effects[", i, "]"),
                         "is not the name of an effect"));
      }
    }
    if (!options.part_unit().empty()) {
      const auto unit = LengthUnitNamed(options.part_unit());
      if (!unit.ok()) {
        s.Update(Invalid("diagnose_options.part_unit", std::string(unit.status().message())));
      }
    }
  }
  return s;
}

// --- inspection ---------------------------------------------------------------------------------

// Lines of "inspection.json: camera.rows_px is 0, ..." as violations of fields of the task.
absl::Status AsViolation(const std::string& context, const std::string& prefix,
                         const absl::Status& status) {
  if (!absl::IsInvalidArgument(status)) return status;
  std::vector<FieldViolation> violations;
  for (absl::string_view line : absl::StrSplit(status.message(), '\n')) {
    if (!absl::ConsumePrefix(&line, context + ": ")) continue;
    const size_t end = line.find_first_of(" :");
    if (end == absl::string_view::npos) continue;
    violations.push_back({prefix + std::string(line.substr(0, end)),
                          std::string(line.substr(line[end] == ':' ? end + 2 : end + 1))});
  }
  if (violations.empty()) return status;
  return WithErrorInfo(InvalidFields(violations), "INVALID_FIELD");
}

// Camera and material files beside the inspection, in a folder of their own.
absl::Status WriteDescriptions(const v1::Inspection& inspection, const TaskFileReader& read,
                               const std::string& folder) {
  std::set<std::string> names;
  if (!inspection.camera().sensor_file().empty()) names.insert(inspection.camera().sensor_file());
  for (const v1::MaterialAssignment& assignment : inspection.materials()) {
    if (!assignment.file().empty()) names.insert(assignment.file());
  }
  for (const std::string& name : names) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto bytes, read(name));
    if (bytes.size() > kMaxDescriptionBytes) {
      return absl::InvalidArgumentError(absl::StrCat(name, ": has ", bytes.size(),
                                                     " bytes; a camera or material file has at "
                                                     "most ",
                                                     kMaxDescriptionBytes));
    }
    const fs::path path = fs::path(folder) / name;
    std::error_code error;
    fs::create_directories(path.parent_path(), error);
    std::ofstream file(path, std::ios::binary);
    file << bytes;
    file.close();
    if (error || !file) {
      return absl::InternalError(absl::StrCat(name, ": cannot be written to be checked"));
    }
  }
  return absl::OkStatus();
}

// Removes the temporary folder's path from an error message.
absl::Status WithoutFolder(const absl::Status& status, const std::string& folder) {
  std::string text(status.message());
  for (size_t at = text.find(folder); at != std::string::npos; at = text.find(folder)) {
    text.erase(at, folder.size() + 1);
  }
  return {status.code(), text};
}

// Names in material files are relative to the material file; below `folder` they are found again.
absl::Status CheckMaterialFiles(const v1::Inspection& inlined, const std::string& folder,
                                const std::set<std::string>& files) {
  for (int i = 0; i < inlined.materials_size(); ++i) {
    std::vector<NamedFile> named;
    CollectFiles(inlined.materials(i).material(),
                 absl::StrCat("inspection.materials[", i, "].material"), 0, &named);
    for (NamedFile& name : named) {
      name.file = fs::path(name.file).lexically_normal().lexically_relative(folder).string();
    }
    SIGHTLINE_RETURN_IF_ERROR(CheckNamed(named, files));
  }
  return absl::OkStatus();
}

absl::Status CheckInspection(const v1::Inspection& message, const std::set<std::string>& files,
                             const TaskFileReader& read) {
  if (message.part().file().empty()) return Invalid("inspection.part.file", "is missing");
  const auto folder = ProcessFolder::Make(TemporaryBase(), "sightline-task");
  if (!folder.ok()) return absl::InternalError("no folder for checking the task");
  SIGHTLINE_RETURN_IF_ERROR(WriteDescriptions(message, read, folder->path()));
  const auto inlined = InlineInspectionFiles(message, kInspectionFile, folder->path());
  if (!inlined.ok()) {
    return AsViolation(kInspectionFile, "inspection.",
                       WithoutFolder(inlined.status(), folder->path()));
  }
  SIGHTLINE_RETURN_IF_ERROR(CheckMaterialFiles(*inlined, folder->path(), files));
  const auto parsed = ParseInspection(*inlined, kInspectionFile, "");
  if (!parsed.ok()) {
    return AsViolation(kInspectionFile, "inspection.",
                       WithoutFolder(parsed.status(), folder->path()));
  }
  const auto acceptance = ParseAcceptance(message.acceptance(), kInspectionFile);
  if (!acceptance.ok()) return AsViolation(kInspectionFile, "inspection.", acceptance.status());
  return absl::OkStatus();
}

}  // namespace

const std::vector<std::string>& TaskKinds() {
  static const std::vector<std::string> kinds = {"plan",   "evaluate", "inspect", "accept",
                                                 "optics", "render",   "verify",  "diagnose"};
  return kinds;
}

absl::Status CheckFileName(const std::string& name) {
  const auto bad = [&](const std::string& why) {
    return absl::InvalidArgumentError(
        absl::StrCat("file name \"", absl::CHexEscape(name.substr(0, 80)), "\" ", why));
  };
  if (name.empty()) return bad("is empty");
  if (name.size() > kMaxFileNameBytes) {
    return bad(absl::StrCat("has more than ", kMaxFileNameBytes, " bytes"));
  }
  for (const unsigned char c : name) {
    if (c < 0x20 || c == 0x7f || c == '\\') return bad("has a control character or a backslash");
  }
  for (const absl::string_view part : absl::StrSplit(name, '/')) {
    if (part.empty() || part == "." || part == "..") {
      return bad("must be a relative path below the task's folder, without \"..\"");
    }
  }
  for (const char* own : {kInspectionFile, kRecordingsFile, kPlanFile}) {
    if (name == own || absl::StartsWith(name, absl::StrCat(own, "/"))) {
      return bad("is one that the service writes itself: its content belongs into the task");
    }
  }
  return absl::OkStatus();
}

void NormaliseFileNames(v1::PlanningTask* task) { NormaliseNamesIn(task, 0); }

absl::Status CheckTask(const v1::PlanningTask& task, const std::vector<std::string>& files,
                       const TaskFileReader& read) {
  if (const std::optional<std::string> field = FirstNonFiniteField(task)) {
    return Invalid(*field, "must be a finite number");
  }
  SIGHTLINE_RETURN_IF_ERROR(CheckKind(task));
  SIGHTLINE_RETURN_IF_ERROR(CheckOptions(task));
  if (files.size() > kMostFiles) {
    return Invalid("files", absl::StrCat("has ", files.size(), " entries, at most ", kMostFiles));
  }
  std::set<std::string> names;
  for (size_t i = 0; i < files.size(); ++i) {
    const std::string field = absl::StrCat("files[", i, "].name");
    if (absl::Status s = CheckFileName(files[i]); !s.ok()) {
      return Invalid(field, std::string(s.message()));
    }
    if (!names.insert(files[i]).second) return Invalid(field, "is there twice: " + files[i]);
  }
  // A file name must not be the folder of another file.
  for (const std::string& name : names) {
    for (size_t slash = name.find('/'); slash != std::string::npos;
         slash = name.find('/', slash + 1)) {
      if (names.contains(name.substr(0, slash))) {
        return Invalid("files", absl::StrCat(name.substr(0, slash), " is a file and a folder"));
      }
    }
  }
  if (!task.plan().part_digest().empty()) {
    const auto digest = ParsePartDigest(task.plan().part_digest());
    if (!digest.ok()) return Invalid("plan.part_digest", std::string(digest.status().message()));
  }
  std::vector<NamedFile> named;
  CollectFiles(task, "", 0, &named);
  // A plan names files that were used when it was made; the job does not read them.
  std::erase_if(named, [](const NamedFile& name) { return absl::StartsWith(name.field, "plan."); });
  // The same holds for recordings of a part: the mesh comes from diagnose_options.part_file or the
  // inspection.
  std::erase_if(named, [](const NamedFile& name) {
    return absl::StartsWith(name.field, "recordings.part.file");
  });
  // The images of a shot list are to be rendered.
  if (task.kind() == "render") {
    std::erase_if(named, [](const NamedFile& name) {
      return absl::StartsWith(name.field, "recordings.recordings[");
    });
  }
  SIGHTLINE_RETURN_IF_ERROR(CheckNamed(named, names));
  if (task.has_recordings()) {
    v1::Recordings recordings = task.recordings();
    // A diagnosis assumes and fits unstated values.
    if (task.kind() == "diagnose") AssumeMissingValues(&recordings);
    const auto parsed = ParseRecordings(recordings, kRecordingsFile);
    if (!parsed.ok()) return AsViolation(kRecordingsFile, "recordings.", parsed.status());
  }
  return task.has_inspection() ? CheckInspection(task.inspection(), names, read) : absl::OkStatus();
}

std::string TaskFingerprint(const v1::PlanningTask& task, const std::vector<JobFile>& files) {
  std::string text = ToJson(task);
  std::vector<std::string> lines;
  for (const JobFile& file : files) lines.push_back(absl::StrCat(file.digest, " ", file.name));
  std::sort(lines.begin(), lines.end());
  return Sha256Hex(absl::StrCat(text, "\n", absl::StrJoin(lines, "\n")));
}

absl::Status WriteTaskFiles(const v1::PlanningTask& task, const std::string& folder) {
  const fs::path base(folder);
  if (task.has_inspection()) {
    SIGHTLINE_RETURN_IF_ERROR(
        WriteFileAtomically((base / kInspectionFile).string(), ToJson(task.inspection()) + "\n"));
  }
  if (task.has_plan()) {
    SIGHTLINE_RETURN_IF_ERROR(
        WriteFileAtomically((base / kPlanFile).string(), ToJson(task.plan()) + "\n"));
  }
  if (task.has_recordings()) {
    return WriteFileAtomically((base / kRecordingsFile).string(),
                               RecordingsToJson(task.recordings()) + "\n");
  }
  return absl::OkStatus();
}

namespace {

class Arguments {
 public:
  Arguments(std::string kind, std::vector<std::string> first)
      : kind_(std::move(kind)), list_(std::move(first)) {}
  // Adds a word without a value if `on`.
  void Word(const std::string& word, bool on) {
    if (on) list_.push_back(word);
  }
  // Adds "option=value" as one argument, so that a value that begins with a hyphen is no option.
  template <typename T>
  void Option(const std::string& option, const T& value) {
    list_.push_back(absl::StrCat(option, "=", Text(value)));
  }
  // The option of a field of the task (option_fields.h).
  template <typename T>
  void Add(const std::string& field, const T& value) {
    Option(OptionOf(kind_, field), value);
  }
  void Flag(const std::string& field, bool on) {
    if (on) list_.push_back(OptionOf(kind_, field));
  }
  std::vector<std::string> Take() { return std::move(list_); }

 private:
  static std::string Text(const std::string& text) { return text; }
  static std::string Text(double value) { return NumberText(value); }
  static std::string Text(int64_t value) { return absl::StrCat(value); }
  static std::string Text(int32_t value) { return absl::StrCat(value); }
  std::string kind_;
  std::vector<std::string> list_;
};

// `field`: of the options in the task.
void AddFrames(const std::string& field, const v1::FrameJobOptions& options, Arguments* arguments) {
  if (options.has_scan()) arguments->Add(field + ".scan", options.scan());
  if (options.has_frame()) arguments->Add(field + ".frame", options.frame());
  if (options.has_stage_position_m()) {
    arguments->Add(field + ".stage_position_m", options.stage_position_m());
  }
}

void AddInspect(const v1::InspectJobOptions& options, Arguments* arguments) {
  arguments->Add("plan", std::string(kPlanFile));
  for (const v1::MeasuredScanFile& measured : options.measured()) {
    arguments->Add("inspect_options.measured", measured.file());
  }
  if (!options.measured_unit().empty()) {
    arguments->Add("inspect_options.measured_unit",
                   LengthUnitNamed(options.measured_unit()).value_or(""));
  }
  if (!options.pose_file().empty()) {
    arguments->Add("inspect_options.pose_file", options.pose_file());
  }
  if (options.has_pose_prior_m()) {
    arguments->Add("inspect_options.pose_prior_m", 1e3 * options.pose_prior_m());
  }
  if (options.has_pose_prior_deg()) {
    arguments->Add("inspect_options.pose_prior_deg", options.pose_prior_deg());
  }
  if (options.has_tolerated_distance_m()) {
    arguments->Add("inspect_options.tolerated_distance_m", 1e3 * options.tolerated_distance_m());
  }
  arguments->Flag("inspect_options.no_next_scan", options.no_next_scan());
  if (options.has_evaluations_per_scan()) {
    arguments->Add("inspect_options.evaluations_per_scan", options.evaluations_per_scan());
  }
}

// Arguments that run the whole task in one process.
std::vector<std::string> TaskArguments(const v1::PlanningTask& task, const std::string& out_folder,
                                       const std::string& checkpoint_folder) {
  const bool has_plan = task.has_plan() || !task.plan_job_id().empty();
  Arguments arguments(task.kind(),
                      {task.kind(), task.has_recordings() ? kRecordingsFile : kInspectionFile});
  if (task.kind() == "evaluate") arguments.Word(kPlanFile, has_plan);
  arguments.Option("--out", out_folder);
  if (task.has_seed()) arguments.Add("seed", task.seed());
  arguments.Flag("other_part", task.other_part());
  if (task.kind() == "plan") {
    const v1::PlanJobOptions& options = task.plan_options();
    arguments.Option("--checkpoint", checkpoint_folder);
    if (!options.strategy().empty()) arguments.Add("plan_options.strategy", options.strategy());
    if (options.has_goal()) arguments.Add("plan_options.goal", options.goal());
    if (options.has_max_scans()) arguments.Add("plan_options.max_scans", options.max_scans());
    if (options.has_max_time_s()) arguments.Add("plan_options.max_time_s", options.max_time_s());
    if (options.has_evaluations_per_scan()) {
      arguments.Add("plan_options.evaluations_per_scan", options.evaluations_per_scan());
    }
    if (options.has_bound_evaluations()) {
      arguments.Add("plan_options.bound_evaluations", options.bound_evaluations());
    }
    if (options.has_starts()) arguments.Add("plan_options.starts", options.starts());
    arguments.Flag("plan_options.no_pictures", options.no_pictures());
    arguments.Flag("plan_options.no_point_clouds", options.no_point_clouds());
  } else if (task.kind() == "inspect") {
    AddInspect(task.inspect_options(), &arguments);
  } else if (task.kind() == "accept") {
    arguments.Flag("accept_options.no_images", task.accept_options().no_images());
  } else if (task.kind() == "optics") {
    if (has_plan) arguments.Add("plan", std::string(kPlanFile));
    AddFrames("optics_options", task.optics_options(), &arguments);
  } else if (task.kind() == "render") {
    const v1::RenderJobOptions& options = task.render_options();
    arguments.Option("--checkpoint", checkpoint_folder);
    if (has_plan) arguments.Add("plan", std::string(kPlanFile));
    AddFrames("render_options.frames", options.frames(), &arguments);
    if (options.has_exposure_time_s())
      arguments.Add("render_options.exposure_time_s", options.exposure_time_s());
    if (options.has_f_number()) arguments.Add("render_options.f_number", options.f_number());
    arguments.Flag("render_options.layers", options.layers());
    arguments.Flag("render_options.demosaic", options.demosaic());
    arguments.Flag("render_options.no_speckle", options.no_speckle());
    if (options.tiff()) arguments.Add("render_options.tiff", std::string("tiff"));
  } else if (task.kind() == "diagnose") {
    const v1::DiagnoseJobOptions& options = task.diagnose_options();
    if (task.has_inspection()) arguments.Add("inspection", std::string(kInspectionFile));
    if (!options.part_file().empty())
      arguments.Add("diagnose_options.part_file", options.part_file());
    if (!options.part_unit().empty()) {
      arguments.Add("diagnose_options.part_unit",
                    LengthUnitNamed(options.part_unit()).value_or(""));
    }
    for (const std::string& id : options.excluded_effects())
      arguments.Add("diagnose_options.excluded_effects", id);
    if (options.has_max_effects())
      arguments.Add("diagnose_options.max_effects", options.max_effects());
  }
  return arguments.Take();
}

// Most shards of the task: its images, or the starts of a plan, are independent of each other.
int MostParts(const v1::PlanningTask& task) {
  if (task.kind() == "plan") return std::max(1, task.plan_options().starts());
  if (task.kind() != "render") return 1;
  if (task.has_recordings()) return task.recordings().recordings_size();
  const v1::FrameJobOptions& frames = task.render_options().frames();
  const bool one_frame = frames.has_frame() || frames.has_stage_position_m();
  const bool has_plan = task.has_plan() || !task.plan_job_id().empty();
  return has_plan && !one_frame ? std::numeric_limits<int>::max() : 1;
}

}  // namespace

TaskCommands SplitTask(const v1::PlanningTask& task, const std::string& out_folder,
                       const std::string& checkpoint_folder, int most_parts) {
  TaskCommands commands;
  commands.conclusion = TaskArguments(task, out_folder, checkpoint_folder);
  const int count = std::min(most_parts, MostParts(task));
  for (int part = 1; count > 1 && part <= count; ++part) {
    commands.parts.push_back(commands.conclusion);
    commands.parts.back().push_back(absl::StrCat("--part=", part, "/", count));
  }
  return commands;
}

}  // namespace sightline
