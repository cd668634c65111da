// SPDX-License-Identifier: Apache-2.0
// Readers of single file formats, for LoadPart. Each takes the whole file in memory and never
// allocates more than a small multiple of its size, whatever counts the file claims. Each reads the
// file to its end: bytes that belong to nothing are an error.
//
// Only glTF is read by a library (tinygltf). STL, PLY and OBJ are read here: each is a page of
// code. Assimp, the usual library, silently repairs or drops degenerate faces, bad indices and data
// after a truncation; a metrology tool has to refuse such a file and name the place.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/status/stop_check.h"

namespace sightline {

// Geometry as it is in a file: file units, not welded. Every index is valid; positions may not be
// finite.
struct RawMesh {
  std::vector<Eigen::Vector3d> positions;
  // PLY only: nx, ny, nz of every vertex as they are in the file; empty if it has none.
  std::vector<Eigen::Vector3d> normals;
  std::vector<std::array<uint32_t, 3>> triangles;
  // Index into material_names of every triangle. Empty without materials.
  std::vector<uint16_t> triangle_material;
  std::vector<std::string> material_names;
  // The reader's choices where the file leaves something open, a sentence each.
  std::vector<std::string> remarks;

  // Gives all triangles added since the last call this material; "" for none.
  void SetMaterialOfNewTriangles(const std::string& name);

 private:
  std::map<std::string, uint16_t> material_of_name_;
};

// A larger file is refused; of glTF, all its buffers together.
inline constexpr uint64_t kMaxPartFileBytes = uint64_t{2} << 30;
// A mesh above this many triangles is refused.
inline constexpr size_t kMaxTriangles = 20'000'000;

// Limits on the JSON of a glTF file: bytes of JSON, and values in it. Parsed, a value takes
// some 200 bytes, whatever it says.
inline constexpr size_t kMaxGltfJsonBytes = size_t{64} << 20;
inline constexpr size_t kMaxGltfJsonValues = 2'000'000;
// Limit on the memory for a glTF file's materials, nodes, meshes and the like: an empty material of
// 3 bytes of JSON takes some 2.5 kB. Enough for 100 000 materials or 500 000 nodes.
inline constexpr size_t kMaxGltfElementBytes = size_t{256} << 20;

// Steps of a reader's loop between two calls of its StopCheck: some milliseconds.
inline constexpr size_t kStepsPerStopCheck = 1 << 16;

// Messages of errors are the reason only, without the file's name. INVALID_ARGUMENT, also for more
// JSON or elements than the limits above; or the error of `stop`.
absl::StatusOr<RawMesh> ReadGlb(std::string_view bytes, const StopCheck& stop);
// `bytes` are the JSON of the file at `path`, whose folder external buffers are read from.
absl::StatusOr<RawMesh> ReadGltfFile(std::string_view bytes, const std::string& path,
                                     const StopCheck& stop);
absl::StatusOr<RawMesh> ReadStl(std::string_view bytes, const StopCheck& stop);
absl::StatusOr<RawMesh> ReadPly(std::string_view bytes, const StopCheck& stop);
absl::StatusOr<RawMesh> ReadObj(std::string_view bytes, const StopCheck& stop);

// Reads words of a text, separated by white space; knows the line for messages. Lines end with LF,
// CR LF or CR alone. With `continued`, a backslash at the end of a line joins it with the next.
class TextScanner {
 public:
  explicit TextScanner(std::string_view text, bool continued = false)
      : text_(text), continued_(continued) {}

  // Next word, on whatever line; empty at the end.
  std::string_view Word();
  // Next word of the current line; empty at the end of the line.
  std::string_view WordInLine();
  // Skips the rest of the line; false at the end of the text. A comment is never joined with the
  // next line, because a path at its end ("C:\parts\") ends with a backslash.
  bool NextLine(bool of_comment = false);
  bool AtEnd() const { return position_ >= text_.size(); }
  size_t line() const { return line_; }
  size_t position() const { return position_; }

 private:
  // Bytes of the line end at a place: 0 if there is none.
  size_t LineEndAt(size_t at) const;
  // Bytes of a backslash and the line end it cancels, with blanks between them.
  size_t ContinuationAt(size_t at) const;

  std::string_view text_;
  bool continued_;
  size_t position_ = 0;
  size_t line_ = 1;
};

// At most 40 characters of a word, for messages.
std::string Excerpt(std::string_view word);

// Decimal point whatever the locale; the whole word must be the number. NaN and infinity parse.
bool ParseNumber(std::string_view word, double* value);
bool ParseInteger(std::string_view word, int64_t* value);

}  // namespace sightline
