// SPDX-License-Identifier: Apache-2.0
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
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/command_options/option_values.h"
#include "core/file/atomic_write.h"
#include "core/inspection/inspection.h"
#include "core/json/strict_json.h"
#include "core/recordings/recordings.h"
#include "core/sensor/sensor.h"
#include "core/status/status_macros.h"
#include "core/text/number.h"
#include "planner_client/command_line/process/exit_code.h"
#include "planner_client/command_line/process/output_folder.h"
#include "planner_client/command_line/process/print.h"
#include "planner_client/commands/commands.h"
#include "planner_client/commands/frame_choice.h"
#include "planner_client/commands/part_assets.h"
#include "planner_client/commands/shard.h"
#include "planner_client/commands/worker_session.h"
#include "planner_client/render_client/draft_picture.h"
#include "planner_client/render_client/render_client.h"
#include "report/raw_image/preview_picture.h"
#include "report/raw_image/raw_png.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

struct RenderOptions {
  FrameChoice choice;
  std::string effects_file;
  std::optional<double> exposure_s, f_number;
  std::optional<int64_t> seed;
  bool layers = false, demosaic = false, no_speckle = false, previews = true;
  // A draft: fewer, larger pixels with more noise.
  bool draft = false;
  DraftSettings draft_settings{.max_pixels = 400'000, .noise_relative = 0.1};
  std::string crop;
  std::string format = "png";
  std::string checkpoint;
  std::string part;
  WorkerSessionOptions worker;
};

// Effects and deviations of --effects.
absl::StatusOr<v1::PlateRender> ReadEffects(const std::string& path) {
  v1::PlateRender message;
  if (path.empty()) return message;
  SIGHTLINE_RETURN_IF_ERROR(ReadStrictJsonFile(path, &message));
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

// "640x480": the middle of the sensor. The pixels themselves stay as they are.
absl::Status CropCamera(const std::string& crop, const std::string& input, v1::Camera* camera) {
  const v1::Sensor& sensor = camera->sensor();
  const std::vector<std::string> sides = absl::StrSplit(crop, 'x');
  const auto columns = ParseWhole(sides.front()), rows = ParseWhole(sides.back());
  const bool numbers = sides.size() == 2 && columns.ok() && rows.ok();
  if (!numbers || *columns < 16 || *rows < 16 || *columns > sensor.sensor_columns_px() ||
      *rows > sensor.sensor_rows_px() || *columns % 2 != 0 || *rows % 2 != 0) {
    return absl::InvalidArgumentError(absl::StrCat(
        "--crop ", crop, ": must be COLUMNSxROWS, even numbers from 16x16 to the ",
        sensor.sensor_columns_px(), "x", sensor.sensor_rows_px(), " of the sensor of ", input));
  }
  camera->set_columns_px(static_cast<int>(*columns));
  camera->set_rows_px(static_cast<int>(*rows));
  camera->clear_vertical_fov_deg();  // that of all rows; now by sensor and lens
  return absl::OkStatus();
}

absl::StatusOr<v1::RenderSpec> PartSpec(const RenderOptions& options,
                                        std::vector<AssetFile>* assets) {
  v1::Inspection message;
  SIGHTLINE_RETURN_IF_ERROR(ReadStrictJsonFile(options.choice.input, &message));
  if (options.exposure_s) message.mutable_render()->set_exposure_time_s(*options.exposure_s);
  if (options.f_number) message.mutable_lens()->set_f_number(*options.f_number);
  if (options.seed) message.mutable_render()->set_seed(*options.seed);
  if (options.no_speckle) message.mutable_render()->set_speckle(false);
  SIGHTLINE_ASSIGN_OR_RETURN(const auto effects, ReadEffects(options.effects_file));
  if (effects.has_deviations()) {
    return absl::InvalidArgumentError(
        absl::StrCat(options.effects_file, ": deviations are for plates"));
  }
  for (const v1::Effect& effect : effects.effects()) *message.add_effects() = effect;
  SIGHTLINE_ASSIGN_OR_RETURN(auto checked, CheckImagingInspection(message, options.choice.input));
  std::vector<std::string> remarks;
  SIGHTLINE_ASSIGN_OR_RETURN(auto frames,
                             ChooseFrames(options.choice, checked.inspection, &remarks));
  for (const std::string& remark : remarks) {
    PrintTextTo(stderr, "warning: %s\n", remark.c_str());
  }

  v1::RenderSpec spec;
  v1::PartRender* part = spec.mutable_part();
  bool second_exposure = false;
  for (v1::PartFrame& frame : frames) {
    second_exposure = second_exposure || frame.setting().second_exposure_time_s() > 0;
    // Options override the setting of the plan's scan.
    if (frame.has_setting()) {
      if (options.exposure_s) frame.mutable_setting()->set_exposure_time_s(*options.exposure_s);
      if (options.f_number) frame.mutable_setting()->set_f_number(*options.f_number);
    }
    *part->add_frames() = std::move(frame);
  }
  if (second_exposure) {
    PrintTextTo(stderr, "warning: %s: scans have a second exposure, which is not rendered\n",
                options.choice.plan.c_str());
  }
  v1::Inspection* sent = part->mutable_inspection();
  *sent = std::move(checked.message);
  SIGHTLINE_RETURN_IF_ERROR(TakeAssets(options.choice.input, sent, assets));
  if (!options.crop.empty()) {
    SIGHTLINE_RETURN_IF_ERROR(
        CropCamera(options.crop, options.choice.input, sent->mutable_camera()));
  }
  if (options.draft) {
    int reduction = 1;
    spec = DraftOf(std::move(spec), options.draft_settings, &reduction);
    v1::Inspection& draft = *spec.mutable_part()->mutable_inspection();
    draft.set_name(absl::StrCat(draft.name(), " (draft)"));
    PrintTextTo(stderr,
                "draft: %d x %d pixels of the camera are one of the image; no speckle, one "
                "reflection, more noise\n",
                reduction, reduction);
  }
  return spec;
}

absl::StatusOr<v1::RenderSpec> PlateSpec(const RenderOptions& options) {
  const auto refuse = [&](const char* option) {
    return absl::InvalidArgumentError(absl::StrCat(option, " is for parts; the recordings of ",
                                                   options.choice.input,
                                                   " say themselves how each was made"));
  };
  if (!options.choice.plan.empty()) return refuse("--plan");
  if (options.choice.other_part) return refuse("--other-part");
  if (!options.choice.measurement.empty()) return refuse("--measurement");
  if (options.choice.scan) return refuse("--scan");
  if (options.choice.frame) return refuse("--frame");
  if (options.choice.stage_position_m) return refuse("--stage-position");
  if (options.exposure_s) return refuse("--exposure");
  if (options.f_number) return refuse("--f-number");
  if (options.layers) return refuse("--layers");
  if (options.draft) return refuse("--draft");
  if (!options.crop.empty()) return refuse("--crop");
  v1::RenderSpec spec;
  v1::PlateRender* plate = spec.mutable_plate();
  SIGHTLINE_ASSIGN_OR_RETURN(*plate, ReadEffects(options.effects_file));
  SIGHTLINE_RETURN_IF_ERROR(
      ReadRecordingsMessage(options.choice.input, plate->mutable_recordings()));
  SIGHTLINE_RETURN_IF_ERROR(ParseRecordings(plate->recordings(), options.choice.input).status());
  if (plate->recordings().format_version() == 2) {
    return absl::InvalidArgumentError(
        absl::StrCat(options.choice.input,
                     ": format_version is 2: render the inspection it was made "
                     "from instead"));
  }
  SIGHTLINE_RETURN_IF_ERROR(
      ParseSetupDeviation(plate->deviations(), true, "deviations", options.effects_file).status());
  if (options.seed) plate->set_seed(*options.seed);
  if (options.no_speckle) plate->set_speckle(false);
  return spec;
}

// Names the file that the worker's error is about: that of --effects where it names one of its
// effects.
absl::Status AboutFiles(const absl::Status& status, const RenderOptions& options) {
  const auto given = ReadEffects(options.effects_file);
  if (!given.ok()) return AboutInput(status, options.choice.input);
  for (const v1::Effect& effect : given->effects()) {
    if (!absl::StrContains(status.message(), effect.effect())) continue;
    absl::Status about = AboutInput(status, options.effects_file);
    if (!absl::IsInvalidArgument(about)) return about;
    return absl::InvalidArgumentError(
        absl::StrCat(about.message(), " (`sightline effects` lists all with their parameters)"));
  }
  return AboutInput(status, options.choice.input);
}

// Writes a picture beside every raw image of `files` in the folder.
absl::Status WritePreviews(const std::string& folder, const std::vector<std::string>& files,
                           bool bayer) {
  // Larger ones take too much memory for a picture that no screen shows whole.
  constexpr uint64_t kMostPixels = uint64_t{1} << 25;
  for (const std::string& file : files) {
    if (!absl::EndsWith(file, ".png") || absl::EndsWith(file, "_rgb.png")) continue;
    const auto raw = ReadRawPng(absl::StrCat(folder, "/", file), kMostPixels);
    if (!raw.ok()) {
      PrintTextTo(stderr, "warning: no preview: %s (up to %llu pixels)\n",
                  std::string(raw.status().message()).c_str(),
                  static_cast<unsigned long long>(kMostPixels));
      continue;
    }
    SIGHTLINE_ASSIGN_OR_RETURN(const auto png, PreviewPng(*raw, bayer));
    SIGHTLINE_RETURN_IF_ERROR(WriteFileAtomically(
        absl::StrCat(folder, "/", file.substr(0, file.size() - 4), "_preview.png"), png));
  }
  return absl::OkStatus();
}

absl::StatusOr<int> Render(const RenderOptions& options) {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto part, ParseShard(options.part, options.checkpoint));
  SIGHTLINE_ASSIGN_OR_RETURN(std::string text, ReadFile(options.choice.input));
  std::vector<AssetFile> assets;
  SIGHTLINE_ASSIGN_OR_RETURN(v1::RenderSpec spec,
                             absl::StrContains(text, "\"laser-line-recordings\"")
                                 ? PlateSpec(options)
                                 : PartSpec(options, &assets));
  v1::RenderOutput* output = spec.mutable_output();
  output->set_image_format(options.format == "tiff" ? v1::RenderOutput::IMAGE_FORMAT_TIFF
                                                    : v1::RenderOutput::IMAGE_FORMAT_PNG);
  output->set_layers(options.layers);
  output->set_demosaic(options.demosaic);
  // Parts of the images are made by several commands at once.
  SIGHTLINE_ASSIGN_OR_RETURN(
      const auto out_lock,
      OpenOutputFolder(options.choice.out,
                       part.IsWhole() ? FileLock::Kind::kExclusive : FileLock::Kind::kShared));

  // Files of plates have the names and the place that their shot list gives them; nothing is added.
  const bool previews = options.previews && spec.has_part();
  SIGHTLINE_ASSIGN_OR_RETURN(const auto sensor,
                             previews
                                 ? ParseSensor(spec.part().inspection().camera().sensor(), "camera")
                                 : absl::StatusOr<Sensor>(Sensor()));

  ProgressLine progress;
  RenderClientOptions client;
  SIGHTLINE_ASSIGN_OR_RETURN(auto worker, StartWorkerSession(options.worker, &progress, &client));
  if (!options.checkpoint.empty()) client.checkpoint_file = options.checkpoint + "/finished_images";
  if (!part.IsWhole()) {
    client.part = part.number - 1;
    client.part_count = part.count;
    absl::StrAppend(&client.checkpoint_file, ".", part.number, "-of-", part.count);
  }
  std::vector<std::string> warnings;
  client.on_warning = [&](const std::string& warning) { warnings.push_back(warning); };
  auto files = RenderToFolder(client, std::move(spec), assets, options.choice.out);
  progress.Finish();
  for (const std::string& warning : warnings) {
    PrintTextTo(stderr, "warning: %s\n", warning.c_str());
  }
  if (!files.ok()) return AboutFiles(files.status(), options);
  if (previews) {
    SIGHTLINE_RETURN_IF_ERROR(WritePreviews(options.choice.out, *files,
                                            sensor.colour_filter == ColourFilter::kBayerRggb));
  }
  if (!part.IsWhole()) {
    PrintText("shard %d of %d is done\n", part.number, part.count);
    return kExitDone;
  }
  PrintText("%zu files: %s\n", files->size(),
            fs::absolute(fs::path(options.choice.out) / "recordings.json").c_str());
  return kExitDone;
}

}  // namespace

Command AddRenderCommand(CLI::App& app) {
  auto options = std::make_shared<RenderOptions>();
  app.add_option("input", options->choice.input,
                 "inspection.json (a part), or recordings.json with the shot list of a plate")
      ->required();
  app.add_option("--out", options->choice.out, "folder for images/ and recordings.json")
      ->required();
  AddFrameOptions(app, &options->choice);
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
  app.add_flag("!--no-previews", options->previews,
               "leave out images/NNN_preview.png of parts, brightened for people");
  app.add_flag("--draft", options->draft,
               "a quick picture (parts): fewer, larger pixels of the same light, no speckle, one "
               "reflection, more noise");
  app.add_option("--draft-pixels", options->draft_settings.max_pixels, "most pixels of a draft")
      ->check(CLI::Range(int64_t{256}, int64_t{100'000'000}))
      ->capture_default_str();
  app.add_option("--draft-noise", options->draft_settings.noise_relative,
                 "noise of a draft's incoherent light, relative to the signal")
      ->check(CLI::Range(0.001, 1.0))
      ->capture_default_str();
  NeedOption(app, {"--draft-pixels", "--draft-noise"}, "--draft");
  app.add_option("--crop", options->crop,
                 "COLUMNSxROWS: only so many pixels in the middle of the sensor (parts)");
  app.add_flag("--no-speckle", options->no_speckle, "image laser light without speckle");
  app.add_option("--checkpoint", options->checkpoint,
                 "folder with the list of finished images; after an interruption the same command "
                 "with the same folders renders the others");
  app.add_option("--part", options->part,
                 "K/N: render shard K of N of the images, each as a process of its own with the "
                 "same --out and --checkpoint, on any machine; then the same command without "
                 "--part renders the rest and writes recordings.json");
  AddWorkerOptions(app, &options->worker);
  TakeSizes(*app.add_option("--max-image-bytes", options->worker.max_image_bytes,
                            "memory of the embedded worker for one image, e.g. 16GB; default 8GB"));
  return [options]() -> int {
    const absl::StatusOr<int> code = Render(*options);
    return code.ok() ? *code : ReportError(code.status());
  };
}

}  // namespace sightline
