// SPDX-License-Identifier: Apache-2.0
#include "core/part/gltf_extensions.h"

#include <algorithm>
#include <iterator>

#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

// Families of extensions that concern the looks.
constexpr std::string_view kLooksPrefixes[] = {
    "KHR_materials_", "EXT_materials_", "ADOBE_materials_", "MSFT_packing_", "KHR_texture_",
    "EXT_texture_",   "MSFT_texture_",  "KHR_lights_",      "EXT_lights_",   "KHR_xmp"};

constexpr std::string_view kNoShape[] = {
    "AGI_stk_metadata",          // of nodes: which of them are solar panels
    "CESIUM_primitive_outline",  // edges to draw
    "EXT_feature_metadata",
    "EXT_instance_features",
    "EXT_mesh_features",
    "EXT_structural_metadata",
    "FB_geometry_metadata",  // counts and boxes
    "GODOT_single_root",
    "KHR_animation_pointer",  // without animation the file is read
    "KHR_audio",
    "KHR_audio_emitter",
    "KHR_node_hoverability",
    "KHR_node_selectability",
    "MSFT_lod",  // the node itself is the finest level
    "OMI_audio_emitter",
    "VRMC_materials_mtoon",
};

// Extensions that read_gltf.cpp obeys.
constexpr std::string_view kObeyed[] = {"EXT_mesh_gpu_instancing", "KHR_mesh_quantization",
                                        "KHR_node_visibility"};

}  // namespace

bool ConcernsNoShape(std::string_view extension) {
  return std::any_of(std::begin(kLooksPrefixes), std::end(kLooksPrefixes),
                     [&](std::string_view prefix) { return extension.starts_with(prefix); }) ||
         std::find(std::begin(kNoShape), std::end(kNoShape), extension) != std::end(kNoShape);
}

bool CompressesMeshes(std::string_view extension) {
  return extension == "KHR_draco_mesh_compression" ||
         extension.find("meshopt_compression") != std::string_view::npos;
}

absl::Status CheckRequiredExtensions(const std::vector<std::string>& required) {
  for (const std::string& name : required) {
    if (ConcernsNoShape(name)) continue;
    if (std::find(std::begin(kObeyed), std::end(kObeyed), name) != std::end(kObeyed)) continue;
    if (CompressesMeshes(name)) {
      return absl::InvalidArgumentError(
          absl::StrCat("requires ", name, ": export it without mesh compression"));
    }
    return absl::InvalidArgumentError(absl::StrCat("requires the unsupported extension ", name));
  }
  return absl::OkStatus();
}

absl::Status RefuseExtension(const std::string& place, std::string_view extension) {
  return absl::InvalidArgumentError(absl::StrCat(
      place, " uses the extension ", std::string(extension.substr(0, 80)),
      ", which is not supported and may change the shape: export the part without it"));
}

}  // namespace sightline
