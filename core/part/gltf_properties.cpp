// SPDX-License-Identifier: Apache-2.0
#include "core/part/gltf_properties.h"

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <limits>
#include <string>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include "core/part/mesh_readers.h"

namespace sightline {
namespace {

enum class GltfShape {
  kWhole,     // a whole number from `least` to `most`
  kWholes,    // a list of them
  kWholeMap,  // an object of them, with any names
  kNumbers,   // a list of `least` numbers
  kFlag,
  kText,
  kTexts,
  kList,     // of anything
  kObject,   // described by the properties of `kind`
  kObjects,  // a list of them
};

struct GltfProperty {
  absl::string_view owner, name;
  GltfShape shape = GltfShape::kWhole;
  absl::string_view kind = {};
  int64_t least = 0, most = std::numeric_limits<int32_t>::max();
};

// JSON numbers are whole up to here in every program.
constexpr int64_t kMostGltfBytes = int64_t{1} << 53;

constexpr GltfProperty kGltfProperties[] = {
    {"root", "asset", GltfShape::kObject, "asset"},
    {"root", "scene"},
    {"root", "scenes", GltfShape::kObjects, "scene"},
    {"root", "nodes", GltfShape::kObjects, "node"},
    {"root", "meshes", GltfShape::kObjects, "mesh"},
    {"root", "accessors", GltfShape::kObjects, "accessor"},
    {"root", "bufferViews", GltfShape::kObjects, "bufferView"},
    {"root", "buffers", GltfShape::kObjects, "buffer"},
    {"root", "materials", GltfShape::kObjects, "material"},
    {"root", "extensionsUsed", GltfShape::kTexts},
    {"root", "extensionsRequired", GltfShape::kTexts},
    {"root", "extensions", GltfShape::kObject},
    {"asset", "version", GltfShape::kText},
    {"asset", "minVersion", GltfShape::kText},
    {"scene", "nodes", GltfShape::kWholes},
    {"scene", "extensions", GltfShape::kObject},
    {"node", "mesh"},
    {"node", "skin"},
    {"node", "children", GltfShape::kWholes},
    {"node", "matrix", GltfShape::kNumbers, {}, 16},
    {"node", "translation", GltfShape::kNumbers, {}, 3},
    {"node", "rotation", GltfShape::kNumbers, {}, 4},
    {"node", "scale", GltfShape::kNumbers, {}, 3},
    {"node", "extensions", GltfShape::kObject, "extensions of a node"},
    {"extensions of a node", "KHR_node_visibility", GltfShape::kObject, "visibility"},
    {"visibility", "visible", GltfShape::kFlag},
    {"extensions of a node", "EXT_mesh_gpu_instancing", GltfShape::kObject, "instancing"},
    {"instancing", "attributes", GltfShape::kWholeMap},
    {"mesh", "primitives", GltfShape::kObjects, "primitive"},
    {"mesh", "extensions", GltfShape::kObject},
    {"primitive", "attributes", GltfShape::kWholeMap},
    {"primitive", "indices"},
    {"primitive", "material"},
    {"primitive", "mode", GltfShape::kWhole, {}, 0, 6},
    {"primitive", "targets", GltfShape::kList},
    {"primitive", "extensions", GltfShape::kObject},
    {"material", "name", GltfShape::kText},
    {"accessor", "bufferView"},
    {"accessor", "byteOffset", GltfShape::kWhole, {}, 0, kMostGltfBytes},
    {"accessor", "componentType"},
    {"accessor", "normalized", GltfShape::kFlag},
    {"accessor", "count", GltfShape::kWhole, {}, 0, kMostGltfBytes},
    {"accessor", "type", GltfShape::kText},
    {"accessor", "sparse", GltfShape::kObject, "sparse"},
    {"accessor", "extensions", GltfShape::kObject},
    {"sparse", "count"},
    {"sparse", "indices", GltfShape::kObject, "sparse part"},
    {"sparse", "values", GltfShape::kObject, "sparse part"},
    {"sparse part", "bufferView"},
    {"sparse part", "byteOffset"},
    {"sparse part", "componentType"},
    {"bufferView", "buffer"},
    {"bufferView", "byteOffset", GltfShape::kWhole, {}, 0, kMostGltfBytes},
    {"bufferView", "byteLength", GltfShape::kWhole, {}, 0, kMostGltfBytes},
    {"bufferView", "byteStride"},
    {"bufferView", "extensions", GltfShape::kObject},
    {"buffer", "byteLength", GltfShape::kWhole, {}, 0, kMostGltfBytes},
    {"buffer", "uri", GltfShape::kText},
};

// Messages begin with the place; callers prepend their part of the place.
absl::Status AtPlace(absl::string_view place, const absl::Status& status) {
  return absl::InvalidArgumentError(absl::StrCat(place, status.message()));
}

absl::Status WrongValue(const nlohmann::json& value, absl::string_view must_be) {
  const std::string is =
      value.is_object() ? "an object"
      : value.is_array()
          ? absl::StrCat("a list of ", value.size())
          : Excerpt(value.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
  return absl::InvalidArgumentError(absl::StrCat(" is ", is, ", must be ", must_be));
}

absl::Status CheckWhole(const nlohmann::json& value, const GltfProperty& property) {
  const bool fits = value.is_number_unsigned()
                        ? value.get<uint64_t>() <= static_cast<uint64_t>(property.most) &&
                              value.get<uint64_t>() >= static_cast<uint64_t>(property.least)
                        : value.is_number_integer() && value.get<int64_t>() >= property.least &&
                              value.get<int64_t>() <= property.most;
  if (fits) return absl::OkStatus();
  return WrongValue(value, absl::StrCat("a whole number from ", property.least, " to ",
                                        property.most, ", written without a point"));
}

absl::Status CheckGltfObject(const nlohmann::json& object, absl::string_view kind);

// Checks each element of a list by `check`.
template <typename Check>
absl::Status CheckEach(const nlohmann::json& list, absl::string_view of_what, const Check& check) {
  if (!list.is_array()) return WrongValue(list, absl::StrCat("a list of ", of_what));
  for (size_t i = 0; i < list.size(); ++i) {
    if (const absl::Status status = check(list[i]); !status.ok()) {
      return AtPlace(absl::StrCat("[", i, "]"), status);
    }
  }
  return absl::OkStatus();
}

absl::Status CheckGltfValue(const nlohmann::json& value, const GltfProperty& property) {
  const auto when = [&](bool right, absl::string_view must_be) {
    return right ? absl::OkStatus() : WrongValue(value, must_be);
  };
  const auto whole = [&](const nlohmann::json& element) { return CheckWhole(element, property); };
  switch (property.shape) {
    case GltfShape::kWhole:
      return CheckWhole(value, property);
    case GltfShape::kWholes:
      return CheckEach(value, "whole numbers", whole);
    case GltfShape::kWholeMap:
      if (!value.is_object()) return WrongValue(value, "an object");
      for (const auto& [name, element] : value.items()) {
        if (const absl::Status status = whole(element); !status.ok()) {
          return AtPlace(absl::StrCat(".", Excerpt(name)), status);
        }
      }
      return absl::OkStatus();
    case GltfShape::kNumbers:
      if (!value.is_array() || value.size() != static_cast<size_t>(property.least)) {
        return WrongValue(value, absl::StrCat("a list of ", property.least, " numbers"));
      }
      return CheckEach(value, "numbers", [](const nlohmann::json& element) {
        return element.is_number() ? absl::OkStatus() : WrongValue(element, "a number");
      });
    case GltfShape::kFlag:
      return when(value.is_boolean(), "true or false, without quotes");
    case GltfShape::kText:
      return when(value.is_string(), "a text in quotes");
    case GltfShape::kTexts:
      return CheckEach(value, "texts", [](const nlohmann::json& element) {
        return element.is_string() ? absl::OkStatus() : WrongValue(element, "a text in quotes");
      });
    case GltfShape::kList:
      return when(value.is_array(), "a list");
    case GltfShape::kObject:
      return CheckGltfObject(value, property.kind);
    case GltfShape::kObjects:
      return CheckEach(value, "objects", [&](const nlohmann::json& element) {
        return CheckGltfObject(element, property.kind);
      });
  }
  return absl::OkStatus();
}

// The attributes of EXT_mesh_gpu_instancing; those of the writer's own begin with "_".
absl::Status CheckInstancing(const nlohmann::json& instancing) {
  const auto attributes = instancing.find("attributes");
  if (attributes == instancing.end()) return absl::OkStatus();
  for (const auto& [name, value] : attributes->items()) {
    if (name == "TRANSLATION" || name == "ROTATION" || name == "SCALE" || name.starts_with("_")) {
      continue;
    }
    return absl::InvalidArgumentError(
        absl::StrCat(".attributes.", Excerpt(name),
                     " is no attribute of this extension, which has TRANSLATION, ROTATION, SCALE "
                     "and names that begin with _"));
  }
  return absl::OkStatus();
}

// `version` is "major.minor" in digits; this reader is of version 2.0.
absl::Status CheckAsset(const nlohmann::json& asset) {
  const auto version = asset.find("version");
  if (version == asset.end()) {
    return absl::InvalidArgumentError(".version is missing, must be \"2.0\"");
  }
  const std::string& text = version->get_ref<const std::string&>();
  const bool is_2 = text.size() > 2 && text.starts_with("2.") &&
                    text.find_first_not_of("0123456789", 2) == std::string::npos;
  if (!is_2) return AtPlace(".version", WrongValue(*version, "\"2.0\""));
  const auto least = asset.find("minVersion");
  if (least == asset.end() || *least == "2.0") return absl::OkStatus();
  return AtPlace(".minVersion", WrongValue(*least, "\"2.0\": newer files cannot be read"));
}

absl::Status CheckGltfObject(const nlohmann::json& object, absl::string_view kind) {
  if (!object.is_object()) return WrongValue(object, "an object");
  if (kind.empty()) return absl::OkStatus();
  for (const auto& [name, value] : object.items()) {
    const auto find = [&](const auto& is_same) {
      return std::find_if(std::begin(kGltfProperties), std::end(kGltfProperties),
                          [&](const GltfProperty& property) {
                            return property.owner == kind && is_same(property.name);
                          });
    };
    const std::string& text = name;
    const auto* const property = find([&](absl::string_view known) { return text == known; });
    if (property == std::end(kGltfProperties)) {
      const auto* const similar =
          find([&](absl::string_view known) { return absl::EqualsIgnoreCase(text, known); });
      if (similar == std::end(kGltfProperties)) continue;
      return absl::InvalidArgumentError(absl::StrCat(
          ".", Excerpt(text), " is no property of glTF; ", similar->name, " is: which is meant?"));
    }
    if (const absl::Status status = CheckGltfValue(value, *property); !status.ok()) {
      return AtPlace(absl::StrCat(".", property->name), status);
    }
  }
  if (kind == "asset") return CheckAsset(object);
  if (kind == "instancing") return CheckInstancing(object);
  // tinygltf would leave out the others beside a matrix.
  if (kind == "node" && object.contains("matrix") &&
      (object.contains("translation") || object.contains("rotation") || object.contains("scale"))) {
    return absl::InvalidArgumentError(
        " has a matrix and a translation, rotation or scale, must have either");
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckGltfProperties(const nlohmann::json& root) {
  absl::Status status = CheckGltfObject(root, "root");
  if (status.ok()) return status;
  return absl::InvalidArgumentError(absl::StripPrefix(status.message(), "."));
}

}  // namespace sightline
