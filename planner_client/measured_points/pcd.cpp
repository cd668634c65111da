// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/part/mesh_readers.h"
#include "core/status/status_macros.h"
#include "planner_client/measured_points/point_formats.h"

namespace sightline {
namespace {

constexpr std::array<const char*, 6> kPcdFields = {"x",        "y",        "z",
                                                   "normal_x", "normal_y", "normal_z"};

struct PcdField {
  size_t offset = 0;  // bytes within a point
  size_t word = 0;    // index of its first value within a line of text
  size_t size = 0;    // bytes of a value; 0: the file has no such field
};

struct PcdHeader {
  std::array<PcdField, 6> fields;  // in the order of kPcdFields
  size_t point_bytes = 0, point_words = 0;
  uint64_t points = 0;
  std::string data;
  bool HasNormals() const { return fields[3].size > 0 && fields[4].size > 0 && fields[5].size > 0; }
};

absl::Status PcdError(const std::string& reason) {
  return absl::InvalidArgumentError(absl::StrCat("PCD: ", reason));
}

// The values of one header line, by its keyword.
using PcdLines = std::map<std::string, std::vector<std::string>>;

absl::StatusOr<PcdLines> ReadPcdLines(std::string_view bytes, size_t* body) {
  constexpr size_t kMostLines = 100;
  PcdLines lines;
  size_t position = 0;
  for (size_t line = 0; line < kMostLines && position < bytes.size(); ++line) {
    const size_t end = bytes.find('\n', position);
    if (end == std::string_view::npos) break;
    std::string_view text = bytes.substr(position, end - position);
    if (text.ends_with('\r')) text.remove_suffix(1);
    position = end + 1;
    if (text.starts_with('#')) continue;
    std::vector<std::string> words =
        absl::StrSplit(absl::string_view(text.data(), text.size()), ' ', absl::SkipEmpty());
    if (words.empty()) continue;
    const std::string keyword = words.front();
    words.erase(words.begin());
    lines[keyword] = std::move(words);
    if (keyword != "DATA") continue;
    *body = position;
    return lines;
  }
  return PcdError("its header has no line DATA");
}

absl::StatusOr<PcdHeader> ParsePcdHeader(PcdLines& lines) {
  PcdHeader header;
  const std::vector<std::string>& names = lines["FIELDS"];
  const std::vector<std::string>&sizes = lines["SIZE"], &types = lines["TYPE"],
        &counts = lines["COUNT"];
  if (names.empty() || sizes.size() != names.size() || types.size() != names.size() ||
      (!counts.empty() && counts.size() != names.size())) {
    return PcdError("FIELDS, SIZE, TYPE and COUNT differ in length");
  }
  for (size_t f = 0; f < names.size(); ++f) {
    int64_t size = 0, count = 1;
    if (!ParseInteger(sizes[f], &size) || size < 1 || size > 8 ||
        (!counts.empty() && (!ParseInteger(counts[f], &count) || count < 1 || count > 4096))) {
      return PcdError(absl::StrCat("SIZE or COUNT of field ", Excerpt(names[f]), " is wrong"));
    }
    for (size_t k = 0; k < kPcdFields.size(); ++k) {
      if (names[f] != kPcdFields[k]) continue;
      if (types[f] != "F" || (size != 4 && size != 8) || count != 1) {
        return PcdError(absl::StrCat("field ", kPcdFields[k], " must be one number of type F"));
      }
      header.fields[k] = {header.point_bytes, header.point_words, static_cast<size_t>(size)};
    }
    header.point_bytes += static_cast<size_t>(size * count);
    header.point_words += static_cast<size_t>(count);
  }
  for (size_t k = 0; k < 3; ++k) {
    if (header.fields[k].size == 0) return PcdError(absl::StrCat("has no field ", kPcdFields[k]));
  }
  int64_t points = 0;
  if (lines["POINTS"].size() != 1 || !ParseInteger(lines["POINTS"][0], &points) || points < 0) {
    return PcdError("its header has no number of POINTS");
  }
  header.points = static_cast<uint64_t>(points);
  header.data = lines["DATA"].empty() ? "" : lines["DATA"][0];
  return header;
}

// A value of 4 or 8 bytes, little endian.
double PcdNumber(const char* bytes, size_t size) {
  static_assert(std::endian::native == std::endian::little);
  if (size == 8) {
    double value = 0;
    std::memcpy(&value, bytes, 8);
    return value;
  }
  float value = 0;
  std::memcpy(&value, bytes, 4);
  return static_cast<double>(value);
}

void AddPcdPoint(const std::array<double, 6>& values, bool normals, MeasuredPoints& points) {
  const Eigen::Vector3d position(values[0], values[1], values[2]);
  if (!position.allFinite()) {
    ++points.without_value;
    return;
  }
  points.cloud.positions_m.push_back(position);
  if (!normals) return;
  const Eigen::Vector3d normal(values[3], values[4], values[5]);
  const bool usable = normal.allFinite() && normal.norm() > 0;
  points.cloud.normals.push_back(usable ? normal.normalized() : Eigen::Vector3d::Zero().eval());
}

// LZF (Marc Lehmann): literal runs and back references. The output must come out at that length.
absl::StatusOr<std::string> DecompressLzf(std::string_view in, size_t length) {
  std::string out;
  out.reserve(length);
  const auto byte = [&](size_t i) { return static_cast<size_t>(static_cast<uint8_t>(in[i])); };
  const absl::Status damaged = PcdError("its compressed data are damaged");
  for (size_t i = 0; i < in.size();) {
    const size_t control = byte(i++);
    if (control < 32) {
      const size_t count = control + 1;
      if (count > in.size() - i || count > length - out.size()) return damaged;
      out.append(in.substr(i, count));
      i += count;
      continue;
    }
    size_t count = control >> 5;
    if (count == 7) {
      if (i >= in.size()) return damaged;
      count += byte(i++);
    }
    count += 2;
    if (i >= in.size()) return damaged;
    const size_t back = ((control & 31) << 8 | byte(i++)) + 1;
    if (back > out.size() || count > length - out.size()) return damaged;
    for (size_t from = out.size() - back; count > 0; --count) out += out[from++];
  }
  if (out.size() != length) return damaged;
  return out;
}

absl::Status ReadPcdText(std::string_view body, const PcdHeader& header, MeasuredPoints& points) {
  TextScanner scanner(body);
  for (uint64_t p = 0; p < header.points; ++p) {
    std::array<double, 6> values{};
    for (size_t word = 0; word < header.point_words; ++word) {
      const std::string_view text = scanner.Word();
      if (text.empty()) {
        return PcdError(absl::StrCat("ends after ", p, " of ", header.points, " points"));
      }
      for (size_t k = 0; k < values.size(); ++k) {
        if (header.fields[k].size == 0 || header.fields[k].word != word) continue;
        if (!ParseNumber(text, &values[k])) {
          return PcdError(absl::StrCat("point ", p, ": ", Excerpt(text), " is no number"));
        }
      }
    }
    AddPcdPoint(values, header.HasNormals(), points);
  }
  return absl::OkStatus();
}

// `by_field`: values of one field follow one another, as in compressed files.
absl::Status ReadPcdBinary(std::string_view body, const PcdHeader& header, bool by_field,
                           MeasuredPoints& points) {
  if (body.size() / header.point_bytes < header.points) {
    return PcdError(absl::StrCat("has ", body.size(), " bytes of data for ", header.points,
                                 " points of ", header.point_bytes, " bytes"));
  }
  for (size_t p = 0; p < header.points; ++p) {
    std::array<double, 6> values{};
    for (size_t k = 0; k < values.size(); ++k) {
      const PcdField& field = header.fields[k];
      if (field.size == 0) continue;
      const size_t at = by_field ? field.offset * header.points + field.size * p
                                 : header.point_bytes * p + field.offset;
      values[k] = PcdNumber(body.data() + at, field.size);
    }
    AddPcdPoint(values, header.HasNormals(), points);
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<MeasuredPoints> ReadPcd(std::string_view bytes, int64_t most_points) {
  size_t begin = 0;
  SIGHTLINE_ASSIGN_OR_RETURN(auto lines, ReadPcdLines(bytes, &begin));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto header, ParsePcdHeader(lines));
  if (header.points > static_cast<uint64_t>(most_points)) {
    return PcdError(absl::StrCat("has ", header.points, " points, at most ", most_points,
                                 " can be used: thin them out evenly"));
  }
  const std::string_view body = bytes.substr(begin);
  MeasuredPoints points;
  absl::Status read;
  if (header.data == "ascii") {
    read = ReadPcdText(body, header, points);
  } else if (header.data == "binary") {
    read = ReadPcdBinary(body, header, false, points);
  } else if (header.data == "binary_compressed") {
    uint32_t packed = 0, unpacked = 0;
    if (body.size() < 8) return PcdError("its compressed data are damaged");
    std::memcpy(&packed, body.data(), 4);
    std::memcpy(&unpacked, body.data() + 4, 4);
    if (packed > body.size() - 8 || unpacked != header.points * header.point_bytes) {
      return PcdError("its compressed data are damaged");
    }
    SIGHTLINE_ASSIGN_OR_RETURN(const auto whole, DecompressLzf(body.substr(8, packed), unpacked));
    read = ReadPcdBinary(whole, header, true, points);
  } else {
    read = PcdError(absl::StrCat("DATA is ", Excerpt(header.data),
                                 ", must be ascii, binary or binary_compressed"));
  }
  if (!read.ok()) return read;
  return points;
}

}  // namespace sightline
