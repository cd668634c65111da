// SPDX-License-Identifier: Apache-2.0
#include "tests/fuzz/fuzz_targets.h"

#include "absl/strings/str_cat.h"
#include "core/catalogue/catalogue.h"
#include "core/image/read_raw_image.h"
#include "core/inspection/inspection.h"
#include "core/json/strict_json.h"
#include "core/part/load_part.h"
#include "core/part/mesh_readers.h"
#include "core/part/part_health.h"
#include "core/recordings/recordings.h"
#include "core/sensor/emva1288_data.h"
#include "core/sensor/sensor.h"
#include "core/tolerance/qif/qif_reader.h"
#include "render_worker/material/height_field.h"
#include "render_worker/material/material.h"
#include "render_worker/material/models.h"
#include "tests/fuzz/fuzz_inputs.h"
#include "tools/step_import/step_input_error.h"
#include "tools/step_import/tolerances/part21.h"

namespace sightline {
namespace {

void ReadMesh(std::string_view bytes, const char* format) {
  const auto mesh = LoadPartFromMemory(std::string(bytes), format,
                                       std::string_view(format) == "glb" ? "" : "mm", "fuzz");
  if (mesh.ok()) (void)CheckPartHealth(*mesh);
}

// One device of a catalogue whose other devices are well.
void ReadDevice(const char* kind, std::string_view bytes) {
  static const MemoryFolder folder;
  static const std::map<std::string, std::string> well = {
      {"cameras/a.json", R"({"name": "a", "sensor_type": "mono", "mount": "C", "bit_depth_bit": 12,
          "pixel_pitch_m": 3.45e-6, "sensor_columns_px": 2048, "sensor_rows_px": 1536,
          "gain_dn_per_electron": 0.35, "saturation_capacity_electrons": 10700,
          "dark_noise_electrons": 2.5, "quantum_efficiency": {"mono": 0.6}})"},
      {"lenses/a.json", R"({"name": "a", "mount": "C", "focal_length_m": 0.012, "min_f_number": 1.4,
          "max_f_number": 16})"}};
  for (const auto& [file, text] : well) folder.Write(file, text);
  folder.Write(absl::StrCat(kind, "/a.json"), bytes);
  (void)ReadCatalogue(folder.path()).ok();
}

void ReadMaterial(std::string_view bytes) {
  const auto none = [](const std::string& file) -> absl::StatusOr<std::string> {
    return absl::NotFoundError(file);
  };
  (void)MakeMaterial(ReadJson<v1::Material>(bytes), 650e-9, none, "fuzz.json").ok();
}

}  // namespace

std::map<std::string, FuzzTarget> FileTargets() {
  return {
      {"glb", [](std::string_view bytes) { ReadMesh(bytes, "glb"); }},
      {"gltf",
       [](std::string_view bytes) { (void)ReadGltfFile(bytes, "/nonexistent/part.gltf", {}); }},
      {"stl", [](std::string_view bytes) { ReadMesh(bytes, "stl"); }},
      {"ply", [](std::string_view bytes) { ReadMesh(bytes, "ply"); }},
      {"obj", [](std::string_view bytes) { ReadMesh(bytes, "obj"); }},
      {"points", [](std::string_view bytes) { (void)LoadPoints(MemoryFile(bytes).path()).ok(); }},
      {"image",
       [](std::string_view bytes) {
         const auto check = [](int columns_px, int rows_px) {
           return int64_t{columns_px} * rows_px <= 1 << 20 ? absl::OkStatus()
                                                           : absl::InvalidArgumentError("is large");
         };
         (void)ReadRawImageFile(MemoryFile(bytes).path(), check).ok();
       }},
      {"height_field",
       [](std::string_view bytes) {
         (void)ReadHeightField(MemoryFile(bytes).path(), 1e-6, 1e-6, "fuzz").ok();
       }},
      {"measured_table",
       [](std::string_view bytes) {
         (void)ReadMeasuredTable({}, MemoryFile(bytes).path(), std::nullopt, "fuzz").ok();
       }},
      {"refractive_index",
       [](std::string_view bytes) {
         (void)ReadRefractiveIndex(MemoryFile(bytes).path(), "fuzz").ok();
       }},
      {"merl",
       [](std::string_view bytes) {
         (void)ReadMerl({}, MemoryFile(bytes).path(), 650e-9, "fuzz").ok();
       }},
      {"material_json", ReadMaterial},
      {"inspection_json",
       [](std::string_view bytes) {
         (void)ParseInspection(ReadJson<v1::Inspection>(bytes), "fuzz.json", "/nonexistent").ok();
       }},
      {"recordings_json",
       [](std::string_view bytes) {
         const std::string json = NumberNullPlatePositions(std::string(bytes));
         (void)ParseRecordings(ReadJson<v1::Recordings>(json), "fuzz.json").ok();
       }},
      {"sensor_json",
       [](std::string_view bytes) {
         (void)ParseSensor(ReadJson<v1::Sensor>(bytes), "fuzz.json").ok();
       }},
      {"catalogue_camera_json", [](std::string_view bytes) { ReadDevice("cameras", bytes); }},
      {"catalogue_lens_json", [](std::string_view bytes) { ReadDevice("lenses", bytes); }},
      {"catalogue_laser_json", [](std::string_view bytes) { ReadDevice("lasers", bytes); }},
      {"emva1288",
       [](std::string_view bytes) { (void)ParseEmva1288Data(bytes, "EMVA1288_Data.txt").ok(); }},
      {"qif", [](std::string_view bytes) { (void)ReadQif(MemoryFile(bytes).path()).ok(); }},
      {"part21",
       [](std::string_view bytes) {
         try {
           (void)Part21File::Read(MemoryFile(bytes).path());
         } catch (const StepInputError&) {
         }
       }},
  };
}

const std::map<std::string, FuzzTarget>& FuzzTargets() {
  static const std::map<std::string, FuzzTarget> targets = [] {
    std::map<std::string, FuzzTarget> all = FileTargets();
    all.merge(ClientTargets());
    all.merge(ServiceTargets());
    return all;
  }();
  return targets;
}

}  // namespace sightline
