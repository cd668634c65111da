// SPDX-License-Identifier: Apache-2.0
// STL, binary and ASCII. Facet normals are ignored: the order of the corners says the same.
#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>

#include "absl/strings/str_cat.h"
#include "core/part/mesh_readers.h"
#include "core/part/polygon.h"

namespace sightline {
namespace {

constexpr size_t kHeader = 84, kFacet = 50;

uint32_t LittleEndian32(std::string_view bytes, size_t at) {
  uint32_t value = 0;
  for (int i = 3; i >= 0; --i) value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
  return value;
}

float LittleEndianFloat(std::string_view bytes, size_t at) {
  const uint32_t word = LittleEndian32(bytes, at);
  float value;
  std::memcpy(&value, &word, sizeof(value));
  return value;
}

absl::StatusOr<RawMesh> ReadFacets(std::string_view bytes, size_t count, const StopCheck& stop) {
  RawMesh mesh;
  mesh.positions.reserve(3 * count);
  mesh.triangles.reserve(count);
  for (size_t t = 0; t < count; ++t) {
    if (t % kStepsPerStopCheck == 0) {
      if (absl::Status status = CheckStop(stop); !status.ok()) return status;
    }
    const size_t at = kHeader + kFacet * t + 12;
    for (size_t corner = 0; corner < 3; ++corner) {
      mesh.positions.emplace_back(LittleEndianFloat(bytes, at + 12 * corner),
                                  LittleEndianFloat(bytes, at + 12 * corner + 4),
                                  LittleEndianFloat(bytes, at + 12 * corner + 8));
    }
    const uint32_t first = static_cast<uint32_t>(3 * t);
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

std::string Lower(std::string_view word) {
  std::string lower(word);
  for (char& c : lower) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return lower;
}

absl::StatusOr<RawMesh> ReadAscii(std::string_view bytes, const StopCheck& stop) {
  RawMesh mesh;
  PolygonCutter cutter(stop);
  size_t words = 0;
  TextScanner scanner(bytes);
  std::vector<uint32_t> loop;
  bool in_solid = false, in_loop = false;
  const auto error = [&](const std::string& reason) {
    return absl::InvalidArgumentError(absl::StrCat("line ", scanner.line(), ": ", reason));
  };
  while (true) {
    const std::string word = Lower(scanner.Word());
    if (word.empty()) break;
    if (++words % kStepsPerStopCheck == 0) {
      if (absl::Status status = CheckStop(stop); !status.ok()) return status;
    }
    if (word == "solid") {
      if (in_solid) return error("\"solid\" inside a solid");
      in_solid = true;
      scanner.NextLine();
    } else if (word == "endsolid") {
      if (!in_solid || in_loop) return error("\"endsolid\" where it does not belong");
      in_solid = false;
      scanner.NextLine();
    } else if (word == "facet") {
      scanner.NextLine();  // the normal
    } else if (word == "outer") {
      if (!in_solid || in_loop || Lower(scanner.Word()) != "loop") {
        return error("\"outer loop\" expected here only once per facet");
      }
      in_loop = true;
      loop.clear();
    } else if (word == "vertex") {
      if (!in_loop) return error("\"vertex\" outside a loop");
      Eigen::Vector3d position;
      for (int axis = 0; axis < 3; ++axis) {
        const std::string_view number = scanner.WordInLine();
        if (!ParseNumber(number, &position[axis])) {
          return error(absl::StrCat("\"", Excerpt(number), "\" is no coordinate"));
        }
      }
      loop.push_back(static_cast<uint32_t>(mesh.positions.size()));
      mesh.positions.push_back(position);
    } else if (word == "endloop") {
      if (!in_loop || loop.size() < 3) return error("a loop needs at least 3 vertices");
      if (absl::Status status = cutter.Add(loop, &mesh); !status.ok()) {
        return absl::IsInvalidArgument(status) ? error(std::string(status.message())) : status;
      }
      in_loop = false;
    } else if (word == "endfacet") {
      if (in_loop) return error("\"endfacet\" inside a loop");
    } else {
      return error(absl::StrCat("unknown word \"", Excerpt(word), "\""));
    }
  }
  if (in_solid) return error("truncated: the file ends before \"endsolid\"");
  return mesh;
}

}  // namespace

absl::StatusOr<RawMesh> ReadStl(std::string_view bytes, const StopCheck& stop) {
  // Many binary files start with "solid" too: a length that fits the binary form decides first.
  if (bytes.size() >= kHeader) {
    const uint64_t count = LittleEndian32(bytes, 80);
    const uint64_t size = kHeader + kFacet * count;
    const bool padded =
        size < bytes.size() && count > 0 &&
        std::all_of(bytes.begin() + static_cast<std::ptrdiff_t>(size), bytes.end(),
                    [](char c) { return c == 0 || c == '\n' || c == '\r' || c == ' '; });
    if (size == bytes.size() || padded) {
      if (count > kMaxTriangles) {
        return absl::InvalidArgumentError(
            absl::StrCat("has ", count, " triangles, at most ", kMaxTriangles, " can be read"));
      }
      return ReadFacets(bytes, count, stop);
    }
  }
  // Text has no zero byte; a binary header or float nearly always has one.
  size_t start = 0;
  while (start < bytes.size() && std::isspace(static_cast<unsigned char>(bytes[start]))) ++start;
  const bool text =
      Lower(bytes.substr(start, 5)) == "solid" && bytes.find('\0') == std::string_view::npos;
  if (text) return ReadAscii(bytes, stop);
  if (bytes.size() < kHeader) {
    return absl::InvalidArgumentError(
        absl::StrCat("is no STL file: ", bytes.size(), " bytes, no \"solid\" at the start"));
  }
  const uint64_t count = LittleEndian32(bytes, 80);
  const uint64_t size = kHeader + kFacet * count;
  return absl::InvalidArgumentError(
      absl::StrCat(size > bytes.size() ? "truncated: " : "too long: ", "claims ", count,
                   " triangles (", size, " bytes) but has ", bytes.size(), " bytes"));
}

}  // namespace sightline
