#include "tests/fuzz/fuzz_targets.h"

#include <sys/mman.h>
#include <unistd.h>

#include "absl/strings/str_cat.h"
#include "core/image/read_raw_image.h"
#include "core/inspection/inspection.h"
#include "core/json/strict_json.h"
#include "core/part/load_part.h"
#include "core/part/mesh_readers.h"
#include "core/part/part_health.h"
#include "core/recordings/recordings.h"
#include "core/sensor/emva1288_data.h"
#include "core/sensor/sensor.h"
#include "core/tolerance/qif_reader.h"
#include "render_worker/material/height_field.h"
#include "render_worker/material/models.h"
#include "sightline/v1/catalogue.pb.h"
#include "sightline/v1/plan.pb.h"
#include "tools/step_import/step_input_error.h"
#include "tools/step_import/tolerances/part21.h"

namespace sightline {
namespace {

// Bytes as a file, in memory, for readers that want a path.
class MemoryFile {
 public:
  explicit MemoryFile(std::string_view bytes) : descriptor_(memfd_create("fuzz", MFD_CLOEXEC)) {
    if (descriptor_ < 0 ||
        write(descriptor_, bytes.data(), bytes.size()) != static_cast<ssize_t>(bytes.size())) {
      std::abort();
    }
  }
  ~MemoryFile() { close(descriptor_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  std::string path() const { return absl::StrCat("/proc/self/fd/", descriptor_); }

 private:
  int descriptor_;
};

void ReadMesh(std::string_view bytes, const char* format) {
  const auto mesh = LoadPartFromMemory(std::string(bytes), format,
                                       std::string_view(format) == "glb" ? "" : "mm", "fuzz");
  if (mesh.ok()) (void)CheckPartHealth(*mesh);
}

template <typename Message>
Message ReadJson(std::string_view bytes) {
  Message message;
  const absl::Status status = ParseStrictJson(std::string(bytes), "fuzz.json", &message);
  // What was accepted reads back.
  if (status.ok()) {
    Message again;
    if (!ParseStrictJson(ToJson(message), "again.json", &again).ok()) std::abort();
  }
  return message;
}

}  // namespace

const std::map<std::string, FuzzTarget>& FuzzTargets() {
  static const std::map<std::string, FuzzTarget> targets = {
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
      {"inspection_json",
       [](std::string_view bytes) {
         (void)ParseInspection(ReadJson<v1::Inspection>(bytes), "fuzz.json", "/nonexistent").ok();
       }},
      {"plan_json", [](std::string_view bytes) { ReadJson<v1::Plan>(bytes); }},
      {"recordings_json",
       [](std::string_view bytes) {
         const std::string json = NumberNullPlatePositions(std::string(bytes));
         (void)ParseRecordings(ReadJson<v1::Recordings>(json), "fuzz.json").ok();
       }},
      {"sensor_json",
       [](std::string_view bytes) {
         (void)ParseSensor(ReadJson<v1::Sensor>(bytes), "fuzz.json").ok();
       }},
      {"catalogue_lens_json", [](std::string_view bytes) { ReadJson<v1::CatalogueLens>(bytes); }},
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
  return targets;
}

}  // namespace sightline
