// SPDX-License-Identifier: Apache-2.0
#include "tools/step_import/glb_writer.h"

#include <tiny_gltf.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <limits>
#include <stdexcept>

namespace sightline {
namespace {

template <typename T>
void Append(std::vector<unsigned char>& bytes, T value) {
  std::array<unsigned char, sizeof(T)> raw;
  std::memcpy(raw.data(), &value, sizeof(T));
  bytes.insert(bytes.end(), raw.begin(), raw.end());
}

int AddView(tinygltf::Model& model, std::size_t offset, int target) {
  tinygltf::BufferView view;
  view.buffer = 0;
  view.byteOffset = offset;
  view.byteLength = model.buffers[0].data.size() - offset;
  view.target = target;
  model.bufferViews.push_back(view);
  // Every accessor starts on a multiple of four bytes.
  while (model.buffers[0].data.size() % 4 != 0) model.buffers[0].data.push_back(0);
  return static_cast<int>(model.bufferViews.size() - 1);
}

int AddPositions(tinygltf::Model& model, const ShapeMesh& mesh) {
  tinygltf::Accessor accessor;
  accessor.minValues.assign(3, std::numeric_limits<double>::max());
  accessor.maxValues.assign(3, std::numeric_limits<double>::lowest());
  std::vector<unsigned char>& bytes = model.buffers[0].data;
  const std::size_t offset = bytes.size();
  for (const auto& p_mm : mesh.positions_mm) {
    for (std::size_t k = 0; k < 3; ++k) {
      const float value_m = static_cast<float>((p_mm[k] - mesh.origin_mm[k]) * 1e-3);
      Append(bytes, value_m);
      accessor.minValues[k] = std::min<double>(accessor.minValues[k], value_m);
      accessor.maxValues[k] = std::max<double>(accessor.maxValues[k], value_m);
    }
  }
  accessor.bufferView = AddView(model, offset, TINYGLTF_TARGET_ARRAY_BUFFER);
  accessor.componentType = TINYGLTF_COMPONENT_TYPE_FLOAT;
  accessor.type = TINYGLTF_TYPE_VEC3;
  accessor.count = mesh.positions_mm.size();
  model.accessors.push_back(accessor);
  return static_cast<int>(model.accessors.size() - 1);
}

// Triangles of one material.
int AddIndices(tinygltf::Model& model, const ShapeMesh& mesh, std::size_t material) {
  // 65535 is the primitive restart value of 16-bit indices and may not be used as an index.
  const bool narrow = mesh.positions_mm.size() <= 65535;
  std::vector<unsigned char>& bytes = model.buffers[0].data;
  const std::size_t offset = bytes.size();
  std::size_t count = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (!mesh.triangle_material.empty() && mesh.triangle_material[t] != material) continue;
    count += 3;
    for (const std::uint32_t index : mesh.triangles[t]) {
      if (narrow) {
        Append(bytes, static_cast<std::uint16_t>(index));
      } else {
        Append(bytes, index);
      }
    }
  }
  tinygltf::Accessor accessor;
  accessor.bufferView = AddView(model, offset, TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER);
  accessor.componentType =
      narrow ? TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT : TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
  accessor.type = TINYGLTF_TYPE_SCALAR;
  accessor.count = count;
  model.accessors.push_back(accessor);
  return static_cast<int>(model.accessors.size() - 1);
}

}  // namespace

void WriteGlb(const std::vector<ShapeMesh>& meshes, const GlbDescription& description,
              const std::filesystem::path& file) {
  tinygltf::Model model;
  model.asset.version = "2.0";
  model.asset.generator = description.generator;
  if (!description.extras.empty()) {
    tinygltf::Value::Object extras;
    for (const auto& [key, value] : description.extras) {
      if (const double* number = std::get_if<double>(&value)) {
        extras.emplace(key, tinygltf::Value(*number));
      } else {
        extras.emplace(key, tinygltf::Value(std::get<std::string>(value)));
      }
    }
    model.asset.extras = tinygltf::Value(extras);
  }
  model.buffers.resize(1);
  tinygltf::Scene scene;
  for (const ShapeMesh& mesh : meshes) {
    if (mesh.triangles.empty()) throw std::invalid_argument(mesh.name + ": no triangles to write");
    for (const auto& triangle : mesh.triangles) {
      for (const std::uint32_t index : triangle) {
        if (index >= mesh.positions_mm.size()) {
          throw std::invalid_argument(mesh.name + ": a triangle index points past the positions");
        }
      }
    }
    if (!mesh.triangle_material.empty() && mesh.triangle_material.size() != mesh.triangles.size()) {
      throw std::invalid_argument(mesh.name + ": not every triangle has a material");
    }
    tinygltf::Mesh gltf_mesh;
    gltf_mesh.name = mesh.name;
    const int positions = AddPositions(model, mesh);
    for (std::size_t m = 0; m < std::max<std::size_t>(mesh.material_names.size(), 1); ++m) {
      tinygltf::Primitive primitive;
      primitive.mode = TINYGLTF_MODE_TRIANGLES;
      primitive.attributes["POSITION"] = positions;
      primitive.indices = AddIndices(model, mesh, m);
      if (model.accessors[primitive.indices].count == 0) {
        throw std::invalid_argument(mesh.name + ": no triangle has material " +
                                    mesh.material_names[m]);
      }
      if (m < mesh.material_names.size()) {
        tinygltf::Material material;
        material.name = mesh.material_names[m];
        model.materials.push_back(material);
        primitive.material = static_cast<int>(model.materials.size() - 1);
      }
      gltf_mesh.primitives.push_back(primitive);
    }
    model.meshes.push_back(gltf_mesh);
    tinygltf::Node node;
    node.name = mesh.name;
    node.mesh = static_cast<int>(model.meshes.size() - 1);
    if (mesh.origin_mm != std::array<double, 3>{}) {
      for (const double mm : mesh.origin_mm) node.translation.push_back(mm * 1e-3);
    }
    model.nodes.push_back(node);
    scene.nodes.push_back(static_cast<int>(model.nodes.size() - 1));
  }
  if (model.meshes.empty()) throw std::invalid_argument("no mesh to write");
  model.scenes.push_back(scene);
  model.defaultScene = 0;
  // Through our own stream: tinygltf does not notice a full disk.
  std::ofstream out(file, std::ios::binary | std::ios::trunc);
  tinygltf::TinyGLTF writer;
  const bool written = out && writer.WriteGltfSceneToStream(&model, out, /*prettyPrint=*/false,
                                                            /*writeBinary=*/true);
  out.close();
  if (!written || !out) throw std::runtime_error(file.string() + ": cannot be written");
}

}  // namespace sightline
