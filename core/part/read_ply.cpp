// SPDX-License-Identifier: Apache-2.0
// PLY: ASCII, binary little- and big-endian. Elements other than vertices and faces are stepped
// over; so are their other properties. Materials are read from files like those that EncodePly
// writes: an element `material` before the faces with a list `name` of bytes, and a property
// `material_index` of the faces. Bytes behind the last element of the header are an error:
// the header counts wrongly, or the file is two.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <optional>

#include "absl/strings/str_cat.h"
#include "core/part/mesh_readers.h"
#include "core/part/polygon.h"
#include "core/status/status_macros.h"
#include "core/text/text_encoding.h"

namespace sightline {
namespace {

enum class Number { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };
enum class Encoding { kAscii, kLittleEndian, kBigEndian };

struct Property {
  std::string name;
  Number type = Number::kFloat;
  std::optional<Number> count_type;  // of a list
};

struct Element {
  std::string name;
  uint64_t count = 0;
  std::vector<Property> properties;
};

std::optional<Number> NumberNamed(std::string_view name) {
  if (name == "char" || name == "int8") return Number::kInt8;
  if (name == "uchar" || name == "uint8") return Number::kUint8;
  if (name == "short" || name == "int16") return Number::kInt16;
  if (name == "ushort" || name == "uint16") return Number::kUint16;
  if (name == "int" || name == "int32") return Number::kInt32;
  if (name == "uint" || name == "uint32") return Number::kUint32;
  if (name == "float" || name == "float32") return Number::kFloat;
  if (name == "double" || name == "float64") return Number::kDouble;
  return std::nullopt;
}

size_t SizeOf(Number type) {
  switch (type) {
    case Number::kInt8:
    case Number::kUint8:
      return 1;
    case Number::kInt16:
    case Number::kUint16:
      return 2;
    case Number::kInt32:
    case Number::kUint32:
    case Number::kFloat:
      return 4;
    case Number::kDouble:
      return 8;
  }
  return 1;
}

const char* NameOf(Number type) {
  switch (type) {
    case Number::kInt8:
      return "char";
    case Number::kUint8:
      return "uchar";
    case Number::kInt16:
      return "short";
    case Number::kUint16:
      return "ushort";
    case Number::kInt32:
      return "int";
    case Number::kUint32:
      return "uint";
    case Number::kFloat:
      return "float";
    case Number::kDouble:
      return "double";
  }
  return "";
}

// Whether a number of an ASCII file is one that its property can have, after rounding of a float.
// Infinity is a value of float and double, but not for digits that are too large for them.
bool Fits(Number type, std::string_view word, double value) {
  const auto whole_in = [value](double least, double most) {
    return value >= least && value <= most && value == std::trunc(value);
  };
  // Half a step above the largest float.
  constexpr double kFloatEnd = 0x1.ffffffp127;
  switch (type) {
    case Number::kInt8:
      return whole_in(-128, 127);
    case Number::kUint8:
      return whole_in(0, 255);
    case Number::kInt16:
      return whole_in(-32768, 32767);
    case Number::kUint16:
      return whole_in(0, 65535);
    case Number::kInt32:
      return whole_in(-2147483648.0, 2147483647.0);
    case Number::kUint32:
      return whole_in(0, 4294967295.0);
    case Number::kFloat:
    case Number::kDouble:
      break;
  }
  if (std::isnan(value)) return true;
  if (std::isinf(value)) return word.find_first_of("0123456789") == word.npos;
  return type == Number::kDouble || std::abs(value) < kFloatEnd;
}

// Reads the numbers after the header one by one.
class PlyBody {
 public:
  // `first_line`: that of the file with which the data begins.
  PlyBody(std::string_view bytes, Encoding encoding, size_t first_line)
      : bytes_(bytes), scanner_(bytes), encoding_(encoding), first_line_(first_line) {}

  // False: the data ends here, is no number, or is none of this type (see `misfit`).
  bool Read(Number type, double* value) {
    if (encoding_ == Encoding::kAscii) {
      const std::string_view word = scanner_.Word();
      if (word.empty()) return false;
      if (!ParseNumber(word, value)) {
        misfit_ = absl::StrCat("\"", Excerpt(word), "\" is no number");
        return false;
      }
      if (Fits(type, word, *value)) return true;
      misfit_ = absl::StrCat(Excerpt(word), " is no value of type ", NameOf(type));
      return false;
    }
    const size_t size = SizeOf(type);
    if (bytes_.size() - position_ < size) return false;
    uint64_t word = 0;
    for (size_t i = 0; i < size; ++i) {
      const size_t at = encoding_ == Encoding::kBigEndian ? i : size - 1 - i;
      word = word << 8 | static_cast<unsigned char>(bytes_[position_ + at]);
    }
    position_ += size;
    switch (type) {
      case Number::kInt8:
        *value = static_cast<int8_t>(word);
        break;
      case Number::kInt16:
        *value = static_cast<int16_t>(word);
        break;
      case Number::kInt32:
        *value = static_cast<int32_t>(word);
        break;
      case Number::kUint8:
      case Number::kUint16:
      case Number::kUint32:
        *value = static_cast<double>(word);
        break;
      case Number::kFloat:
        *value = std::bit_cast<float>(static_cast<uint32_t>(word));
        break;
      case Number::kDouble:
        *value = std::bit_cast<double>(word);
        break;
    }
    return true;
  }

  // Reason why the last text read is no value of its type; empty at the end.
  const std::string& misfit() const { return misfit_; }

  // Line of the file with the number that was read last, counted from 1; 0 of binary data.
  size_t line() const {
    return encoding_ == Encoding::kAscii ? first_line_ + scanner_.line() - 1 : 0;
  }

  // Whether the element's line has no more numbers; always true of binary data.
  bool AtLineEnd() { return encoding_ != Encoding::kAscii || scanner_.WordInLine().empty(); }

  // Bytes behind the last element that are more than white space.
  size_t BytesLeftOver() {
    if (encoding_ == Encoding::kAscii) {
      const size_t word = scanner_.Word().size();
      return word == 0 ? 0 : word + bytes_.size() - scanner_.position();
    }
    // Some writers end the file with a line end. Padding cannot be told from elements of zeros.
    const std::string_view left = bytes_.substr(position_);
    return left == "\n" || left == "\r\n" ? 0 : left.size();
  }

  // A count claimed by the file is believed only as far as that many bytes are left.
  size_t Left() const {
    return encoding_ == Encoding::kAscii ? bytes_.size() - scanner_.position()
                                         : bytes_.size() - position_;
  }

 private:
  std::string_view bytes_;
  TextScanner scanner_;
  Encoding encoding_;
  size_t first_line_;
  size_t position_ = 0;
  std::string misfit_;
};

}  // namespace

absl::StatusOr<RawMesh> ReadPly(std::string_view file, const StopCheck& stop) {
  SIGHTLINE_ASSIGN_OR_RETURN(std::string_view bytes, WithoutByteOrderMark(file));
  TextScanner header(bytes);
  const auto header_error = [&](const std::string& reason) {
    return absl::InvalidArgumentError(absl::StrCat("line ", header.line(), ": ", reason));
  };
  if (header.WordInLine() != "ply") return absl::InvalidArgumentError("is no PLY file");
  std::optional<Encoding> encoding;
  std::vector<Element> elements;
  bool ended = false;
  while (!ended && header.NextLine()) {
    const std::string_view keyword = header.WordInLine();
    if (keyword.empty() || keyword == "comment" || keyword == "obj_info") continue;
    if (keyword == "end_header") {
      ended = true;
    } else if (keyword == "format") {
      const std::string_view name = header.WordInLine();
      if (name == "ascii") encoding = Encoding::kAscii;
      if (name == "binary_little_endian") encoding = Encoding::kLittleEndian;
      if (name == "binary_big_endian") encoding = Encoding::kBigEndian;
      if (!encoding) return header_error("unknown format");
      header.WordInLine();  // the version
    } else if (keyword == "element") {
      Element element;
      element.name = header.WordInLine();
      int64_t count = -1;
      if (!ParseInteger(header.WordInLine(), &count) || count < 0) {
        return header_error("an element needs a name and a count");
      }
      element.count = static_cast<uint64_t>(count);
      elements.push_back(std::move(element));
    } else if (keyword == "property") {
      if (elements.empty()) return header_error("a property before the first element");
      Property property;
      std::string_view type = header.WordInLine();
      if (type == "list") {
        property.count_type = NumberNamed(header.WordInLine());
        if (!property.count_type || *property.count_type >= Number::kFloat) {
          return header_error("a list needs an integer type for its count");
        }
        type = header.WordInLine();
      }
      const std::optional<Number> number = NumberNamed(type);
      if (!number) return header_error(absl::StrCat("unknown type \"", Excerpt(type), "\""));
      property.type = *number;
      property.name = header.WordInLine();
      elements.back().properties.push_back(std::move(property));
    } else {
      return header_error(absl::StrCat("unknown keyword \"", Excerpt(keyword), "\""));
    }
    if (!header.WordInLine().empty()) {
      return header_error(absl::StrCat("more words than \"", Excerpt(keyword), "\" has"));
    }
  }
  if (!ended) return absl::InvalidArgumentError("truncated: the header does not end");
  if (!encoding) return absl::InvalidArgumentError("the header has no format");
  // If lines end with CR alone, LF is the first byte of the data.
  const bool cr_alone = bytes.starts_with("ply\r") && !bytes.starts_with("ply\r\n");
  const size_t header_end = header.position();
  if (!header.NextLine()) return absl::InvalidArgumentError("truncated: no data after the header");
  std::string_view data = bytes.substr(cr_alone ? header_end + 1 : header.position());
  if (*encoding == Encoding::kAscii) data = WithoutEndMarks(data);

  PlyBody body(data, *encoding, header.line());
  RawMesh mesh;
  PolygonCutter cutter(stop);
  std::vector<uint32_t> corners;
  bool vertices_read = false;
  std::vector<std::string> material_names;
  for (const Element& element : elements) {
    // An error at the number that was read last, in element `i` (counted from 0).
    const auto wrong = [&](uint64_t i, const std::string& reason) {
      return absl::InvalidArgumentError(
          absl::StrCat(body.line() > 0 ? absl::StrCat("line ", body.line(), ": ") : "",
                       Excerpt(element.name), " ", i, " ", reason));
    };
    const auto unreadable = [&](uint64_t i) {
      if (!body.misfit().empty())
        return wrong(i, absl::StrCat("has a wrong value: ", body.misfit()));
      return absl::InvalidArgumentError(absl::StrCat(
          "truncated: the header counts ", element.count, " elements \"", Excerpt(element.name),
          "\", the data ends within or before that of index ", i));
    };
    const bool is_vertex = element.name == "vertex", is_face = element.name == "face";
    if (element.name == "tristrips") {
      return absl::InvalidArgumentError("triangle strips are not supported: export faces");
    }
    std::array<int, 3> axis_of = {-1, -1, -1}, normal_axis_of = {-1, -1, -1};
    int list_of_face = -1, material_of_face = -1;
    const bool is_material = element.name == "material";
    for (size_t k = 0; k < element.properties.size(); ++k) {
      const Property& property = element.properties[k];
      for (int axis = 0; axis < 3; ++axis) {
        if (!property.count_type && property.name == std::string(1, "xyz"[axis])) {
          if (is_vertex && axis_of[axis] >= 0) {
            return absl::InvalidArgumentError(
                absl::StrCat("vertices have two properties \"", property.name, "\""));
          }
          axis_of[axis] = static_cast<int>(k);
        }
        if (!property.count_type && property.name == std::string({'n', "xyz"[axis]})) {
          normal_axis_of[axis] = static_cast<int>(k);
        }
      }
      if (is_face && !property.count_type && property.name == "material_index" &&
          property.type < Number::kFloat && !material_names.empty()) {
        material_of_face = static_cast<int>(k);
      }
      if (property.count_type &&
          (property.name == "vertex_indices" || property.name == "vertex_index")) {
        if (is_face && list_of_face >= 0) {
          return absl::InvalidArgumentError(
              "faces have two lists of vertices, vertex_indices and vertex_index");
        }
        list_of_face = static_cast<int>(k);
      }
    }
    if (is_vertex && std::count(axis_of.begin(), axis_of.end(), -1) > 0) {
      return absl::InvalidArgumentError("vertices have no x, y and z");
    }
    const bool has_normals =
        is_vertex && std::count(normal_axis_of.begin(), normal_axis_of.end(), -1) == 0;
    if (is_face && list_of_face < 0) {
      return absl::InvalidArgumentError("faces have no list vertex_indices");
    }
    if (is_face && !vertices_read) {
      return absl::InvalidArgumentError("faces come before vertices");
    }
    // An element takes a byte at least; without this a huge count of nothing would never end.
    if (element.properties.empty() && element.count > 0) {
      return absl::InvalidArgumentError(
          absl::StrCat("element \"", Excerpt(element.name), "\" has no properties"));
    }
    if (element.count > body.Left()) {
      return absl::InvalidArgumentError(absl::StrCat("truncated: the header counts ", element.count,
                                                     " elements \"", Excerpt(element.name), "\", ",
                                                     body.Left(), " bytes are left for them"));
    }
    for (uint64_t i = 0; i < element.count; ++i) {
      if (i % kStepsPerStopCheck == 0) {
        SIGHTLINE_RETURN_IF_ERROR(CheckStop(stop));
      }
      Eigen::Vector3d position = Eigen::Vector3d::Zero(), normal = Eigen::Vector3d::Zero();
      size_t first_line = 0;  // with a number of this element
      double material = -1;   // of a face
      if (is_material) material_names.emplace_back();
      for (size_t k = 0; k < element.properties.size(); ++k) {
        const Property& property = element.properties[k];
        double value = 0;
        if (!property.count_type) {
          if (!body.Read(property.type, &value)) return unreadable(i);
          if (first_line == 0) first_line = body.line();
          for (int axis = 0; axis < 3; ++axis) {
            if (axis_of[axis] == static_cast<int>(k)) position[axis] = value;
            if (normal_axis_of[axis] == static_cast<int>(k)) normal[axis] = value;
          }
          if (material_of_face == static_cast<int>(k)) material = value;
          continue;
        }
        double count = 0;
        if (!body.Read(*property.count_type, &count)) return unreadable(i);
        if (first_line == 0) first_line = body.line();
        if (!(count >= 0)) {
          return wrong(i, absl::StrCat("has a list of ", count, " values, must be 0 or more"));
        }
        if (count > static_cast<double>(body.Left())) {
          return wrong(i, absl::StrCat("is truncated or damaged: a list claims ", count,
                                       " values, ", body.Left(), " bytes are left"));
        }
        const bool is_outline = is_face && static_cast<int>(k) == list_of_face;
        const bool is_name =
            is_material && property.name == "name" && property.type == Number::kUint8;
        if (is_outline && count < 3) {
          return wrong(i, absl::StrCat("has ", count, " vertices, needs at least 3"));
        }
        if (is_outline && count > PolygonCutter::kMostCorners) {
          return wrong(i, absl::StrCat("has ", static_cast<uint64_t>(count), " corners, at most ",
                                       PolygonCutter::kMostCorners, " can be cut into triangles"));
        }
        corners.clear();
        for (uint64_t n = 0; n < static_cast<uint64_t>(count); ++n) {
          double index = 0;
          if (!body.Read(property.type, &index)) return unreadable(i);
          if (is_name) material_names.back() += static_cast<char>(static_cast<uint8_t>(index));
          if (!is_outline) continue;
          if (!(index >= 0 && index < static_cast<double>(mesh.positions.size())) ||
              index != static_cast<double>(static_cast<uint32_t>(index))) {
            return wrong(i, absl::StrCat("has vertex index ", index, ", there are ",
                                         mesh.positions.size(), " vertices"));
          }
          corners.push_back(static_cast<uint32_t>(index));
        }
        if (absl::Status status = cutter.Add(corners, &mesh); !status.ok()) {
          if (!absl::IsInvalidArgument(status)) return status;
          return wrong(i, absl::StrCat("cannot be cut: ", status.message()));
        }
      }
      // A line with too few numbers takes those of the next one.
      if (const size_t last_line = body.line(); !body.AtLineEnd()) {
        return first_line == last_line
                   ? wrong(i, "has more numbers on its line than the header has properties")
                   : absl::InvalidArgumentError(absl::StrCat(
                         "line ", first_line, ": ", Excerpt(element.name), " ", i,
                         " has fewer numbers on its line than the header has properties, and line ",
                         last_line, " has more"));
      }
      if (material_of_face >= 0) {
        if (!(material >= 0 && material < static_cast<double>(material_names.size()))) {
          return wrong(i, absl::StrCat("has material_index ", material, ", there are ",
                                       material_names.size(), " materials"));
        }
        mesh.SetMaterialOfNewTriangles(material_names[static_cast<size_t>(material)]);
      }
      if (is_vertex) mesh.positions.push_back(position);
      if (has_normals) mesh.normals.push_back(normal);
    }
    vertices_read = vertices_read || is_vertex;
  }
  if (const size_t left = body.BytesLeftOver(); left > 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("too long: ", left,
                     " bytes are left behind the last of the elements that its header counts"));
  }
  return mesh;
}

}  // namespace sightline
