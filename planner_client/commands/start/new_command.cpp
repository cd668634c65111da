// SPDX-License-Identifier: Apache-2.0
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "core/catalogue/catalogue.h"
#include "core/command_options/option_values.h"
#include "core/field_limits/imaging_limits.h"
#include "core/field_limits/target_limits.h"
#include "core/file/atomic_write.h"
#include "core/inspection/inspection.h"
#include "core/json/error_list.h"
#include "core/json/strict_json.h"
#include "core/part/load_part.h"
#include "core/part/part_health.h"
#include "core/process/program_path.h"
#include "core/spelling/nearest_name.h"
#include "core/status/status_macros.h"
#include "core/text/length_unit.h"
#include "core/text/number.h"
#include "planner_client/command_line/process/exit_code.h"
#include "planner_client/command_line/process/output_folder.h"
#include "planner_client/command_line/process/print.h"
#include "planner_client/commands/commands.h"
#include "planner_client/inspection_draft/inspection_draft.h"
#include "planner_client/part_files/part_file.h"
#include "planner_client/part_files/step_program.h"
#include "planner_client/tolerance_import/tolerance_import.h"

namespace sightline {
namespace {

bool ContainsIgnoringCase(const std::string& text, const std::string& part) {
  return absl::StrContains(absl::AsciiStrToLower(text), absl::AsciiStrToLower(part));
}

namespace fs = std::filesystem;

constexpr int kMostAttempts = 5;

// Settings of a rig that a draft can have; an inspection written by hand may have others.
constexpr Limits kHousingAngle{10, 80, " deg"};
constexpr Limits kStandOff{50, 800, " mm"};
constexpr Limits kAngleStep{1, 90, " deg"};
constexpr Limits kDistanceStep{1, 500, " mm"};

struct NewInspectionOptions {
  std::string part, out = "inspection.json", unit, name, holding = "resting";
  std::string catalogue, camera, lens, laser, sensor, tolerances, tolerances_unit;
  std::optional<int> columns_px, rows_px;
  std::optional<double> pixel_pitch_um, fov_deg, focal_length_mm, f_number;
  std::optional<double> goal, spacing_mm, tolerance_mm;
  bool construction_geometry = false, force = false, no_questions = false;
  bool holding_given = false;
  std::string rig = "free", urdf, tip_link;
  std::vector<double> triangulation_angles_deg, stand_offs_mm;
  std::optional<double> angle_step_deg, distance_step_mm;
  bool rig_given = false, fixed_height = false;
};

// --- what a file without a unit may measure ------------------------------------------------------

struct SizeInUnit {
  std::string unit, size;
};

// Units in which the part has a size that is worth inspecting.
std::vector<SizeInUnit> PlausibleUnits(const std::string& file) {
  std::vector<std::string> remarks;  // said when the part is read in its unit
  PartFileOptions part_options;
  part_options.remarks = &remarks;
  std::vector<SizeInUnit> sizes;
  for (const char* unit : {"mm", "cm", "m", "inch", "um"}) {
    const auto mesh = LoadPartFile(file, unit, part_options);
    if (!mesh.ok()) continue;
    const Eigen::Vector3d mm = 1e3 * mesh->BoundingBox().sizes().cast<double>();
    sizes.push_back({unit, absl::StrFormat("%.4g x %.4g x %.4g mm", mm.x(), mm.y(), mm.z())});
  }
  return sizes;
}

std::string UnitsText(const std::vector<SizeInUnit>& sizes) {
  std::vector<std::string> texts;
  for (const SizeInUnit& size : sizes) texts.push_back(absl::StrCat(size.unit, ": ", size.size));
  return absl::StrJoin(texts, "; ");
}

bool NeedsUnit(const NewInspectionOptions& options) {
  return options.unit.empty() && NeedsPartUnit(options.part);
}

// --- questions -----------------------------------------------------------------------------------

// Asks on stderr until `take` accepts the answer; an empty answer means `usual`. CANCELLED when the
// input ends; INVALID_ARGUMENT after too many wrong answers.
absl::Status Ask(const std::string& question, const std::string& usual,
                 const std::function<absl::Status(const std::string&)>& take) {
  for (int attempt = 0; attempt < kMostAttempts; ++attempt) {
    PrintTextTo(stderr, "%s%s: ", question.c_str(),
                usual.empty() ? "" : absl::StrCat(" [", usual, "]").c_str());
    std::string answer;
    if (!std::getline(std::cin, answer)) return absl::CancelledError("no answer; nothing written");
    absl::StripAsciiWhitespace(&answer);
    absl::Status taken = take(answer.empty() ? usual : answer);
    if (taken.ok()) return taken;
    PrintTextTo(stderr, "  %s\n", std::string(taken.message()).c_str());
  }
  return absl::InvalidArgumentError(absl::StrCat("no usable answer to: ", question));
}

absl::Status TakeOneOf(const std::string& answer, const std::vector<std::string>& known,
                       std::string* value) {
  if (std::find(known.begin(), known.end(), answer) != known.end()) {
    *value = answer;
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrCat("must be one of ", absl::StrJoin(known, ", ")));
}

// An empty answer leaves it unset.
absl::Status TakeNumber(const std::string& answer, const Limits& limits,
                        std::optional<double>* value) {
  if (answer.empty() || answer == "none") return absl::OkStatus();
  const auto number = ParseReal(answer);
  if (!number.ok() || !limits.Contains(*number)) {
    return absl::InvalidArgumentError(absl::StrCat("must be a number in ", limits.ToString()));
  }
  *value = *number;
  return absl::OkStatus();
}

// Numbers between commas, each in its range; at least one.
absl::Status TakeNumbers(const std::string& answer, const Limits& limits,
                         std::vector<double>* values) {
  std::vector<double> taken;
  for (const absl::string_view word : absl::StrSplit(answer, ',', absl::SkipWhitespace())) {
    const auto number = ParseReal(std::string(absl::StripAsciiWhitespace(word)));
    if (!number.ok() || !limits.Contains(*number)) {
      return absl::InvalidArgumentError(
          absl::StrCat("must be numbers in ", limits.ToString(), " with commas between them"));
    }
    taken.push_back(*number);
  }
  if (taken.empty()) return absl::InvalidArgumentError("must be given");
  *values = std::move(taken);
  return absl::OkStatus();
}

absl::Status AskYesOrNo(const std::string& question, const std::string& usual, bool* value) {
  std::string answer;
  absl::Status asked = Ask(question, usual, [&](const std::string& text) {
    return TakeOneOf(text, {"yes", "no"}, &answer);
  });
  *value = answer == "yes";
  return asked;
}

// Asks for the kind of rig and for the settings that it has.
absl::Status AskRig(NewInspectionOptions* options) {
  if (!options->rig_given) {
    SIGHTLINE_RETURN_IF_ERROR(Ask(
        "What is the rig: rigid (camera and laser in one housing), free (each on a stand of its "
        "own), turntable (moves the part), robot (moves the housing)?",
        options->rig, [&](const std::string& answer) {
          return TakeOneOf(answer, {"rigid", "free", "turntable", "robot"}, &options->rig);
        }));
    bool moves = true;
    if (options->rig == "free" || options->rig == "rigid") {
      SIGHTLINE_RETURN_IF_ERROR(AskYesOrNo("Does the table move in height?", "yes", &moves));
    }
    options->fixed_height = !moves;
    if (!options->angle_step_deg && options->rig != "robot") {
      SIGHTLINE_RETURN_IF_ERROR(Ask("Steps in which angles are set, in degrees; none: any angle",
                                    "none", [&](const std::string& answer) {
                                      return TakeNumber(answer, kAngleStep,
                                                        &options->angle_step_deg);
                                    }));
    }
  }
  const bool housing = options->rig == "rigid" || options->rig == "robot";
  if (housing && options->triangulation_angles_deg.empty()) {
    SIGHTLINE_RETURN_IF_ERROR(
        Ask("Triangulation angle of the housing in degrees", "30", [&](const std::string& answer) {
          return TakeNumbers(answer, kHousingAngle, &options->triangulation_angles_deg);
        }));
  }
  if (housing && options->stand_offs_mm.empty() && options->sensor.empty()) {
    SIGHTLINE_RETURN_IF_ERROR(
        Ask("Stand-off of the housing in mm", "250", [&](const std::string& answer) {
          return TakeNumbers(answer, kStandOff, &options->stand_offs_mm);
        }));
  }
  if (options->rig != "turntable" && options->rig != "robot") return absl::OkStatus();
  for (const auto& [question, value] :
       {std::pair("URDF file of the table or robot", &options->urdf),
        std::pair("Its link that holds the part or the housing", &options->tip_link)}) {
    if (!value->empty()) continue;
    absl::Status asked = Ask(question, "", [value = value](const std::string& answer) {
      if (answer.empty()) return absl::InvalidArgumentError("must be given");
      *value = answer;
      return absl::OkStatus();
    });
    if (!asked.ok()) return asked;
  }
  return absl::OkStatus();
}

absl::Status AskWhatIsMissing(NewInspectionOptions* options) {
  if (NeedsUnit(*options)) {
    const std::vector<SizeInUnit> sizes = PlausibleUnits(options->part);
    if (!sizes.empty()) {
      absl::Status asked =
          Ask(absl::StrCat("Length unit of the file (", UnitsText(sizes), ")"), sizes.front().unit,
              [&](const std::string& answer) {
                std::vector<std::string> units;
                for (const SizeInUnit& size : sizes) units.push_back(size.unit);
                const auto unit = LengthUnitNamed(answer);
                return TakeOneOf(unit.ok() ? *unit : answer, units, &options->unit);
              });
      if (!asked.ok()) return asked;
    }
  }
  SIGHTLINE_RETURN_IF_ERROR(AskRig(options));
  if (!options->holding_given && options->rig != "turntable") {
    SIGHTLINE_RETURN_IF_ERROR(
        Ask("How is the part held: resting (on the table), fixture (clamped as in the CAD file), "
            "free (in any orientation)?",
            options->holding, [&](const std::string& answer) {
              return TakeOneOf(answer, {"resting", "fixture", "free"}, &options->holding);
            }));
  }
  const bool has_lens = options->focal_length_mm || !options->lens.empty();
  const bool has_camera = !options->camera.empty() || !options->sensor.empty();
  if (!has_camera && !options->fov_deg && !has_lens) {
    SIGHTLINE_RETURN_IF_ERROR(Ask("Vertical field of view of the camera in degrees", "45",
                                  [&](const std::string& answer) {
                                    return TakeNumber(answer, kFieldOfView, &options->fov_deg);
                                  }));
  }
  // With a lens the field of view follows from the camera's pixels; no usual size stands for them.
  if (!has_camera && !options->fov_deg && has_lens && !options->pixel_pitch_um) {
    absl::Status asked = Ask("Pixel pitch of the camera in um", "", [&](const std::string& answer) {
      if (answer.empty()) return absl::InvalidArgumentError("must be given");
      return TakeNumber(answer, kPixelPitch.In(" um", 1e6), &options->pixel_pitch_um);
    });
    if (!asked.ok()) return asked;
  }
  if (!options->tolerance_mm && options->tolerances.empty()) {
    SIGHTLINE_RETURN_IF_ERROR(
        Ask("Full width of the surface's tolerance in mm, to plan until it can be proven; none: "
            "plan until the surface is covered",
            "none", [&](const std::string& answer) {
              return TakeNumber(answer, kZoneWidth.In(" mm", 1e3), &options->tolerance_mm);
            }));
  }
  return absl::OkStatus();
}

// --- devices -------------------------------------------------------------------------------------

// Finds the device of this name: from the data sheet or file, ignoring case, or a unique part of
// it.
template <typename Device, typename NameOf>
absl::StatusOr<Device> FindDevice(const std::vector<Device>& devices, const char* kind,
                                  const std::string& name, const std::string& folder,
                                  NameOf name_of) {
  std::vector<std::string> names;
  std::vector<const Device*> like;
  for (const Device& device : devices) {
    const std::string stem = fs::path(device.file).stem().string();
    if (absl::EqualsIgnoreCase(name_of(device), name) || absl::EqualsIgnoreCase(stem, name)) {
      return device;
    }
    if (ContainsIgnoringCase(name_of(device), name) || ContainsIgnoringCase(stem, name)) {
      like.push_back(&device);
    }
    names.push_back(stem);
  }
  if (like.size() == 1) return *like.front();
  if (like.size() > 1) {
    names.clear();
    for (const Device* device : like) names.push_back(fs::path(device->file).stem().string());
    return absl::InvalidArgumentError(
        absl::StrCat("--", kind, " ", name, ": may be any of ", absl::StrJoin(names, ", ")));
  }
  return absl::InvalidArgumentError(absl::StrCat(
      "--", kind, " ", name, ": no ", kind, " of that name in ", folder, "; the nearest is ",
      NearestName(name, names), " (there are ", absl::StrJoin(names, ", "), ")"));
}

// Path as written into the inspection: relative to its folder.
std::string FromFolderOf(const std::string& out, const std::string& file) {
  const fs::path folder = fs::absolute(out).lexically_normal().parent_path();
  return fs::absolute(file).lexically_normal().lexically_proximate(folder).string();
}

// The sensor's stand-off, and its triangulation angle unless an option gives it.
absl::Status TakeProfileSensor(DeviceProfileSensor sensor, DraftRequest* request) {
  if (!request->rig.stand_offs_m.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("--stand-off-mm and --sensor exclude each other: that of ", sensor.name,
                     " is the middle of its range"));
  }
  request->rig.stand_offs_m = {sensor.MiddleDistance()};
  std::vector<double>& angles_deg = request->rig.triangulation_angles_deg;
  if (angles_deg.empty() && sensor.triangulation_angle_rad) {
    angles_deg = {sensor.message.triangulation_angle_deg()};
  }
  request->profile_sensor = std::move(sensor);
  return absl::OkStatus();
}

absl::Status TakeDevices(const NewInspectionOptions& options, DraftRequest* request) {
  const bool named = !options.camera.empty() || !options.lens.empty() || !options.laser.empty() ||
                     !options.sensor.empty();
  if (!named) return absl::OkStatus();
  std::string folder = options.catalogue;
  if (folder.empty()) {
    std::error_code error;
    folder = (InstalledDataFolder() / "examples/catalogue").string();
    if (!fs::is_directory(folder, error)) {
      return absl::InvalidArgumentError(
          "--catalogue is missing: the folder in which cameras, lenses, lasers and profile "
          "sensors are found by name, such as examples/catalogue");
    }
  }
  SIGHTLINE_ASSIGN_OR_RETURN(const auto catalogue, ReadCatalogue(folder));
  ErrorList errors;
  if (!options.camera.empty()) {
    auto camera = FindDevice(catalogue.cameras, "camera", options.camera, folder,
                             [](const DeviceCamera& device) { return device.sensor.name; });
    if (errors.Add(camera.status())) {
      request->camera_file = FromFolderOf(options.out, camera->file);
      request->camera = *std::move(camera);
      request->lenses = catalogue.lenses;
    }
  }
  const auto name_of = [](const auto& device) { return device.name; };
  if (!options.lens.empty()) {
    auto lens = FindDevice(catalogue.lenses, "lens", options.lens, folder, name_of);
    if (errors.Add(lens.status())) request->lens = *std::move(lens);
  }
  if (!options.laser.empty()) {
    auto laser = FindDevice(catalogue.lasers, "laser", options.laser, folder, name_of);
    if (errors.Add(laser.status())) request->laser = *std::move(laser);
  }
  if (!options.sensor.empty()) {
    auto sensor = FindDevice(catalogue.profile_sensors, "sensor", options.sensor, folder, name_of);
    if (errors.Add(sensor.status())) errors.Add(TakeProfileSensor(*std::move(sensor), request));
  }
  return errors.Status();
}

// --- all of it -----------------------------------------------------------------------------------

absl::Status CheckOptions(const NewInspectionOptions& options) {
  ErrorList errors;
  std::error_code error;
  if (!fs::is_regular_file(options.part, error)) {
    errors.Add(absl::NotFoundError(absl::StrCat(options.part, ": no such file")));
  } else if (NeedsUnit(options)) {
    const std::vector<SizeInUnit> sizes = PlausibleUnits(options.part);
    // If no unit allows reading the file, loading it gives the reason.
    if (!sizes.empty()) {
      errors.Add(absl::InvalidArgumentError(absl::StrCat(
          options.part, ": --unit is missing, the file carries none: ", UnitsText(sizes))));
    }
  }
  if (fs::exists(options.out, error) && !options.force) {
    errors.Add(absl::InvalidArgumentError(
        absl::StrCat(options.out, ": is there already; give another --out, or --force")));
  }
  if (!options.tolerances.empty() && options.tolerances != "part" &&
      !fs::is_regular_file(options.tolerances, error)) {
    errors.Add(absl::NotFoundError(absl::StrCat("--tolerances ", options.tolerances,
                                                ": no such file; or `part`: the part's own")));
  }
  return errors.Status();
}

absl::Status TakeTolerances(const NewInspectionOptions& options, const TriangleMesh& part,
                            DraftRequest* request) {
  const std::string file = options.tolerances == "part" || options.tolerances.empty()
                               ? options.part
                               : options.tolerances;
  const bool own = file == options.part;
  if (options.tolerances.empty() && !IsStepFile(file)) return absl::OkStatus();
  ToleranceImportOptions import_options;
  import_options.length_unit =
      options.tolerances_unit.empty() && own ? options.unit : options.tolerances_unit;
  const auto imported = ImportTolerances(file, import_options);
  // Nobody has asked for those of the part.
  if (options.tolerances.empty() && !imported.ok()) return absl::OkStatus();
  if (!imported.ok()) return imported.status();
  const int count = static_cast<int>(imported->report.read.size());
  if (options.tolerances.empty()) {
    request->tolerances_in_part = count;
    return absl::OkStatus();
  }
  if (count == 0) {
    return absl::InvalidArgumentError(
        absl::StrCat(file, ": has no tolerance that can be read (`sightline part ", file,
                     " --tolerances` says more); give one for all of the surface by "
                     "--tolerance-mm"));
  }
  request->tolerance_file = FromFolderOf(options.out, file);
  request->tolerance_unit = options.tolerances_unit;
  SIGHTLINE_ASSIGN_OR_RETURN(const auto faces, FacesOf(*imported, part));
  const size_t described = imported->report.nominal_faces.size();
  if (faces.size() < described) {
    PrintText(
        "tolerances: %zu of the %zu faces that features of %s have lie on the part; "
        "`sightline plan` names the tolerances of the others\n",
        faces.size(), described, imported->report.file.c_str());
  }
  request->toleranced_surfaces = TolerancedSurfacesOf(imported->report, faces);
  return absl::OkStatus();
}

v1::Rig::PartHolding HoldingOf(const std::string& word) {
  return word == "fixture" ? v1::Rig::PART_HOLDING_FIXTURE
         : word == "free"  ? v1::Rig::PART_HOLDING_FREE
                           : v1::Rig::PART_HOLDING_RESTING;
}

absl::StatusOr<DraftRequest> MakeRequest(const NewInspectionOptions& options) {
  DraftRequest request;
  PartFileOptions part_options;
  part_options.construction_geometry = options.construction_geometry;
  SIGHTLINE_ASSIGN_OR_RETURN(const auto part,
                             LoadPartFile(options.part, options.unit, part_options));
  request.health = CheckPartHealth(part);
  request.name = options.name.empty() ? fs::path(options.part).stem().string() : options.name;
  request.part_file = FromFolderOf(options.out, options.part);
  request.part_unit = options.unit;
  request.construction_geometry = options.construction_geometry;
  request.holding = HoldingOf(options.holding);
  request.rig.kind = *RigKindNamed(options.rig);
  request.rig.triangulation_angles_deg = options.triangulation_angles_deg;
  for (const double stand_off_mm : options.stand_offs_mm) {
    request.rig.stand_offs_m.push_back(stand_off_mm / 1e3);
  }
  request.rig.angle_step_deg = options.angle_step_deg;
  if (options.distance_step_mm) request.rig.distance_step_m = *options.distance_step_mm / 1e3;
  request.rig.stage_moves_in_height = !options.fixed_height;
  if (!options.urdf.empty()) request.rig.urdf = FromFolderOf(options.out, options.urdf);
  request.rig.tip_link = options.tip_link;
  request.columns_px = options.columns_px;
  request.rows_px = options.rows_px;
  request.vertical_fov_deg = options.fov_deg;
  request.f_number = options.f_number;
  const auto scaled = [](const std::optional<double>& value, double unit) {
    return value ? std::optional(*value * unit) : std::nullopt;
  };
  request.pixel_pitch_m = scaled(options.pixel_pitch_um, 1e-6);
  request.focal_length_m = scaled(options.focal_length_mm, 1e-3);
  request.spacing_m = scaled(options.spacing_mm, 1e-3);
  request.tolerance_m = scaled(options.tolerance_mm, 1e-3);
  if (options.goal) request.goal = *options.goal;
  SIGHTLINE_RETURN_IF_ERROR(TakeDevices(options, &request));
  SIGHTLINE_RETURN_IF_ERROR(TakeTolerances(options, part, &request));
  return request;
}

absl::Status New(NewInspectionOptions options) {
  if (!options.no_questions && isatty(STDIN_FILENO) != 0 && fs::exists(options.part)) {
    SIGHTLINE_RETURN_IF_ERROR(AskWhatIsMissing(&options));
  }
  SIGHTLINE_RETURN_IF_ERROR(CheckOptions(options));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto request, MakeRequest(options));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto draft, DraftInspection(request));
  const std::string text = CommentedJson(draft.inspection, draft.comments);
  const fs::path folder = fs::path(options.out).parent_path();
  v1::Inspection read_back;
  absl::Status status = ParseStrictJson(text, options.out, &read_back);
  if (status.ok()) status = ParseInspection(read_back, options.out, folder.string()).status();
  if (!status.ok()) return status;
  if (!folder.empty()) {
    if (status = MakeOutputFolder(folder.string()); !status.ok()) return status;
  }
  if (status = WriteFileAtomically(options.out, text); !status.ok()) return status;

  const Eigen::Vector3d mm = 1e3 * request.health.bounding_box_m.sizes();
  PrintText("%s: %.4g x %.4g x %.4g mm, about %lld targets %.4g mm apart\n",
            fs::path(options.part).filename().c_str(), mm.x(), mm.y(), mm.z(),
            static_cast<long long>(draft.expected_targets),
            1e3 * draft.inspection.targets().spacing_m());
  if (!draft.lens.empty()) PrintText("lens chosen: %s\n", draft.lens.c_str());
  for (const std::string& finding : request.health.findings) {
    PrintText("part: %s\n", finding.c_str());
  }
  PrintText("written: %s\nnext:    sightline plan %s --out plan\n",
            fs::absolute(options.out).lexically_normal().c_str(), options.out.c_str());
  return absl::OkStatus();
}

// The range of the field of an inspection that an option sets.
CLI::Validator Within(const Limits& limits) {
  return CLI::Validator(
      [limits](std::string& text) {
        const auto number = ParseReal(text);
        return number.ok() && limits.Contains(*number)
                   ? std::string()
                   : absl::StrCat("is ", text, ", must be in ", limits.ToString());
      },
      // The option's name states the unit.
      absl::StrCat("in ", limits.In("", 1).ToString()));
}

}  // namespace

Command AddNewCommand(CLI::App& app) {
  auto options = std::make_shared<NewInspectionOptions>();
  app.add_option("part", options->part, absl::StrCat("part file (", PartFileEndings(), ")"))
      ->required();
  app.add_option("--out", options->out, "inspection file to write")->capture_default_str();
  app.add_option("--unit", options->unit,
                 "length unit of a file that states none, as STL: m, cm, mm, um, inch")
      ->transform(NameOfLengthUnit());
  app.add_flag("--construction-geometry", options->construction_geometry,
               "of a STEP file, take construction geometry for the part");
  app.add_option("--name", options->name, "of the inspection; default: that of the part's file");
  CLI::Option* holding =
      app.add_option("--holding", options->holding,
                     "resting: on the table, on a face on which it is stable; fixture: clamped as "
                     "in the CAD file; free: in any orientation")
          ->check(CLI::IsMember({"resting", "fixture", "free"}))
          ->capture_default_str();
  CLI::Option* rig =
      app.add_option("--rig", options->rig,
                     "rigid: camera and laser in one housing; free: each on a stand of its own; "
                     "turntable: moves the part; robot: moves the housing")
          ->check(CLI::IsMember({"rigid", "free", "turntable", "robot"}))
          ->capture_default_str();
  app.add_option("--triangulation-angle-deg", options->triangulation_angles_deg,
                 "of a housing, between camera and laser; several with commas")
      ->delimiter(',')
      ->check(Within(kHousingAngle));
  app.add_option("--stand-off-mm", options->stand_offs_mm,
                 "of a housing, from the middle of its range; several with commas")
      ->delimiter(',')
      ->check(Within(kStandOff));
  app.add_flag("--fixed-height", options->fixed_height, "the table does not move in height");
  app.add_option("--angle-step-deg", options->angle_step_deg,
                 "step in which angles are set; default: any angle")
      ->check(Within(kAngleStep));
  app.add_option("--distance-step-mm", options->distance_step_mm,
                 "step in which the camera's distance is set; default: any distance")
      ->check(Within(kDistanceStep));
  app.add_option("--urdf", options->urdf, "of the turntable or robot");
  app.add_option("--tip-link", options->tip_link,
                 "link of --urdf that holds the part or the housing");
  app.add_option(
      "--catalogue", options->catalogue,
      "folder with cameras/, lenses/, lasers/ and profile_sensors/, for the names below");
  app.add_option("--camera", options->camera,
                 "camera of the catalogue; without --lens with the lens that suits the part best");
  app.add_option("--lens", options->lens, "lens of the catalogue");
  app.add_option("--laser", options->laser, "laser of the catalogue");
  app.add_option("--sensor", options->sensor,
                 "profile sensor of the catalogue, camera and laser in one housing; for --rig "
                 "rigid, which is then the default, and --rig robot");
  app.add_option("--columns", options->columns_px, "of the camera's image")
      ->check(Within(kImageSize));
  app.add_option("--rows", options->rows_px, "of the camera's image")->check(Within(kImageSize));
  app.add_option("--pixel-pitch-um", options->pixel_pitch_um,
                 "of the camera; with a lens the field of view follows from it")
      ->check(Within(kPixelPitch.In(" um", 1e6)));
  app.add_option("--fov-deg", options->fov_deg,
                 "vertical field of view; default: by --focal-length-mm, --pixel-pitch-um and "
                 "--rows, else 45")
      ->check(Within(kFieldOfView));
  app.add_option("--focal-length-mm", options->focal_length_mm, "of the lens")
      ->check(Within(kLensFocalLength.In(" mm", 1e3)));
  app.add_option("--f-number", options->f_number, "of the lens; default 8")
      ->check(Within(kLensFNumber));
  app.add_option("--goal", options->goal,
                 "fraction of the surface to be covered, or known well enough for its tolerance; "
                 "default 0.95")
      ->check(Within(kCoverageGoal));
  app.add_option("--tolerance-mm", options->tolerance_mm,
                 "full width of the surface's tolerance: plan until it can be proven")
      ->check(Within(kZoneWidth.In(" mm", 1e3)));
  CLI::Option* tolerances =
      app.add_option("--tolerances", options->tolerances,
                     "STEP (AP242) or QIF file with tolerances of the drawing; part: those of the "
                     "part's own STEP file");
  app.add_option("--tolerances-unit", options->tolerances_unit,
                 "length unit of a file of --tolerances that states none: m, cm, mm, um, inch")
      ->transform(NameOfLengthUnit())
      ->needs(tolerances);
  app.add_option("--spacing-mm", options->spacing_mm,
                 "between targets; default: so that there are about 8000")
      ->check(Within(kTargetSpacing.In(" mm", 1e3)));
  app.add_flag("--force", options->force, "write over a file that is there");
  app.add_flag("--no-questions", options->no_questions,
               "ask nothing, even on a terminal: what is not given has its default");
  return [options, holding, rig]() -> int {
    options->holding_given = holding->count() > 0;
    options->rig_given = rig->count() > 0;
    if (!options->rig_given && !options->sensor.empty()) {
      options->rig = "rigid";
      options->rig_given = true;
    }
    const absl::Status status = New(*options);
    return status.ok() ? kExitDone : ReportError(status);
  };
}

}  // namespace sightline
