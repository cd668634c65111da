// SPDX-License-Identifier: Apache-2.0
#include "render_worker/render/render_task.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/digest/sha256.h"
#include "core/file/atomic_write.h"
#include "core/inspection/imaging.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"
#include "proto/status/rpc_status.h"
#include "render_worker/image_file/image_file.h"
#include "render_worker/recordings/plate_frames.h"
#include "render_worker/render/memory_estimate.h"
#include "render_worker/render/part_frame.h"
#include "render_worker/render/part_inspection.h"
#include "render_worker/render/part_scene.h"
#include "render_worker/sensor/demosaic.h"
#include "render_worker/sensor/expose.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

absl::StatusOr<RenderedFile> Describe(const std::string& folder, const std::string& name) {
  const auto digest = DigestOfFile((fs::path(folder) / name).string());
  if (!digest.ok())
    return absl::InternalError(absl::StrCat(name, ": was just written, is not there"));
  RenderedFile result;
  result.file = name;
  result.sha256 = digest->sha256;
  result.size_bytes = digest->size_bytes;
  return result;
}

ImageFormat FormatOf(const v1::RenderOutput& output) {
  return output.image_format() == v1::RenderOutput::IMAGE_FORMAT_TIFF ? ImageFormat::kTiff
                                                                      : ImageFormat::kPng;
}

// Writes the files of one image and reports them.
class ImageWriter {
 public:
  ImageWriter(std::string folder, const v1::RenderOutput& output, const Sensor& sensor,
              const RenderTaskHooks& hooks)
      : folder_(std::move(folder)), output_(output), sensor_(sensor), hooks_(hooks) {}

  // Names requested features that are impossible.
  void WarnOnce() const {
    if (output_.demosaic() && sensor_.colour_filter == ColourFilter::kMono && hooks_.on_warning) {
      hooks_.on_warning("demosaic: the sensor is mono, there is nothing to demosaic");
    }
  }

  // `number`: of the image. `name`: path in the folder with its extension. `description`: JSON of
  // the image's origin.
  absl::Status Write(int number, const std::string& name, const Image<uint16_t>& raw_dn,
                     const RegionOfInterest& roi, const FrameLayers* layers,
                     const std::string& description) const {
    const fs::path path = fs::path(folder_) / name;
    std::error_code error;
    fs::create_directories(path.parent_path(), error);
    if (error) {
      return absl::ResourceExhaustedError(
          absl::StrCat(path.parent_path().string(), ": cannot be made: ", error.message()));
    }
    SIGHTLINE_RETURN_IF_ERROR(WriteRawImage(path.string(), raw_dn, description, FormatOf(output_)));
    SIGHTLINE_RETURN_IF_ERROR(Report(name, number));
    const std::string stem = (fs::path(name).parent_path() / fs::path(name).stem()).string();
    if (layers != nullptr) {
      const std::string file = stem + "_layers.exr";
      SIGHTLINE_RETURN_IF_ERROR(
          WriteLayers((fs::path(folder_) / file).string(), Named(*layers), description));
      SIGHTLINE_RETURN_IF_ERROR(Report(file, number));
    }
    if (output_.demosaic() && sensor_.colour_filter == ColourFilter::kBayerRggb) {
      SIGHTLINE_ASSIGN_OR_RETURN(auto colour, Demosaic(raw_dn, sensor_.rows_px / 2 + roi.row_px,
                                                       sensor_.columns_px / 2 + roi.column_px,
                                                       DemosaicMethod::kMalvarHeCutler));
      const double black_dn = DarkMeanDn(sensor_);
      WhiteBalance(GreyWorldFactors(colour, black_dn, sensor_.largest_dn()), black_dn, &colour);
      const std::string file = absl::StrCat(stem, "_rgb", FileExtension(FormatOf(output_)));
      SIGHTLINE_RETURN_IF_ERROR(WriteColourImage((fs::path(folder_) / file).string(), colour,
                                                 description, FormatOf(output_)));
      return Report(file, number);
    }
    return absl::OkStatus();
  }

  absl::Status WriteRecordings(const v1::Recordings& recordings) const {
    SIGHTLINE_RETURN_IF_ERROR(
        WriteFileAtomically(folder_ + "/recordings.json", RecordingsToJson(recordings) + "\n"));
    return Report("recordings.json", -1);
  }

 private:
  static std::vector<ImageLayer> Named(const FrameLayers& layers) {
    std::vector<ImageLayer> named = {
        {"laser_radiance_w_m2_sr", &layers.laser_radiance_w_m2_sr},
        {"depth_m", &layers.depth_m},
        {"material", &layers.material},
        {"laser_irradiance_w_m2", &layers.laser_irradiance_w_m2},
        {"photo_electrons", &layers.photo_electrons},
        {"incoherent_radiance_w_m2_sr", &layers.incoherent_radiance_w_m2_sr}};
    named.erase(std::remove_if(named.begin(), named.end(),
                               [](const ImageLayer& layer) { return layer.image->empty(); }),
                named.end());
    return named;
  }

  absl::Status Report(const std::string& name, int number) const {
    SIGHTLINE_ASSIGN_OR_RETURN(RenderedFile file, Describe(folder_, name));
    file.image = number;
    if (hooks_.on_file) hooks_.on_file(std::move(file));
    return absl::OkStatus();
  }

  const std::string folder_;
  const v1::RenderOutput& output_;
  const Sensor& sensor_;
  const RenderTaskHooks& hooks_;
};

bool Cancelled(const RenderTaskHooks& hooks) {
  return hooks.cancelled != nullptr && *hooks.cancelled;
}

// Marks the images that the client has; INVALID_ARGUMENT for a number that is none.
absl::StatusOr<std::vector<bool>> FinishedImages(const v1::RenderOutput& output, int images) {
  std::vector<bool> finished(static_cast<size_t>(images), false);
  for (int i = 0; i < output.finished_images_size(); ++i) {
    const int number = output.finished_images(i);
    if (number < 0 || number >= images) {
      return InvalidFields({{absl::StrCat("output.finished_images[", i, "]"),
                             absl::StrCat("is ", number, ", must be in [0, ", images, ")")}});
    }
    finished[static_cast<size_t>(number)] = true;
  }
  return finished;
}

// The set with this recording alone, as the description in the image's file.
std::string DescribeImage(const v1::Recordings& set, int index) {
  v1::Recordings one = set;
  one.clear_recordings();
  *one.add_recordings() = set.recordings(index);
  return RecordingsToJson(one);
}

// --- parts --------------------------------------------------------------------------------------

class PartTask final : public RenderTask {
 public:
  absl::Status Prepare(const v1::PartRender& message, const v1::RenderOutput& output,
                       int64_t max_image_bytes) {
    output_ = output;
    message_ = message.inspection();
    SIGHTLINE_ASSIGN_OR_RETURN(inspection_, ParsePartInspection(message_, "part.inspection"));
    SIGHTLINE_ASSIGN_OR_RETURN(effects_, MakeEffects(inspection_.effects));
    SIGHTLINE_ASSIGN_OR_RETURN(requests_,
                               ParsePartFrames(message.frames(), inspection_, "part.frames"));
    for (size_t i = 0; i < requests_.size(); ++i) {
      const FrameSetup setup = PartFrameSetup(inspection_, requests_[i]);
      SIGHTLINE_RETURN_IF_ERROR(CheckFrameBytes(EstimateFrameBytes(setup), max_image_bytes, setup,
                                                SubPixelsOf(setup),
                                                absl::StrCat("frames[", i, "]")));
      frames_.push_back(message.frames(static_cast<int>(i)));
    }
    SIGHTLINE_ASSIGN_OR_RETURN(finished_, FinishedImages(output, static_cast<int>(frames_.size())));
    return absl::OkStatus();
  }

  int frames() const override { return static_cast<int>(frames_.size()); }

  std::vector<std::string> AssetFiles() const override {
    return sightline::AssetFiles(inspection_);
  }

  absl::Status Run(const std::string& folder, const AssetResolver& assets,
                   const RenderTaskHooks& hooks) override {
    std::string part_digest;
    SIGHTLINE_ASSIGN_OR_RETURN(auto scene, LoadPartScene(inspection_, assets, &part_digest));

    const v1::Recordings recordings = DescribeSet(part_digest);
    const ImageWriter writer(folder, output_, *inspection_.sensor, hooks);
    writer.WarnOnce();
    std::set<std::string> warned;
    if (!SameSource() && hooks.on_warning) {
      hooks.on_warning(
          "the scans differ in laser power or sensor tilt; recordings.json has those of the first "
          "frame");
    }
    for (size_t i = 0; i < frames_.size(); ++i) {
      if (finished_[i]) continue;
      if (Cancelled(hooks)) return absl::CancelledError("cancelled");
      const std::string& name = recordings.recordings(static_cast<int>(i)).file();
      RenderLimits limits;
      limits.threads = hooks.threads;
      limits.max_image_bytes = hooks.max_image_bytes;
      limits.cancelled = hooks.cancelled;
      limits.progress = [&](double fraction) {
        if (!hooks.on_progress) return;
        hooks.on_progress((static_cast<double>(i) + fraction) / static_cast<double>(frames_.size()),
                          absl::StrCat("image ", i + 1, " of ", frames_.size()));
      };
      limits.progress(0);
      SIGHTLINE_ASSIGN_OR_RETURN(
          auto frame, RenderPartFrame(*scene, requests_[i], effects_, output_.layers(), limits));
      for (const std::string& warning : frame.warnings) {
        if (warned.insert(warning).second && hooks.on_warning) hooks.on_warning(warning);
      }
      SIGHTLINE_RETURN_IF_ERROR(writer.Write(static_cast<int>(i), name, frame.image.raw_dn,
                                             PartFrameSetup(inspection_, requests_[i]).roi,
                                             frame.layers ? &*frame.layers : nullptr,
                                             DescribeImage(recordings, static_cast<int>(i))));
    }
    return writer.WriteRecordings(recordings);
  }

 private:
  // All frames have the laser power and the sensor tilt of the first, which the set has once.
  bool SameSource() const {
    const auto source = [](const PartFrameRequest& request) {
      const CameraSetting setting = request.setting.value_or(CameraSetting{});
      return std::tuple(request.setting.has_value(), setting.laser_power_w,
                        setting.sensor_tilt_x_rad, setting.sensor_tilt_y_rad);
    };
    return std::all_of(requests_.begin(), requests_.end(), [&](const PartFrameRequest& request) {
      return source(request) == source(requests_[0]);
    });
  }

  // recordings.json of format version 2.
  v1::Recordings DescribeSet(const std::string& part_digest) const {
    Lens lens = *inspection_.rig.lens;
    Laser laser = inspection_.rig.laser;
    if (requests_[0].setting) {
      // A warning is added if frames differ in these values.
      laser.power_w = requests_[0].setting->laser_power_w;
      lens.sensor_tilt_x_rad = requests_[0].setting->sensor_tilt_x_rad;
      lens.sensor_tilt_y_rad = requests_[0].setting->sensor_tilt_y_rad;
    }
    RecordingSet set;
    set.format_version = 2;
    set.name = inspection_.name;
    set.camera = *inspection_.sensor;
    set.focal_length_m = lens.focal_length_m;
    set.transmission = lens.transmission;
    set.laser = laser;
    set.part =
        RecordedPart{message_.part().file(), part_digest, lens, laser, {}, inspection_.lighting};
    for (const v1::MaterialAssignment& assignment : message_.materials()) {
      set.part->materials.push_back(assignment);
    }
    const int digits = std::max<int>(3, static_cast<int>(absl::StrCat(frames_.size() - 1).size()));
    for (size_t i = 0; i < frames_.size(); ++i) {
      const Measurement& measurement = requests_[i].measurement;
      const v1::PartFrame& frame = frames_[i];
      const FrameSetup setup = PartFrameSetup(inspection_, requests_[i]);
      RecordedImage image;
      image.file = absl::StrFormat("images/%0*d%s", digits, i, FileExtension(FormatOf(output_)));
      image.kind = RecordingKind::kLaser;
      image.series = "scan";
      image.exposure_time_s = setup.exposure_time_s;
      image.f_number = setup.lens.f_number;
      image.camera_distance_m = measurement.camera_distance_m;
      image.focus_distance_m = *setup.lens.focus_distance_m;
      image.laser_distance_m = setup.plate.laser_distance_m;
      image.roi_column_px = setup.roi.column_px;
      image.roi_row_px = setup.roi.row_px;
      image.roi_columns_px = setup.roi.columns_px;
      image.roi_rows_px = setup.roi.rows_px;
      image.measurement = measurement;
      image.scan = frame.scan();
      image.frame = frame.frame();
      image.stage_position_m = frame.stage_position_m();
      set.recordings.push_back(std::move(image));
    }
    v1::Recordings recordings = RecordingsToProto(set);
    recordings.clear_uncertainty();  // of a simulation there is none
    return recordings;
  }

  v1::Inspection message_;
  Inspection inspection_;
  v1::RenderOutput output_;
  std::vector<ActiveEffect> effects_;
  std::vector<PartFrameRequest> requests_;
  std::vector<v1::PartFrame> frames_;  // as they were asked for
  std::vector<bool> finished_;         // of them
};

// --- plates -------------------------------------------------------------------------------------

class PlateTask final : public RenderTask {
 public:
  absl::Status Prepare(const v1::PlateRender& message, const v1::RenderOutput& output,
                       int64_t max_image_bytes) {
    output_ = output;
    message_ = message.recordings();
    SIGHTLINE_ASSIGN_OR_RETURN(set_, ParseRecordings(message_, "plate.recordings"));
    if (set_.format_version == 2) {
      return InvalidFields({{"plate.recordings.format_version", "is 2, must be 1 or 3: a plate"}});
    }
    if (set_.posed && !set_.posed->sheet.origin_m) {
      return InvalidFields({{"plate.recordings.laser_plane.origin_m",
                             "is missing: the light of a rendered laser comes from somewhere"}});
    }
    if (output.layers()) {
      return InvalidFields({{"output.layers", "is for parts; a plate has none"}});
    }
    SIGHTLINE_ASSIGN_OR_RETURN(
        options_.deviation, ParseSetupDeviation(message.deviations(), true, "deviations", "plate"));
    options_.seed = message.has_seed() ? static_cast<uint64_t>(message.seed()) : 1;
    options_.speckle = !message.has_speckle() || message.speckle();
    std::vector<EffectChoice> choices;
    for (const v1::Effect& effect : message.effects()) {
      choices.push_back(
          {effect.effect(), {effect.parameters().begin(), effect.parameters().end()}});
    }
    SIGHTLINE_ASSIGN_OR_RETURN(effects_, MakeEffects(choices));
    for (int i = 0; i < message_.recordings_size(); ++i) {
      const FrameSetup frame = PlateFrame(set_, i, options_);
      SIGHTLINE_RETURN_IF_ERROR(CheckFrameBytes(EstimateFrameBytes(frame), max_image_bytes, frame,
                                                SubPixelsOf(frame),
                                                absl::StrCat("recordings[", i, "]")));
      v1::Recording* recording = message_.mutable_recordings(i);
      if (FormatOf(output_) == ImageFormat::kTiff) {
        recording->set_file(fs::path(recording->file()).replace_extension(".tif").string());
      }
      if (recording->file() == "recordings.json") {
        return InvalidFields({{absl::StrCat("plate.recordings.recordings[", i, "].file"),
                               "is \"recordings.json\", which the set itself needs"}});
      }
    }
    SIGHTLINE_ASSIGN_OR_RETURN(finished_, FinishedImages(output, frames()));
    return absl::OkStatus();
  }

  int frames() const override { return static_cast<int>(set_.recordings.size()); }
  std::vector<std::string> AssetFiles() const override { return {}; }

  absl::Status Run(const std::string& folder, const AssetResolver&,
                   const RenderTaskHooks& hooks) override {
    const ImageWriter writer(folder, output_, set_.camera, hooks);
    writer.WarnOnce();
    Image<double> previous;
    for (int i = 0; i < frames(); ++i) {
      const bool finished = finished_[static_cast<size_t>(i)];
      // A frame of a burst begins with the charge that the frame before has left in the sensor.
      const bool needed_next = i + 1 < frames() && !finished_[static_cast<size_t>(i) + 1] &&
                               PlateFrame(set_, i + 1, options_).burst_frame_index > 0;
      if (finished && !needed_next) continue;
      if (Cancelled(hooks)) return absl::CancelledError("cancelled");
      if (hooks.on_progress) {
        hooks.on_progress(static_cast<double>(i) / frames(),
                          absl::StrCat("image ", i + 1, " of ", frames()));
      }
      const FrameSetup frame = PlateFrame(set_, i, options_);
      SIGHTLINE_ASSIGN_OR_RETURN(
          auto image,
          RenderPlateFrame(frame, effects_, frame.burst_frame_index > 0 ? &previous : nullptr,
                           hooks.threads, PlateOf(set_, i)));
      if (Cancelled(hooks)) return absl::CancelledError("cancelled");
      if (!finished) {
        SIGHTLINE_RETURN_IF_ERROR(writer.Write(i, message_.recordings(i).file(), image.raw_dn,
                                               frame.roi,
                                               /*layers=*/nullptr, DescribeImage(message_, i)));
      }
      previous = std::move(image.mean_photo_electrons);
    }
    return writer.WriteRecordings(message_);
  }

 private:
  v1::Recordings message_;
  RecordingSet set_;
  v1::RenderOutput output_;
  PlateFrameOptions options_;
  std::vector<ActiveEffect> effects_;
  std::vector<bool> finished_;  // of the recordings
};

}  // namespace

absl::StatusOr<std::unique_ptr<RenderTask>> RenderTask::Parse(const v1::RenderSpec& spec,
                                                              int64_t max_image_bytes) {
  if (!v1::RenderOutput::ImageFormat_IsValid(spec.output().image_format())) {
    return InvalidFields(
        {{"output.image_format", absl::StrCat(spec.output().image_format(), ": is not known")}});
  }
  const auto named = [](absl::Status status) {
    return absl::IsInvalidArgument(status) && ErrorReason(status).empty()
               ? WithErrorInfo(std::move(status), "INVALID_FIELD")
               : status;
  };
  switch (spec.scene_case()) {
    case v1::RenderSpec::kPart: {
      auto task = std::make_unique<PartTask>();
      absl::Status status = task->Prepare(spec.part(), spec.output(), max_image_bytes);
      if (!status.ok()) return named(status);
      return task;
    }
    case v1::RenderSpec::kPlate: {
      auto task = std::make_unique<PlateTask>();
      absl::Status status = task->Prepare(spec.plate(), spec.output(), max_image_bytes);
      if (!status.ok()) return named(status);
      return task;
    }
    case v1::RenderSpec::SCENE_NOT_SET:
      break;
  }
  return InvalidFields({{"spec.scene", "is missing, must have part or plate"}});
}

}  // namespace sightline
