// SPDX-License-Identifier: Apache-2.0
#include "core/part/load_part.h"

#include <algorithm>
#include <bit>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <optional>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "core/file/atomic_write.h"
#include "core/file/read_file.h"
#include "core/json/strict_json.h"
#include "core/part/mesh_readers.h"
#include "core/part/surface/normalise.h"
#include "core/spelling/one_of.h"
#include "core/status/status_macros.h"
#include "core/text/length_unit.h"

namespace sightline {
namespace {

// Lower-case extension without the dot.
std::string FormatOf(const std::string& file_name) {
  std::string format = std::filesystem::path(file_name).extension().string();
  if (!format.empty()) format.erase(0, 1);
  for (char& c : format) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return format;
}

bool IsStep(const std::string& format) {
  return format == "step" || format == "stp" || format == "p21";
}

// A format is a line here, whatever else has to know of it.
struct Format {
  std::string_view extension;
  bool carries_unit;
  // Null: the file needs others beside it.
  absl::StatusOr<RawMesh> (*read)(std::string_view bytes, const StopCheck& stop);
};
constexpr Format kFormats[] = {{"glb", true, ReadGlb},
                               {"gltf", true, nullptr},
                               {"stl", false, ReadStl},
                               {"ply", false, ReadPly},
                               {"obj", false, ReadObj}};

const Format* FindFormat(const std::string& extension) {
  const auto* const found = std::ranges::find(kFormats, extension, &Format::extension);
  return found == std::end(kFormats) ? nullptr : found;
}

bool CarriesUnit(const std::string& format) {
  const Format* known = FindFormat(format);
  return IsStep(format) || (known != nullptr && known->carries_unit);
}

absl::Status CheckUnit(const std::string& format, const std::string& unit) {
  if (unit.empty()) {
    if (CarriesUnit(format) || format.empty()) return absl::OkStatus();
    return absl::InvalidArgumentError(absl::StrCat(
        "is missing: a .", format, " file carries no unit, must be m, cm, mm, um or inch"));
  }
  // Whether a STEP file states its unit is known once it is read (planner_client/part_files).
  if (MetresPerUnit(unit)) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("is \"", unit.substr(0, 40), "\", must be m, cm, mm, um or inch"));
}

// `path` is empty for a part in memory.
absl::StatusOr<TriangleMesh> Load(const std::string& bytes, const std::string& format,
                                  const std::string& unit, const std::string& name,
                                  const std::string& path, const StopCheck& stop,
                                  std::string_view unit_advice) {
  const auto named = [&](const absl::Status& status) {
    return absl::Status(status.code(), absl::StrCat(name, ": ", status.message()));
  };
  if (bytes.size() > kMaxPartFileBytes) {
    return named(absl::InvalidArgumentError("has more than the 2048 MiB that can be read"));
  }
  if (absl::Status status = CheckUnit(format, unit); !status.ok()) {
    return named(absl::InvalidArgumentError(absl::StrCat("unit ", status.message())));
  }
  absl::StatusOr<RawMesh> raw = absl::InvalidArgumentError(
      absl::StrCat("unknown format \"", format, "\", must be ", OneOf(PartFormats())));
  if (const Format* known = FindFormat(format); known != nullptr && known->read != nullptr) {
    raw = known->read(bytes, stop);
  }
  if (format == "gltf" && !path.empty()) raw = ReadGltfFile(bytes, path, stop);
  if (IsStep(format)) {
    raw = absl::InvalidArgumentError(
        "is a STEP file, which is meshed before it comes here: convert it with "
        "sightline_step_import");
  }
  if (!raw.ok()) return named(raw.status());
  absl::StatusOr<TriangleMesh> mesh =
      NormaliseMesh(*raw, MetresPerUnit(unit).value_or(1), unit_advice, stop);
  if (!mesh.ok()) return named(mesh.status());
  return mesh;
}

}  // namespace

std::vector<std::string> PartFormats() {
  std::vector<std::string> formats;
  for (const Format& format : kFormats) formats.emplace_back(format.extension);
  return formats;
}

std::vector<std::string> PartFormatsInMemory() {
  std::vector<std::string> formats;
  for (const Format& format : kFormats) {
    if (format.read != nullptr) formats.emplace_back(format.extension);
  }
  return formats;
}

bool IsStepFileName(const std::string& file_name) { return IsStep(FormatOf(file_name)); }

absl::Status CheckPartUnit(const std::string& file_name, const std::string& unit) {
  return CheckUnit(FormatOf(file_name), unit);
}

absl::StatusOr<TriangleMesh> LoadPart(const std::string& path, const std::string& unit,
                                      const StopCheck& stop, std::string_view unit_advice) {
  SIGHTLINE_ASSIGN_OR_RETURN(std::string bytes, ReadRegularFile(path, kMaxPartFileBytes));
  return Load(bytes, FormatOf(path), unit, path, path, stop, unit_advice);
}

absl::StatusOr<TriangleMesh> LoadPartFromMemory(const std::string& bytes, const std::string& format,
                                                const std::string& unit, const std::string& name,
                                                const StopCheck& stop,
                                                std::string_view unit_advice) {
  return Load(bytes, format, unit, name, "", stop, unit_advice);
}

absl::StatusOr<PointCloud> LoadPoints(const std::string& path) {
  SIGHTLINE_ASSIGN_OR_RETURN(std::string bytes, ReadRegularFile(path, kMaxPartFileBytes));
  absl::StatusOr<RawMesh> raw = ReadPly(bytes, {});
  if (!raw.ok()) {
    return absl::Status(raw.status().code(), absl::StrCat(path, ": ", raw.status().message()));
  }
  if (raw->positions.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": has no points"));
  }
  const auto first_bad = [&](const std::vector<Eigen::Vector3d>& vectors,
                             const char* what) -> absl::Status {
    const auto bad = [](const Eigen::Vector3d& v) { return !v.allFinite(); };
    const auto first = std::find_if(vectors.begin(), vectors.end(), bad);
    if (first == vectors.end()) return absl::OkStatus();
    return absl::InvalidArgumentError(absl::StrCat(
        path, ": point ", first - vectors.begin(), ": its ", what, " is not finite; points: ",
        vectors.size(), ", not finite: ", std::count_if(first, vectors.end(), bad)));
  };
  SIGHTLINE_RETURN_IF_ERROR(first_bad(raw->positions, "position"));
  SIGHTLINE_RETURN_IF_ERROR(first_bad(raw->normals, "normal"));
  PointCloud cloud;
  cloud.positions_m = std::move(raw->positions);
  if (raw->normals.size() == cloud.positions_m.size()) {
    cloud.normals = std::move(raw->normals);
    for (Eigen::Vector3d& normal : cloud.normals) {
      if (const double length = normal.norm(); length > 0) normal /= length;
    }
  }
  return cloud;
}

absl::Status WritePlyPoints(const std::string& path, const std::vector<Eigen::Vector3f>& points_m,
                            const std::vector<Eigen::Vector3f>& normals) {
  if (points_m.size() != normals.size()) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": ", points_m.size(), " points but ", normals.size(), " normals"));
  }
  std::string bytes = absl::StrCat(
      "ply\nformat binary_little_endian 1.0\ncomment unit: metre\nelement vertex ", points_m.size(),
      "\nproperty float x\nproperty float y\nproperty float z\nproperty float nx\nproperty float "
      "ny\nproperty float nz\nend_header\n");
  bytes.reserve(bytes.size() + 24 * points_m.size());
  const auto append = [&](const Eigen::Vector3f& v) {
    for (int axis = 0; axis < 3; ++axis) {
      const uint32_t word = std::bit_cast<uint32_t>(v[axis]);
      for (int shift = 0; shift < 32; shift += 8) bytes += static_cast<char>(word >> shift);
    }
  };
  for (size_t i = 0; i < points_m.size(); ++i) {
    append(points_m[i]);
    append(normals[i]);
  }
  return WriteFileAtomically(path, bytes);
}

}  // namespace sightline
