// SPDX-License-Identifier: Apache-2.0
// STL, binary and ASCII. Facet normals are ignored: the order of the corners says the same.
#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/part/mesh_readers.h"
#include "core/part/polygon.h"
#include "core/status/status_macros.h"
#include "core/text/text_encoding.h"

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
      SIGHTLINE_RETURN_IF_ERROR(CheckStop(stop));
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

// The text of an ASCII file: solids of facets of one loop each.
class AsciiStl {
 public:
  AsciiStl(std::string_view text, const StopCheck& stop)
      : scanner_(text), stop_(stop), cutter_(stop) {}

  absl::StatusOr<RawMesh> Read() {
    size_t words = 0;
    for (std::string word = Next(); !word.empty(); word = Next()) {
      if (++words % kStepsPerStopCheck == 0) {
        SIGHTLINE_RETURN_IF_ERROR(CheckStop(stop_));
      }
      SIGHTLINE_RETURN_IF_ERROR(Take(word));
    }
    if (place_ != Place::kOutside) return Error("truncated: the file ends before \"endsolid\"");
    return std::move(mesh_);
  }

 private:
  enum class Place { kOutside, kInSolid, kInFacet, kInLoop, kAfterLoop };

  absl::Status Error(const std::string& reason) const {
    return absl::InvalidArgumentError(absl::StrCat("line ", scanner_.line(), ": ", reason));
  }

  // The next word in lower case; "end solid" is "endsolid".
  std::string Next() {
    std::string word = pending_.empty() ? Lower(scanner_.Word()) : std::exchange(pending_, "");
    if (word == "end") word += Lower(scanner_.Word());
    return word;
  }

  // Goes from one place to another where a word is expected.
  absl::Status Go(Place from, Place to, const char* word) {
    if (place_ != from) return Error(absl::StrCat("\"", word, "\" where it does not belong"));
    place_ = to;
    return absl::OkStatus();
  }

  absl::Status Take(const std::string& word) {
    if (word == "vertex") return TakeVertex();
    if (word == "facet") {
      SIGHTLINE_RETURN_IF_ERROR(Go(Place::kInSolid, Place::kInFacet, "facet"));
      SkipNormal();
      return absl::OkStatus();
    }
    if (word == "outer") {
      if (Next() != "loop") return Error("\"loop\" expected after \"outer\"");
      loop_.clear();
      return Go(Place::kInFacet, Place::kInLoop, "outer loop");
    }
    if (word == "endloop") return TakeLoop();
    if (word == "endfacet") return Go(Place::kAfterLoop, Place::kInSolid, "endfacet");
    if (word == "solid") return TakeName(Go(Place::kOutside, Place::kInSolid, "solid"));
    if (word == "endsolid") return TakeName(Go(Place::kInSolid, Place::kOutside, "endsolid"));
    return Error(absl::StrCat("unknown word \"", Excerpt(word), "\""));
  }

  // "normal" and three numbers, which may be anything: exporters write nan(ind) there.
  void SkipNormal() {
    pending_ = Lower(scanner_.WordInLine());
    if (pending_ != "normal") return;
    pending_.clear();
    for (int axis = 0; axis < 3 && pending_ != "outer"; ++axis) {
      pending_ = Lower(scanner_.WordInLine());
    }
    if (pending_ != "outer") pending_.clear();
  }

  // The rest of the line is the name of the solid, and must not be what follows it.
  absl::Status TakeName(absl::Status status) {
    if (!status.ok()) return status;
    for (std::string word = Lower(scanner_.WordInLine()); !word.empty();
         word = Lower(scanner_.WordInLine())) {
      if (word == "vertex") return Error("a facet on the line of the solid's name");
    }
    return absl::OkStatus();
  }

  absl::Status TakeVertex() {
    if (place_ != Place::kInLoop) return Error("\"vertex\" outside a loop");
    Eigen::Vector3d position;
    for (int axis = 0; axis < 3; ++axis) {
      const std::string_view number = scanner_.WordInLine();
      if (!ParseNumber(number, &position[axis])) {
        return Error(absl::StrCat("\"", Excerpt(number), "\" is no coordinate"));
      }
    }
    loop_.push_back(static_cast<uint32_t>(mesh_.positions.size()));
    mesh_.positions.push_back(position);
    return absl::OkStatus();
  }

  absl::Status TakeLoop() {
    if (place_ != Place::kInLoop || loop_.size() < 3) {
      return Error("a loop needs at least 3 vertices");
    }
    place_ = Place::kAfterLoop;
    absl::Status status = cutter_.Add(loop_, &mesh_);
    return absl::IsInvalidArgument(status) ? Error(std::string(status.message())) : status;
  }

  TextScanner scanner_;
  const StopCheck& stop_;
  PolygonCutter cutter_;
  RawMesh mesh_;
  std::vector<uint32_t> loop_;
  std::string pending_;  // a word that was read too early
  Place place_ = Place::kOutside;
};

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
  const absl::StatusOr<std::string_view> unmarked = WithoutByteOrderMark(bytes);
  const std::string_view text = WithoutEndMarks(unmarked.ok() ? *unmarked : std::string_view());
  size_t start = 0;
  while (start < text.size() && std::isspace(static_cast<unsigned char>(text[start]))) ++start;
  if (Lower(text.substr(start, 5)) == "solid") {
    const size_t zero = text.find('\0');
    if (zero == std::string_view::npos) return AsciiStl(text, stop).Read();
    if (text.substr(0, zero).find("facet") != std::string_view::npos) {
      return absl::InvalidArgumentError(
          absl::StrCat("byte ", zero, " of its text is NUL: damaged, or no text"));
    }
  }
  if (bytes.size() < kHeader) {
    return absl::InvalidArgumentError(
        absl::StrCat("is no STL file: ", bytes.size(), " bytes, no \"solid\" at the start"));
  }
  // The size is not that of a binary file, so a mark decides.
  if (!unmarked.ok()) return unmarked.status();
  const uint64_t count = LittleEndian32(bytes, 80);
  const uint64_t size = kHeader + kFacet * count;
  return absl::InvalidArgumentError(
      absl::StrCat(size > bytes.size() ? "truncated: " : "too long: ", "claims ", count,
                   " triangles (", size, " bytes) but has ", bytes.size(), " bytes"));
}

}  // namespace sightline
