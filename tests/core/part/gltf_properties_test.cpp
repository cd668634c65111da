// SPDX-License-Identifier: Apache-2.0
#include "core/part/gltf_properties.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "core/part/load_part.h"
#include "tests/core/part/mesh_formats.h"
#include "tests/core/part/test_meshes.h"

namespace sightline {
namespace {

using GltfJson = nlohmann::json;
namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

std::string GltfOfBox() { return GltfText(BoxMesh({0, 0, 0}, {0.02f, 0.03f, 0.04f})); }

// "read", or why the file is refused.
std::string ErrorOfGltf(const std::string& text) {
  const fs::path folder = fs::path(::testing::TempDir()) / absl::StrCat("properties_", getpid());
  fs::create_directories(folder);
  std::ofstream(folder / "part.gltf", std::ios::binary) << text;
  const auto mesh = LoadPart((folder / "part.gltf").string(), "");
  fs::remove_all(folder);
  return mesh.ok() ? "read" : std::string(mesh.status().message());
}

std::string ErrorWith(const std::string& pointer, const GltfJson& value) {
  GltfJson root = GltfJson::parse(GltfOfBox());
  root[GltfJson::json_pointer(pointer)] = value;
  return ErrorOfGltf(root.dump());
}

// "/nodes/0/scale" as messages name it: nodes[0].scale.
std::string PlaceOf(const std::string& pointer) {
  std::string place;
  for (size_t at = 1; at < pointer.size();) {
    const size_t end = std::min(pointer.find('/', at), pointer.size());
    const std::string step = pointer.substr(at, end - at);
    const bool index = step.find_first_not_of("0123456789") == std::string::npos;
    absl::StrAppend(&place, index ? "[" : place.empty() ? "" : ".", step, index ? "]" : "");
    at = end + 1;
  }
  return place;
}

TEST(GltfProperties, WrongTypesAndRangesAreRefusedWithThePlace) {
  const std::vector<std::pair<std::string, GltfJson>> right = {
      {"/scene", 0},
      {"/nodes/0/scale", GltfJson::array({1, 2.5, 1e0})},
      {"/nodes/0/translation", GltfJson::array({0, 0, 0})},
      {"/nodes/0/rotation", GltfJson::array({0, 0, 0, 1})},
      {"/nodes/0/extensions/KHR_node_visibility/visible", true},
      {"/nodes/0/name", 7},  // does not concern the shape
      {"/nodes/0/extras/scale", "2"},
      {"/meshes/0/primitives/0/mode", 4},
      {"/accessors/0/byteOffset", 0},
      {"/accessors/0/normalized", false},
      {"/asset/version", "2.0"},
      {"/asset/version", "2.1"},
      {"/asset/minVersion", "2.0"}};
  for (const auto& [pointer, value] : right) {
    EXPECT_EQ(ErrorWith(pointer, value), "read") << pointer << " " << value;
  }
  const std::vector<std::pair<std::string, GltfJson>> wrong = {
      {"/scene", 0.0},
      {"/scene", "0"},
      {"/scene", -1},
      {"/scene", 5'000'000'000},
      {"/scenes", GltfJson::object()},
      {"/scenes/0/nodes", "0"},
      {"/scenes/0/nodes/0", 0.0},
      {"/nodes/0/mesh", 0.0},
      {"/nodes/0/mesh", "0"},
      {"/nodes/0/mesh", nullptr},
      {"/nodes/0/children", 1},
      {"/nodes/0/scale", 2},
      {"/nodes/0/scale", GltfJson::array({2, 2})},
      {"/nodes/0/scale", GltfJson::array({"2", "2", "2"})},
      {"/nodes/0/scale", GltfJson::array({2, nullptr, 2})},
      {"/nodes/0/translation", nullptr},
      {"/nodes/0/rotation", GltfJson::array()},
      {"/nodes/0/matrix", "identity"},
      {"/nodes/0/extensions", GltfJson::array()},
      {"/nodes/0/extensions/KHR_node_visibility", false},
      {"/nodes/0/extensions/KHR_node_visibility/visible", 0},
      {"/nodes/0/extensions/KHR_node_visibility/visible", "false"},
      {"/nodes/0/extensions/EXT_mesh_gpu_instancing/attributes/Rotation", 0},
      {"/nodes/0/extensions/EXT_mesh_gpu_instancing/attributes/TRANSLATION", 0.0},
      {"/meshes/0/primitives", GltfJson::object()},
      {"/meshes/0/primitives/0/mode", 5.0},
      {"/meshes/0/primitives/0/mode", "TRIANGLES"},
      {"/meshes/0/primitives/0/mode", -1},
      {"/meshes/0/primitives/0/mode", 7},
      {"/meshes/0/primitives/0/indices", "1"},
      {"/meshes/0/primitives/0/attributes/POSITION", 0.0},
      {"/meshes/0/primitives/0/targets", 1},
      {"/materials/0/name", 1},
      {"/accessors/1/byteOffset", 6.0},
      {"/accessors/1/byteOffset", "6"},
      {"/accessors/1/byteOffset", -2},
      {"/accessors/0/normalized", "true"},
      {"/accessors/0/count", 8.0},
      {"/accessors/0/sparse", 1},
      {"/accessors/0/sparse/count", 1.0},
      {"/accessors/0/sparse/values/byteOffset", "0"},
      {"/bufferViews/1/byteOffset", 96.0},
      {"/bufferViews/0/byteStride", "12"},
      {"/buffers/0/byteLength", 1e3},
      {"/buffers/0/uri", 1},
      {"/extensionsRequired", "KHR_mesh_quantization"},
      {"/asset", "2.0"},
      {"/asset/version", "1.0"},
      {"/asset/version", 2.0},
      {"/asset/version", "2"},
      {"/asset/minVersion", "2.1"},
      {"/nodes/0/Scale", GltfJson::array({2, 2, 2})}};
  for (const auto& [pointer, value] : wrong) {
    EXPECT_THAT(ErrorWith(pointer, value),
                AllOf(HasSubstr("part.gltf: " + PlaceOf(pointer)), HasSubstr(" is ")))
        << pointer << " " << value;
  }
  EXPECT_THAT(ErrorOfGltf(absl::StrReplaceAll(GltfOfBox(), {{R"("version": "2.0")", ""}})),
              HasSubstr("asset.version is missing"));
}

TEST(GltfProperties, KeysThatStandTwiceAreRefusedWithThePlace) {
  const std::string nodes = R"("nodes": [{"mesh": 0}])";
  ASSERT_THAT(GltfOfBox(), HasSubstr(nodes));
  for (const auto& [again, place] : std::vector<std::pair<std::string, std::string>>{
           {R"("nodes": [{"mesh": 0, "scale": [2, 2, 2]}], )" + nodes, "nodes"},
           {R"("nodes": [{"mesh": 0, "scale": [2, 2, 2], "scale": [1, 1, 1]}])", "nodes[0].scale"},
           {R"("nodes": [{"name": "a"}, {"mesh": 0, "extras": {"a": [1, {"b": 1, "\u0062": 2}]}}])",
            "nodes[1].extras.a[1].b"}}) {
    EXPECT_THAT(ErrorOfGltf(absl::StrReplaceAll(GltfOfBox(), {{nodes, again}})),
                HasSubstr("part.gltf: " + place + " stands twice"));
  }
}

TEST(GltfProperties, AMatrixAndAScaleExcludeEachOther) {
  GltfJson root = GltfJson::parse(GltfOfBox());
  root["nodes"][0]["matrix"] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  EXPECT_EQ(ErrorOfGltf(root.dump()), "read");
  root["nodes"][0]["scale"] = {2, 2, 2};
  EXPECT_THAT(ErrorOfGltf(root.dump()), HasSubstr("nodes[0] has a matrix and a translation"));
}

}  // namespace
}  // namespace sightline
