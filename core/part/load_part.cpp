// SPDX-License-Identifier: Apache-2.0
#include "core/part/load_part.h"

#include <algorithm>
#include <bit>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <limits>
#include <optional>
#include <random>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "core/file/read_file.h"
#include "core/json/strict_json.h"
#include "core/part/mesh_readers.h"
#include "core/spelling/one_of.h"

namespace sightline {
namespace {

constexpr double kSmallestPart_m = 1e-3, kLargestPart_m = 10;

std::optional<double> MetresPer(const std::string& unit) {
  if (unit == "m") return 1;
  if (unit == "cm") return 1e-2;
  if (unit == "mm") return 1e-3;
  if (unit == "um") return 1e-6;
  if (unit == "inch") return 0.0254;
  return std::nullopt;
}

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
  if (IsStep(format)) {
    return absl::InvalidArgumentError(
        "is given, must be left out: a STEP file says its unit itself");
  }
  if (MetresPer(unit)) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("is \"", unit.substr(0, 40), "\", must be m, cm, mm, um or inch"));
}

// Numbers vertices by position, in the order in which triangles first use them. Positions that
// differ by no more than the rounding of float coordinates are one vertex: exporters write the same
// corner once as 0 and once as 1e-9, and an exact comparison would tear the surface there.
class Welder {
 public:
  // `tolerance_m`: at least 2^-22 of the largest coordinate.
  Welder(float tolerance_m, std::vector<Eigen::Vector3f>* positions)
      : positions_(*positions), tolerance_m_(tolerance_m), table_(1 << 10) {}

  uint32_t Add(const Eigen::Vector3f& position) {
    const Cell low = CellOf(position.array() - tolerance_m_);
    const Cell high = CellOf(position.array() + tolerance_m_);
    uint32_t found = kNone;
    for (int32_t x = low[0]; x <= high[0]; ++x) {
      for (int32_t y = low[1]; y <= high[1]; ++y) {
        for (int32_t z = low[2]; z <= high[2]; ++z) {
          const Slot& slot = table_[SlotOf({x, y, z})];
          for (uint32_t i = slot.first; i != kNone; i = next_[i]) {
            const bool near = (positions_[i] - position).cwiseAbs().maxCoeff() <= tolerance_m_;
            if (near) found = std::min(found, i);
          }
        }
      }
    }
    if (found != kNone) return found;
    if (2 * used_ >= table_.size()) Grow();
    const Cell cell = CellOf(position);
    Slot& slot = table_[SlotOf(cell)];
    const uint32_t index = static_cast<uint32_t>(positions_.size());
    used_ += slot.first == kNone;
    next_.push_back(slot.first);
    slot = {cell, index};
    positions_.push_back(position);
    return index;
  }

 private:
  using Cell = std::array<int32_t, 3>;  // within 2^18 of zero
  static constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();
  struct Slot {
    Cell cell{};
    uint32_t first = kNone;  // kNone: free
  };

  // Cells much wider than the tolerance: nearly always one is enough to look at.
  Cell CellOf(const Eigen::Vector3f& p) const {
    Cell cell;
    for (int axis = 0; axis < 3; ++axis) {
      cell[axis] = static_cast<int32_t>(std::floor(p[axis] / (16.0 * tolerance_m_)));
    }
    return cell;
  }
  size_t SlotOf(const Cell& cell) const {
    uint64_t hash = 0;  // 20 bits for each axis
    for (const int32_t c : cell) hash = (hash << 20) | (static_cast<uint32_t>(c) & 0xfffffu);
    hash += seed_;
    // Finalizer of SplitMix64 (Steele, Lea, Flood 2014).
    hash = (hash ^ (hash >> 30)) * 0xbf58476d1ce4e5b9u;
    hash = (hash ^ (hash >> 27)) * 0x94d049bb133111ebu;
    hash ^= hash >> 31;
    const size_t mask = table_.size() - 1;
    size_t slot = hash & mask;
    while (table_[slot].first != kNone && table_[slot].cell != cell) slot = (slot + 1) & mask;
    return slot;
  }
  // By need: how many vertices differ is known only at the end.
  void Grow() {
    std::vector<Slot> old(2 * table_.size());
    old.swap(table_);
    for (const Slot& slot : old) {
      if (slot.first != kNone) table_[SlotOf(slot.cell)] = slot;
    }
  }

  std::vector<Eigen::Vector3f>& positions_;
  float tolerance_m_;
  // Another for every part, so that no file can be made whose cells share slots. Numbers do not
  // depend on it.
  const uint64_t seed_ = (uint64_t{std::random_device{}()} << 32) | std::random_device{}();
  std::vector<Slot> table_;
  size_t used_ = 0;
  std::vector<uint32_t> next_;
};

std::string Millimetres(double metres) { return absl::StrCat(metres * 1e3, " mm"); }

absl::StatusOr<TriangleMesh> Finish(const RawMesh& raw, double metres_per_unit,
                                    const StopCheck& stop) {
  if (raw.triangles.empty()) return absl::InvalidArgumentError("has no triangles");
  constexpr uint32_t kUnused = std::numeric_limits<uint32_t>::max();
  std::vector<uint32_t> welded(raw.positions.size(), kUnused);
  TriangleMesh mesh;
  std::vector<Eigen::Vector3f> scaled(raw.positions.size());
  float largest_m = 0;
  for (size_t i = 0; i < raw.positions.size(); ++i) {
    // Adding zero turns -0 into 0: the same bytes for the digest.
    scaled[i] = (raw.positions[i] * metres_per_unit).cast<float>() + Eigen::Vector3f::Zero();
    if (!scaled[i].allFinite()) {
      return absl::InvalidArgumentError(
          absl::StrCat("vertex ", i, " is not finite (NaN or too large)"));
    }
    largest_m = std::max(largest_m, scaled[i].cwiseAbs().maxCoeff());
  }
  // Two units in the last place of the largest coordinate.
  const float tolerance_m = std::max(largest_m * 0x1p-22f, std::numeric_limits<float>::min());
  Welder welder(tolerance_m, &mesh.positions_m);
  mesh.triangles.reserve(raw.triangles.size());
  for (const auto& triangle : raw.triangles) {
    if (mesh.triangles.size() % kStepsPerStopCheck == 0) {
      if (absl::Status status = CheckStop(stop); !status.ok()) return status;
    }
    std::array<uint32_t, 3> out;
    for (int corner = 0; corner < 3; ++corner) {
      uint32_t& index = welded[triangle[corner]];
      if (index == kUnused) index = welder.Add(scaled[triangle[corner]]);
      out[corner] = index;
    }
    mesh.triangles.push_back(out);
  }
  // A file that names no material at all has none.
  if (raw.material_names != std::vector<std::string>{""}) {
    mesh.triangle_material = raw.triangle_material;
    mesh.material_names = raw.material_names;
  }
  const double extent_m = mesh.BoundingBox().sizes().maxCoeff();
  if (extent_m > kLargestPart_m) {
    return absl::InvalidArgumentError(
        absl::StrCat("its largest extent is ", extent_m,
                     " m, must be in [0.001, 10] m: looks like millimetres read as metres; state "
                     "the unit of the file"));
  }
  if (extent_m < kSmallestPart_m) {
    return absl::InvalidArgumentError(
        absl::StrCat("its largest extent is ", Millimetres(extent_m),
                     ", must be in [1, 10000] mm: looks like metres read as millimetres (or "
                     "smaller); state the unit of the file"));
  }
  return mesh;
}

// `path` is empty for a part in memory.
absl::StatusOr<TriangleMesh> Load(const std::string& bytes, const std::string& format,
                                  const std::string& unit, const std::string& name,
                                  const std::string& path, const StopCheck& stop) {
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
  absl::StatusOr<TriangleMesh> mesh = Finish(*raw, MetresPer(unit).value_or(1), stop);
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

absl::Status CheckPartUnit(const std::string& file_name, const std::string& unit) {
  return CheckUnit(FormatOf(file_name), unit);
}

absl::StatusOr<TriangleMesh> LoadPart(const std::string& path, const std::string& unit,
                                      const StopCheck& stop) {
  absl::StatusOr<std::string> bytes = ReadRegularFile(path, kMaxPartFileBytes);
  if (!bytes.ok()) return bytes.status();
  return Load(*bytes, FormatOf(path), unit, path, path, stop);
}

absl::StatusOr<TriangleMesh> LoadPartFromMemory(const std::string& bytes, const std::string& format,
                                                const std::string& unit, const std::string& name,
                                                const StopCheck& stop) {
  return Load(bytes, format, unit, name, "", stop);
}

absl::StatusOr<PointCloud> LoadPoints(const std::string& path) {
  absl::StatusOr<std::string> bytes = ReadRegularFile(path, kMaxPartFileBytes);
  if (!bytes.ok()) return bytes.status();
  absl::StatusOr<RawMesh> raw = ReadPly(*bytes, {});
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
        path, ": point ", first - vectors.begin(), ": its ", what, " is not finite; of ",
        vectors.size(), " points this is so for ", std::count_if(first, vectors.end(), bad)));
  };
  if (absl::Status status = first_bad(raw->positions, "position"); !status.ok()) return status;
  if (absl::Status status = first_bad(raw->normals, "normal"); !status.ok()) return status;
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
