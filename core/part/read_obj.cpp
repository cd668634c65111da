// SPDX-License-Identifier: Apache-2.0
// Wavefront OBJ: vertices, faces and the names of their materials; other names, groups, normals and
// texture coordinates are of no concern here, lines and points are no surface.
#include <algorithm>
#include <array>

#include "absl/strings/str_cat.h"
#include "core/part/mesh_readers.h"
#include "core/part/polygon.h"
#include "core/status/status_macros.h"
#include "core/text/text_encoding.h"

namespace sightline {

absl::StatusOr<RawMesh> ReadObj(std::string_view bytes, const StopCheck& stop) {
  SIGHTLINE_ASSIGN_OR_RETURN(const std::string_view text, WithoutByteOrderMark(bytes));
  static constexpr std::array<std::string_view, 17> kIgnored = {
      "vn", "vt",     "vp",     "o",     "g",        "s",        "mg",  "mtllib",    "l",
      "p",  "usemap", "maplib", "bevel", "c_interp", "d_interp", "lod", "shadow_obj"};
  static constexpr std::array<std::string_view, 5> kFreeForm = {"cstype", "deg", "curv", "curv2",
                                                                "surf"};
  RawMesh mesh;
  PolygonCutter cutter(stop);
  TextScanner scanner(WithoutEndMarks(text), /*continued=*/true);
  std::vector<uint32_t> corners;
  std::string material;
  const auto error = [&](const std::string& reason) {
    return absl::InvalidArgumentError(absl::StrCat("line ", scanner.line(), ": ", reason));
  };
  bool in_comment = false;
  // Empty at the end of the logical line and where a comment begins.
  const auto next_word = [&] {
    const std::string_view word = in_comment ? std::string_view() : scanner.WordInLine();
    in_comment = in_comment || word.starts_with('#');
    return in_comment ? std::string_view() : word;
  };
  do {
    if (scanner.line() % kStepsPerStopCheck == 0) {
      SIGHTLINE_RETURN_IF_ERROR(CheckStop(stop));
    }
    in_comment = false;
    const std::string_view keyword = next_word();
    if (keyword.empty()) continue;
    if (keyword == "v") {
      Eigen::Vector3d position;
      for (int axis = 0; axis < 3; ++axis) {
        const std::string_view word = next_word();
        if (word.empty()) return error("truncated: a vertex needs 3 coordinates");
        if (!ParseNumber(word, &position[axis])) {
          return error(absl::StrCat("\"", Excerpt(word), "\" is no coordinate"));
        }
      }
      // Behind them a weight, a colour, or both.
      size_t more = 0;
      for (std::string_view word = next_word(); !word.empty(); word = next_word()) {
        double ignored = 0;
        if (!ParseNumber(word, &ignored)) {
          return error(absl::StrCat("\"", Excerpt(word), "\" is no coordinate"));
        }
        if (++more > 4) break;
      }
      if (more == 2 || more > 4) {
        return error("a vertex has 3 coordinates, perhaps a weight and a colour, and nothing else");
      }
      mesh.positions.push_back(position);
    } else if (keyword == "f") {
      corners.clear();
      for (std::string_view word = next_word(); !word.empty(); word = next_word()) {
        int64_t index = 0;
        const bool good = word.find_first_not_of("+-0123456789/") == std::string_view::npos;
        if (!good || !ParseInteger(word.substr(0, word.find('/')), &index) || index == 0) {
          return error(absl::StrCat("\"", Excerpt(word), "\" is no vertex index"));
        }
        const int64_t count = static_cast<int64_t>(mesh.positions.size());
        const int64_t resolved = index > 0 ? index - 1 : count + index;
        // Forward references are refused too: no exporter writes them, a damaged file has them.
        if (resolved < 0 || resolved >= count) {
          return error(absl::StrCat("vertex index ", index, " is out of range, there are ", count,
                                    " vertices so far"));
        }
        corners.push_back(static_cast<uint32_t>(resolved));
        // One more than the cutter takes, so that it is the cutter that refuses.
        if (corners.size() > PolygonCutter::kMostCorners) break;
      }
      if (corners.size() < 3) return error("truncated: a face needs at least 3 vertices");
      if (absl::Status status = cutter.Add(corners, &mesh); !status.ok()) {
        return absl::IsInvalidArgument(status) ? error(std::string(status.message())) : status;
      }
    } else if (keyword == "usemtl") {
      mesh.SetMaterialOfNewTriangles(material);
      material = std::string(next_word());
    } else if (std::find(kFreeForm.begin(), kFreeForm.end(), keyword) != kFreeForm.end()) {
      return error(absl::StrCat("free-form geometry (\"", Excerpt(keyword),
                                "\") is not supported: export the part as triangles"));
    } else if (std::find(kIgnored.begin(), kIgnored.end(), keyword) == kIgnored.end()) {
      return error(absl::StrCat("unknown keyword \"", Excerpt(keyword), "\""));
    }
  } while (scanner.NextLine(in_comment));
  mesh.SetMaterialOfNewTriangles(material);
  return mesh;
}

}  // namespace sightline
