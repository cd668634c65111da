#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/inspection/inspection.h"
#include "core/json/strict_json.h"
#include "core/recordings/recordings.h"
#include "planner_client/commands/commands.h"
#include "planner_client/commands/exit_code.h"
#include "planner_client/commands/part_assets.h"
#include "planner_client/commands/planning/plan_document.h"
#include "planner_client/commands/worker_session.h"
#include "planner_client/render_client/render_client.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

struct RenderOptions {
  std::string input, out;
  std::string plan, measurement, effects_file;
  std::optional<int> scan, frame;
  std::optional<double> stage_position_m;
  std::optional<double> exposure_s, f_number;
  std::optional<int64_t> seed;
  bool layers = false, demosaic = false, no_speckle = false;
  std::string format = "png";
  WorkerSessionOptions worker;
};

constexpr std::array<const char*, kMeasurementParameters> kParameterNames = {
    "camera_distance_m", "triangulation_angle_deg", "camera_azimuth_deg", "camera_polar_deg",
    "part_alpha_deg",    "part_beta_deg",           "part_gamma_deg",     "offset_y_m",
    "offset_z_m"};

// Nine numbers in metres and degrees.
absl::StatusOr<Measurement> ParseMeasurementText(const std::string& text) {
  const std::vector<std::string> parts = absl::StrSplit(text, ',');
  v1::Measurement message;
  std::array<double, kMeasurementParameters> values{};
  bool ok = parts.size() == values.size();
  for (size_t i = 0; ok && i < values.size(); ++i) {
    ok = absl::SimpleAtod(parts[i], &values[i]) && std::isfinite(values[i]);
    if (!ok) break;
    const auto* field = v1::Measurement::descriptor()->FindFieldByName(kParameterNames[i]);
    message.GetReflection()->SetDouble(&message, field, values[i]);
  }
  if (!ok) {
    std::string names;
    for (const char* name : kParameterNames)
      absl::StrAppend(&names, names.empty() ? "" : ",", name);
    return absl::InvalidArgumentError(
        absl::StrCat("--measurement ", text, ": must be nine numbers ", names));
  }
  const Measurement measurement = MeasurementFromProto(message);
  const MeasurementDomain domain = ThesisDomain();
  const auto internal = ToArray(measurement);
  for (int i = 0; i < kMeasurementParameters; ++i) {
    if (domain.parameters[i].Contains(internal[i])) continue;
    return absl::InvalidArgumentError(absl::StrCat("--measurement: ", kParameterNames[i], " is ",
                                                   NumberText(values[i]),
                                                   ", which is outside Table 2.1"));
  }
  return measurement;
}

// The inspection's measurement if it leaves nothing open.
absl::StatusOr<Measurement> FixedMeasurement(const Inspection& inspection,
                                             const std::string& file) {
  std::array<double, kMeasurementParameters> values{};
  const MeasurementDomain& domain = inspection.domain;
  const bool resting = domain.resting_orientations.size() == 1;
  std::string open;
  for (int i = 0; i < kMeasurementParameters; ++i) {
    const ParameterDomain& parameter = domain.parameters[i];
    if (resting && (i == 4 || i == 5)) {
      values[i] = i == 4 ? domain.resting_orientations[0].part_alpha_rad
                         : domain.resting_orientations[0].part_beta_rad;
    } else if (parameter.ranges.empty() && parameter.values.size() == 1 &&
               (domain.resting_orientations.empty() || (i != 4 && i != 5))) {
      values[i] = parameter.values[0];
    } else {
      absl::StrAppend(&open, open.empty() ? "" : ", ", kParameterNames[i]);
    }
  }
  if (open.empty()) return FromArray(values);
  return absl::InvalidArgumentError(
      absl::StrCat(file, ": measurement does not fix ", open,
                   "; fix every parameter, or give --plan plan.json or --measurement with nine "
                   "numbers"));
}

v1::PartFrame MakeFrame(const v1::Measurement& measurement, double stage_m, int scan, int frame) {
  v1::PartFrame message;
  *message.mutable_measurement() = measurement;
  message.set_stage_position_m(stage_m);
  message.set_scan(scan);
  message.set_frame(frame);
  return message;
}

absl::StatusOr<std::vector<v1::PartFrame>> FramesOfPlan(const RenderOptions& options) {
  const auto plan = ReadPlanScans(options.plan);
  if (!plan.ok()) return plan.status();
  const int scans = plan->plan.scans_size();
  if (scans == 0) return absl::InvalidArgumentError(absl::StrCat(options.plan, ": has no scans"));
  if (options.scan && (*options.scan < 1 || *options.scan > scans)) {
    return absl::InvalidArgumentError(absl::StrCat("--scan ", *options.scan, ": must be in [1, ",
                                                   scans, "], the scans of ", options.plan));
  }
  if (!options.scan && scans > 1 && (options.frame || options.stage_position_m)) {
    return absl::InvalidArgumentError(absl::StrCat(options.frame ? "--frame" : "--stage-position",
                                                   " needs --scan: ", options.plan, " has ", scans,
                                                   " scans"));
  }
  std::vector<v1::PartFrame> frames;
  for (int s = options.scan ? *options.scan - 1 : 0; s < (options.scan ? *options.scan : scans);
       ++s) {
    const v1::PlannedScan& scan = plan->plan.scans(s);
    if (options.stage_position_m) {
      frames.push_back(MakeFrame(scan.measurement(), *options.stage_position_m, s + 1, 0));
      continue;
    }
    const int triggers = scan.trigger_positions_m_size();
    if (triggers == 0) {
      return absl::InvalidArgumentError(
          absl::StrCat(options.plan, ": scans[", s,
                       "].trigger_positions_m is empty; run `sightline evaluate` on the plan "
                       "first, or give --stage-position"));
    }
    if (options.frame && (*options.frame < 0 || *options.frame >= triggers)) {
      return absl::InvalidArgumentError(absl::StrCat("--frame ", *options.frame,
                                                     ": must be in [0, ", triggers - 1,
                                                     "], the frames of scan ", s + 1));
    }
    for (int f = options.frame.value_or(0); f <= options.frame.value_or(triggers - 1); ++f) {
      frames.push_back(MakeFrame(scan.measurement(), scan.trigger_positions_m(f), s + 1, f));
    }
  }
  return frames;
}

// The plan of --scan without --plan: in the output folder or beside the inspection.
absl::StatusOr<std::string> FindPlan(const RenderOptions& options) {
  const fs::path beside = fs::path(options.input).parent_path() / "plan.json";
  const fs::path in_out = fs::path(options.out) / "plan.json";
  for (const fs::path& path : {in_out, beside}) {
    if (fs::exists(path)) return path.string();
  }
  return absl::InvalidArgumentError(absl::StrCat("--scan needs a plan: there is none at ",
                                                 in_out.string(), " and ", beside.string(),
                                                 "; give --plan plan.json"));
}

absl::StatusOr<std::vector<v1::PartFrame>> ChooseFrames(RenderOptions options,
                                                        const Inspection& inspection) {
  if (options.scan && options.plan.empty()) {
    absl::StatusOr<std::string> plan = FindPlan(options);
    if (!plan.ok()) return plan.status();
    options.plan = *std::move(plan);
  }
  if (options.frame && options.stage_position_m) {
    return absl::InvalidArgumentError("--frame and --stage-position exclude each other");
  }
  if (!options.plan.empty()) {
    if (!options.measurement.empty()) {
      return absl::InvalidArgumentError("--plan and --measurement exclude each other");
    }
    return FramesOfPlan(options);
  }
  absl::StatusOr<Measurement> measurement = options.measurement.empty()
                                                ? FixedMeasurement(inspection, options.input)
                                                : ParseMeasurementText(options.measurement);
  if (!measurement.ok()) return measurement.status();
  const double stage_m =
      options.stage_position_m.value_or(options.frame.value_or(0) * inspection.rig.scan_step_m);
  return std::vector<v1::PartFrame>{
      MakeFrame(MeasurementToProto(*measurement), stage_m, 1, options.frame.value_or(0))};
}

// Effects and deviations of --effects.
absl::StatusOr<v1::PlateRender> ReadEffects(const std::string& path) {
  v1::PlateRender message;
  if (path.empty()) return message;
  if (absl::Status status = ReadStrictJsonFile(path, &message); !status.ok()) return status;
  for (const auto& [given, name] :
       {std::pair(message.has_recordings(), "recordings"), std::pair(message.has_seed(), "seed"),
        std::pair(message.has_speckle(), "speckle")}) {
    if (given) {
      return absl::InvalidArgumentError(
          absl::StrCat(path, ": ", name, " does not belong here, only effects and deviations"));
    }
  }
  return message;
}

absl::StatusOr<v1::RenderSpec> PartSpec(const RenderOptions& options,
                                        std::vector<AssetFile>* assets) {
  v1::Inspection message;
  if (absl::Status status = ReadStrictJsonFile(options.input, &message); !status.ok()) {
    return status;
  }
  if (options.exposure_s) message.mutable_render()->set_exposure_time_s(*options.exposure_s);
  if (options.f_number) message.mutable_lens()->set_f_number(*options.f_number);
  if (options.seed) message.mutable_render()->set_seed(*options.seed);
  if (options.no_speckle) message.mutable_render()->set_speckle(false);
  const auto effects = ReadEffects(options.effects_file);
  if (!effects.ok()) return effects.status();
  if (effects->has_deviations()) {
    return absl::InvalidArgumentError(
        absl::StrCat(options.effects_file, ": deviations are for plates"));
  }
  for (const v1::Effect& effect : effects->effects()) *message.add_effects() = effect;
  auto inlined =
      InlineInspectionFiles(message, options.input, fs::path(options.input).parent_path().string());
  if (!inlined.ok()) return inlined.status();
  const auto inspection = ParseInspection(*inlined, options.input, "");
  if (!inspection.ok()) return inspection.status();
  const auto missing = [&](const std::string& field, const std::string& what) {
    return absl::InvalidArgumentError(
        absl::StrCat(options.input, ": ", field, " is missing: images need ", what));
  };
  if (!inspection->sensor) return missing("camera.sensor_file", "a sensor");
  if (!inspection->rig.lens) return missing("lens", "a lens");
  if (inspection->materials.empty()) return missing("materials", "the part's materials");
  auto frames = ChooseFrames(options, *inspection);
  if (!frames.ok()) return frames.status();

  v1::RenderSpec spec;
  v1::PartRender* part = spec.mutable_part();
  for (const v1::PartFrame& frame : *frames) *part->add_frames() = frame;
  v1::Inspection* sent = part->mutable_inspection();
  *sent = *std::move(inlined);
  if (absl::Status status = TakeAssets(options.input, sent, assets); !status.ok()) return status;
  return spec;
}

absl::StatusOr<v1::RenderSpec> PlateSpec(const RenderOptions& options) {
  const auto refuse = [&](const char* option) {
    return absl::InvalidArgumentError(absl::StrCat(option, " is for parts; the recordings of ",
                                                   options.input,
                                                   " say themselves how each was made"));
  };
  if (!options.plan.empty()) return refuse("--plan");
  if (!options.measurement.empty()) return refuse("--measurement");
  if (options.scan) return refuse("--scan");
  if (options.frame) return refuse("--frame");
  if (options.stage_position_m) return refuse("--stage-position");
  if (options.exposure_s) return refuse("--exposure");
  if (options.f_number) return refuse("--f-number");
  if (options.layers) return refuse("--layers");
  v1::RenderSpec spec;
  v1::PlateRender* plate = spec.mutable_plate();
  auto given = ReadEffects(options.effects_file);
  if (!given.ok()) return given.status();
  *plate = *std::move(given);
  absl::Status status = ReadRecordingsMessage(options.input, plate->mutable_recordings());
  if (!status.ok()) return status;
  if (status = ParseRecordings(plate->recordings(), options.input).status(); !status.ok()) {
    return status;
  }
  if (plate->recordings().format_version() != 1) {
    return absl::InvalidArgumentError(
        absl::StrCat(options.input,
                     ": format_version is 2: render the inspection it was made "
                     "from instead"));
  }
  const auto deviations =
      ParseSetupDeviation(plate->deviations(), true, "deviations", options.effects_file);
  if (!deviations.ok()) return deviations.status();
  if (options.seed) plate->set_seed(*options.seed);
  if (options.no_speckle) plate->set_speckle(false);
  return spec;
}

absl::StatusOr<int> Render(const RenderOptions& options) {
  absl::StatusOr<std::string> text = ReadFile(options.input);
  if (!text.ok()) return text.status();
  std::vector<AssetFile> assets;
  absl::StatusOr<v1::RenderSpec> spec = absl::StrContains(*text, "\"laser-line-recordings\"")
                                            ? PlateSpec(options)
                                            : PartSpec(options, &assets);
  if (!spec.ok()) return spec.status();
  v1::RenderOutput* output = spec->mutable_output();
  output->set_image_format(options.format == "tiff" ? v1::RenderOutput::IMAGE_FORMAT_TIFF
                                                    : v1::RenderOutput::IMAGE_FORMAT_PNG);
  output->set_layers(options.layers);
  output->set_demosaic(options.demosaic);
  std::error_code error;
  fs::create_directories(options.out, error);
  if (error) {
    return absl::InvalidArgumentError(
        absl::StrCat("cannot make folder ", options.out, ": ", error.message()));
  }

  ProgressLine progress;
  RenderClientOptions client;
  auto worker = StartWorkerSession(options.worker, &progress, &client);
  if (!worker.ok()) return worker.status();
  std::vector<std::string> warnings;
  client.on_warning = [&](const std::string& warning) { warnings.push_back(warning); };
  auto files = RenderToFolder(client, *std::move(spec), assets, options.out);
  progress.Finish();
  for (const std::string& warning : warnings) {
    std::fprintf(stderr, "warning: %s\n", warning.c_str());
  }
  if (!files.ok()) return AboutInput(files.status(), options.input);
  std::printf("%zu files: %s\n", files->size(),
              fs::absolute(fs::path(options.out) / "recordings.json").c_str());
  return kExitDone;
}

}  // namespace

Command AddRenderCommand(CLI::App& app) {
  auto options = std::make_shared<RenderOptions>();
  app.add_option("input", options->input,
                 "inspection.json (a part), or recordings.json with the shot list of a plate")
      ->required();
  app.add_option("--out", options->out, "folder for images/ and recordings.json")->required();
  app.add_option("--plan", options->plan, "plan.json: render its scans");
  app.add_option("--measurement", options->measurement,
                 "nine numbers in metres and degrees, separated by commas: camera distance, "
                 "triangulation angle, azimuth, polar angle, alpha, beta, gamma, offset y, z");
  app.add_option("--scan", options->scan,
                 "only this scan of the plan, from 1; without --plan that in --out or beside "
                 "the inspection");
  app.add_option("--frame", options->frame,
                 "only this frame: number in the scan's trigger positions, from 0; without --plan "
                 "the stage position is this many scan steps");
  app.add_option("--stage-position", options->stage_position_m, "only this stage position [m]");
  app.add_option("--exposure", options->exposure_s,
                 "exposure time [s] instead of the inspection's");
  app.add_option("--f-number", options->f_number, "f-number instead of the inspection's");
  app.add_option("--seed", options->seed, "of speckle, photons and noise");
  app.add_option("--effects", options->effects_file,
                 "JSON with effects (and, for plates, deviations from nominal)");
  app.add_flag("--layers", options->layers, "also images/NNN_layers.exr (parts)");
  app.add_option("--format", options->format, "png or tiff, 16-bit greyscale")
      ->check(CLI::IsMember({"png", "tiff"}))
      ->capture_default_str();
  app.add_flag("--demosaic", options->demosaic, "also images/NNN_rgb of colour sensors");
  app.add_flag("--no-speckle", options->no_speckle, "image laser light without speckle");
  AddWorkerOptions(app, &options->worker);
  app.add_option("--max-image-bytes", options->worker.max_image_bytes,
                 "memory of our own worker for one image, e.g. 16GB; default 8GB");
  return [options]() -> int {
    const absl::StatusOr<int> code = Render(*options);
    return code.ok() ? *code : ReportError(code.status());
  };
}

}  // namespace sightline
