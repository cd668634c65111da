// SPDX-License-Identifier: Apache-2.0
// Writers of part files for tests, and the table of all mesh formats that are read: a property of
// every reader is a loop over MeshFormats(). A new reader joins by a line there.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <sstream>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/part/mesh.h"

namespace sightline {

template <typename T>
std::string Bytes(const std::vector<T>& values) {
  std::string bytes(values.size() * sizeof(T), '\0');
  if (!values.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

inline std::string BinaryStl(const TriangleMesh& mesh,
                             const std::string& header = "made for a test") {
  std::string bytes = header;
  bytes.resize(80, ' ');
  bytes += Bytes<uint32_t>({static_cast<uint32_t>(mesh.triangles.size())});
  for (const auto& triangle : mesh.triangles) {
    bytes += Bytes<float>({0, 0, 0});
    for (uint32_t index : triangle) {
      const Eigen::Vector3f& p = mesh.positions_m[index];
      bytes += Bytes<float>({p.x(), p.y(), p.z()});
    }
    bytes += std::string(2, '\0');
  }
  return bytes;
}

inline std::string AsciiStl(const TriangleMesh& mesh) {
  std::ostringstream text;
  text.precision(9);
  text << "solid box made by hand\n";
  for (const auto& triangle : mesh.triangles) {
    text << " facet normal 0 0 0\n  outer loop\n";
    for (uint32_t index : triangle) {
      text << "   vertex " << mesh.positions_m[index].transpose() << "\n";
    }
    text << "  endloop\n endfacet\n";
  }
  text << "endsolid box made by hand\n";
  return text.str();
}

inline std::string Obj(const TriangleMesh& mesh) {
  std::ostringstream text;
  text.precision(9);
  text << "# comment\no box\n";
  for (const Eigen::Vector3f& p : mesh.positions_m) text << "v " << p.transpose() << "\n";
  text << "vn 0 0 1\nusemtl steel\n";
  for (const auto& t : mesh.triangles) {
    text << "f " << t[0] + 1 << "/1/1 " << t[1] + 1 << "//1 " << t[2] + 1 << "\n";
  }
  return text.str();
}

inline std::string Ply(const TriangleMesh& mesh, const std::string& format) {
  std::string bytes = "ply\nformat " + format + " 1.0\ncomment test\nelement vertex " +
                      std::to_string(mesh.positions_m.size()) +
                      "\nproperty uchar red\nproperty float x\nproperty float y\nproperty double "
                      "z\nelement face " +
                      std::to_string(mesh.triangles.size()) +
                      "\nproperty list uchar int vertex_indices\nproperty short flag\nend_header\n";
  if (format == "ascii") {
    std::ostringstream text;
    text.precision(9);
    for (const Eigen::Vector3f& p : mesh.positions_m) text << "7 " << p.transpose() << "\n";
    for (const auto& t : mesh.triangles) {
      text << "3 " << t[0] << " " << t[1] << " " << t[2] << " -1\n";
    }
    return bytes + text.str();
  }
  const auto number = [&](auto value) {
    std::string raw(sizeof(value), '\0');
    std::memcpy(raw.data(), &value, sizeof(value));
    if (format == "binary_big_endian") std::reverse(raw.begin(), raw.end());
    bytes += raw;
  };
  for (const Eigen::Vector3f& p : mesh.positions_m) {
    number(uint8_t{7});
    number(p.x());
    number(p.y());
    number(static_cast<double>(p.z()));
  }
  for (const auto& t : mesh.triangles) {
    number(uint8_t{3});
    for (uint32_t index : t) number(static_cast<int32_t>(index));
    number(int16_t{-1});
  }
  return bytes;
}

inline std::string Glb(std::string json, std::string binary) {
  json.resize((json.size() + 3) / 4 * 4, ' ');
  binary.resize((binary.size() + 3) / 4 * 4, '\0');
  std::string body = Bytes<uint32_t>({static_cast<uint32_t>(json.size())}) + "JSON" + json;
  if (!binary.empty()) {
    body +=
        Bytes<uint32_t>({static_cast<uint32_t>(binary.size())}) + std::string("BIN\0", 4) + binary;
  }
  return absl::StrCat("glTF", Bytes<uint32_t>({2, static_cast<uint32_t>(12 + body.size())}), body);
}

// One mesh in one primitive; the parts of its JSON can be exchanged.
struct GlbParts {
  std::string positions;  // bytes
  size_t vertex_count = 0;
  std::string indices;  // bytes; empty: not indexed
  size_t index_count = 0;
  int component_type = 5125;  // of the indices
  std::string primitive_extra;
  std::string nodes = R"([{"mesh": 0}])";
  std::string scene_nodes = "[0]";
  std::string root_extra;
  std::string position_accessor_extra;

  std::string ToBytes() const {
    std::string binary = positions;
    binary.resize((binary.size() + 3) / 4 * 4, '\0');
    const size_t index_offset = binary.size();
    binary += indices;
    std::string json = R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": )" +
                       scene_nodes + R"(}], "nodes": )" + nodes +
                       R"(, "buffers": [{"byteLength": )" + std::to_string(binary.size()) +
                       R"(}], "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": )" +
                       std::to_string(positions.size()) + "}";
    if (!indices.empty()) {
      json += R"(, {"buffer": 0, "byteOffset": )" + std::to_string(index_offset) +
              R"(, "byteLength": )" + std::to_string(indices.size()) + "}";
    }
    json +=
        R"(], "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": )" +
        std::to_string(vertex_count) + position_accessor_extra + "}";
    if (!indices.empty()) {
      json += R"(, {"bufferView": 1, "componentType": )" + std::to_string(component_type) +
              R"(, "type": "SCALAR", "count": )" + std::to_string(index_count) + "}";
    }
    json += R"(], "meshes": [{"primitives": [{"attributes": {"POSITION": 0})" +
            std::string(indices.empty() ? "" : R"(, "indices": 1)") + primitive_extra + "}]}]" +
            root_extra + "}";
    return Glb(json, binary);
  }
};

template <typename Index = uint32_t>
GlbParts GlbOf(const TriangleMesh& mesh, int component_type = 5125) {
  GlbParts parts;
  std::vector<float> positions;
  for (const Eigen::Vector3f& p : mesh.positions_m) {
    positions.insert(positions.end(), {p.x(), p.y(), p.z()});
  }
  std::vector<Index> indices;
  for (const auto& t : mesh.triangles) {
    for (uint32_t index : t) indices.push_back(static_cast<Index>(index));
  }
  parts.positions = Bytes(positions);
  parts.vertex_count = mesh.positions_m.size();
  parts.indices = Bytes(indices);
  parts.index_count = indices.size();
  parts.component_type = component_type;
  return parts;
}

// A glTF file with its buffer in it.
std::string GltfText(const TriangleMesh& mesh);

struct MeshFormat {
  const char* name;
  const char* extension;
  bool is_text;
  std::string (*write)(const TriangleMesh& mesh);
};
const std::vector<MeshFormat>& MeshFormats();

}  // namespace sightline
