// SPDX-License-Identifier: Apache-2.0
// glTF 2.0 and GLB by tinygltf, which parses; everything an index or offset of the file points at
// is checked here, because tinygltf checks little of it.
#include <tiny_gltf.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <filesystem>
#include <initializer_list>
#include <new>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/strip.h"
#include "core/file/read_file.h"
#include "core/part/gltf_buffer_files.h"
#include "core/part/gltf_extensions.h"
#include "core/part/gltf_properties.h"
#include "core/part/mesh_readers.h"
#include "core/status/status_macros.h"
#include "core/text/text_encoding.h"

namespace sightline {
namespace {

// tinygltf walks "extras" recursively: deeper nesting could overflow the stack.
constexpr size_t kMaxJsonDepth = 64;

absl::Status Refuse(const std::string& reason) { return absl::InvalidArgumentError(reason); }

// Counts the values of a JSON text without keeping them, and finds keys that stand twice in an
// object: parsers differ in which of the two they take.
class JsonMeasure : public nlohmann::json_sax<nlohmann::json> {
 public:
  bool too_deep = false, too_many = false;
  std::string repeated;  // place of the first such key, "nodes[3].scale"

  bool null() override { return Count(); }
  bool boolean(bool) override { return Count(); }
  bool number_integer(number_integer_t) override { return Count(); }
  bool number_unsigned(number_unsigned_t) override { return Count(); }
  bool number_float(number_float_t, const string_t&) override { return Count(); }
  bool string(string_t&) override { return Count(); }
  bool binary(binary_t&) override { return Count(); }
  bool key(string_t& name) override {
    const auto [entry, is_new] = open_.back().keys.insert(name);
    open_.back().key = *entry;
    if (!is_new) repeated = Place();
    return is_new;
  }
  bool start_object(size_t) override { return Open(false); }
  bool start_array(size_t) override { return Open(true); }
  bool end_object() override { return Close(); }
  bool end_array() override { return Close(); }
  bool parse_error(size_t, const std::string&, const nlohmann::detail::exception&) override {
    return false;
  }

 private:
  // An object or a list that has begun and not ended.
  struct Container {
    bool is_list = false;
    size_t begun = 0;            // elements of the list so far
    std::set<std::string> keys;  // of the object so far
    std::string key;             // the last of them
  };

  bool Count() {
    if (!open_.empty() && open_.back().is_list) ++open_.back().begun;
    too_many = ++values_ > kMaxGltfJsonValues;
    return !too_many;
  }
  bool Open(bool is_list) {
    too_deep = open_.size() + 1 > kMaxJsonDepth;
    if (too_deep || !Count()) return false;
    open_.emplace_back().is_list = is_list;
    return true;
  }
  bool Close() {
    open_.pop_back();
    return true;
  }
  std::string Place() const {
    std::string place;
    for (const Container& container : open_) {
      if (container.is_list) {
        absl::StrAppend(&place, "[", container.begun - 1, "]");
      } else {
        absl::StrAppend(&place, place.empty() ? "" : ".", Excerpt(container.key));
      }
    }
    return place;
  }

  size_t values_ = 0;
  std::vector<Container> open_;  // the outermost first
};

// Whether a file named in a glTF file is beside it or below, as far as names tell.
bool StaysInFolder(const std::string& file) {
  const std::filesystem::path path = file;
  return !path.is_absolute() && file.find('\\') == std::string::npos &&
         file.find('\0') == std::string::npos && !absl::StrContains(file, "://") &&
         std::none_of(path.begin(), path.end(),
                      [](const std::filesystem::path& step) { return step == ".."; });
}

// Memory that tinygltf takes for the elements of a list of `owner`, as far as their types say.
size_t BytesOfList(const nlohmann::json& owner, const char* list, size_t element_bytes) {
  const auto found = owner.is_object() ? owner.find(list) : owner.end();
  return found != owner.end() && found->is_array() ? found->size() * element_bytes : 0;
}

// Memory that tinygltf takes for the elements of a glTF file, whatever they hold. Values of 200
// bytes and less (extras, extensions, numbers) are limited by their count.
size_t BytesOfElements(const nlohmann::json& root) {
  size_t bytes = BytesOfList(root, "accessors", sizeof(tinygltf::Accessor)) +
                 BytesOfList(root, "animations", sizeof(tinygltf::Animation)) +
                 BytesOfList(root, "bufferViews", sizeof(tinygltf::BufferView)) +
                 BytesOfList(root, "buffers", sizeof(tinygltf::Buffer)) +
                 BytesOfList(root, "cameras", sizeof(tinygltf::Camera)) +
                 BytesOfList(root, "images", sizeof(tinygltf::Image)) +
                 BytesOfList(root, "materials", sizeof(tinygltf::Material)) +
                 BytesOfList(root, "meshes", sizeof(tinygltf::Mesh)) +
                 BytesOfList(root, "nodes", sizeof(tinygltf::Node)) +
                 BytesOfList(root, "samplers", sizeof(tinygltf::Sampler)) +
                 BytesOfList(root, "scenes", sizeof(tinygltf::Scene)) +
                 BytesOfList(root, "skins", sizeof(tinygltf::Skin)) +
                 BytesOfList(root, "textures", sizeof(tinygltf::Texture));
  const auto for_each = [&](const char* list, const auto& add) {
    const auto found = root.find(list);
    if (found == root.end() || !found->is_array()) return;
    for (const nlohmann::json& element : *found) add(element);
  };
  for_each("meshes", [&](const nlohmann::json& mesh) {
    bytes += BytesOfList(mesh, "primitives", sizeof(tinygltf::Primitive));
  });
  for_each("animations", [&](const nlohmann::json& animation) {
    bytes += BytesOfList(animation, "channels", sizeof(tinygltf::AnimationChannel)) +
             BytesOfList(animation, "samplers", sizeof(tinygltf::AnimationSampler));
  });
  if (const auto extensions = root.find("extensions");
      extensions != root.end() && extensions->is_object()) {
    if (const auto lights = extensions->find("KHR_lights_punctual"); lights != extensions->end()) {
      bytes += BytesOfList(*lights, "lights", sizeof(tinygltf::Light));
    }
  }
  return bytes;
}

// Bytes of a GLB's own buffer as its JSON states them. 0: the JSON names no such buffer.
uint64_t OwnBufferBytes(const nlohmann::json& root) {
  const auto buffers = root.find("buffers");
  if (buffers == root.end() || !buffers->is_array() || buffers->empty()) return 0;
  const nlohmann::json& own = buffers->front();
  if (!own.is_object() || own.contains("uri")) return 0;
  const auto bytes = own.find("byteLength");
  return bytes != own.end() && bytes->is_number_unsigned() ? bytes->get<uint64_t>() : 0;
}

// Checks the JSON before tinygltf parses it. `buffer_files`: where to put the names of
// the files that buffers are in; nullptr for a GLB, which has them in itself, in `binary_bytes`
// bytes.
absl::Status CheckJson(std::string_view json, std::vector<std::string>* buffer_files,
                       uint64_t binary_bytes) {
  if (json.size() > kMaxGltfJsonBytes) {
    return absl::InvalidArgumentError(
        absl::StrCat("its JSON has ", json.size() >> 20, " MiB, at most ", kMaxGltfJsonBytes >> 20,
                     " MiB can be read: geometry belongs into buffers, not into extras"));
  }
  // The parser takes NUL for the end of the text.
  if (WithoutEndMarks(json).find('\0') != std::string_view::npos) {
    return Refuse("damaged: its JSON has a NUL byte in it");
  }
  JsonMeasure measure;
  const bool parsed = nlohmann::json::sax_parse(json.begin(), json.end(), &measure);
  if (measure.too_deep) {
    return Refuse(absl::StrCat("its JSON is nested deeper than ", kMaxJsonDepth));
  }
  if (measure.too_many) {
    return absl::InvalidArgumentError(
        absl::StrCat("its JSON has more than the ", kMaxGltfJsonValues,
                     " values that can be read: geometry belongs into buffers, not into extras"));
  }
  if (!measure.repeated.empty()) {
    return Refuse(absl::StrCat(measure.repeated, " stands twice in the same object of its JSON"));
  }
  const nlohmann::json root = parsed
                                  ? nlohmann::json::parse(json.begin(), json.end(), nullptr, false)
                                  : nlohmann::json(nlohmann::json::value_t::discarded);
  if (root.is_discarded() || !root.is_object()) {
    return Refuse("truncated or damaged: its JSON does not parse");
  }
  if (BytesOfElements(root) > kMaxGltfElementBytes) {
    return absl::InvalidArgumentError(
        absl::StrCat("its JSON has more materials, nodes and other elements than the ",
                     kMaxGltfElementBytes >> 20, " MiB that can be read"));
  }
  SIGHTLINE_RETURN_IF_ERROR(CheckGltfProperties(root));
  const bool binary = buffer_files == nullptr;
  if (const uint64_t used = OwnBufferBytes(root);
      binary && binary_bytes > (used + 3) / 4 * 4) {  // chunks are padded to words
    return Refuse(absl::StrCat("too long: its binary chunk has ", binary_bytes,
                               " bytes, buffers[0] uses ", used, " of them"));
  }
  // Only the first buffer may be the GLB's own; each further one would copy it once more.
  const auto buffers = root.find("buffers");
  if (buffers == root.end() || !buffers->is_array()) return absl::OkStatus();
  for (size_t i = 0; i < buffers->size(); ++i) {
    const nlohmann::json& buffer = (*buffers)[i];
    const auto uri = buffer.is_object() ? buffer.find("uri") : buffer.end();
    const bool has_uri = buffer.is_object() && uri != buffer.end();
    if (!has_uri && (!binary || i > 0)) {
      const bool fallback = buffer.is_object() && buffer.contains("extensions");
      return Refuse(absl::StrCat("buffers[", i, "] has no uri",
                                 fallback ? ": export the part without mesh compression" : ""));
    }
    if (!has_uri || binary || !uri->is_string()) continue;
    const std::string& text = uri->get_ref<const std::string&>();
    if (absl::StartsWith(text, "data:")) continue;
    const std::string file = DecodedUri(text);
    if (file.empty() || !StaysInFolder(file)) {
      return Refuse(absl::StrCat("buffers[", i, "].uri is \"", Excerpt(text),
                                 "\", must name a file in the folder of the part or below it"));
    }
    buffer_files->push_back(file);
  }
  return absl::OkStatus();
}

// Images have no part in the geometry.
bool IgnoreImage(tinygltf::Image*, int, std::string*, std::string*, int, int, const unsigned char*,
                 int, void*) {
  return true;
}

bool NoSuchFile(const std::string&, void*) { return false; }
std::string SamePath(const std::string& path, void*) { return path; }
bool ReadNoFile(std::vector<unsigned char>*, std::string* error, const std::string& path, void*) {
  if (error != nullptr) *error += "external file " + path + " cannot be read from a GLB. ";
  return false;
}
bool WriteNoFile(std::string*, const std::string&, const std::vector<unsigned char>&, void*) {
  return false;
}

// The buffers of a .gltf file: the files it names in its folder, and no others. tinygltf would also
// look in the working folder, and load pictures.
struct BufferFiles {
  std::string folder;
  std::vector<std::string> names;
  // Buffers may share a file, and each gets its copy.
  uint64_t bytes_left = kMaxPartFileBytes;

  bool Has(const std::string& path) const {
    return std::any_of(names.begin(), names.end(), [&](const std::string& name) {
      return std::filesystem::path(path) == std::filesystem::path(folder) / name;
    });
  }
};

// Whether `path` is in `folder` or below it once links are followed.
bool LeadsIntoFolder(const std::filesystem::path& path, const std::string& folder) {
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::path real_folder = fs::canonical(folder.empty() ? "." : folder, error);
  if (error) return false;
  const fs::path real = fs::canonical(path, error);
  if (error) return false;
  return std::mismatch(real_folder.begin(), real_folder.end(), real.begin(), real.end()).first ==
         real_folder.end();
}

bool IsBufferFile(const std::string& path, void* files) {
  return static_cast<const BufferFiles*>(files)->Has(path);
}
bool ReadBufferFile(std::vector<unsigned char>* bytes, std::string* error, const std::string& path,
                    void* context) {
  auto& files = *static_cast<BufferFiles*>(context);
  if (std::error_code missing;
      std::filesystem::exists(path, missing) && !LeadsIntoFolder(path, files.folder)) {
    if (error != nullptr) {
      absl::StrAppend(error, path, ": is a link out of the folder of the part, which is not read");
    }
    return false;
  }
  const absl::StatusOr<std::string> read = ReadRegularFile(path, files.bytes_left);
  if (!read.ok()) {
    if (error != nullptr) absl::StrAppend(error, read.status().message());
    return false;
  }
  files.bytes_left -= read->size();
  bytes->assign(read->begin(), read->end());
  return true;
}

// One line, whatever tinygltf wrote.
std::string OneLine(std::string text) {
  text.resize(std::min<size_t>(text.size(), 400));
  text = absl::StrReplaceAll(text, {{"\n", " "}, {"\r", " "}});
  return std::string(absl::StripAsciiWhitespace(text));
}

class Converter {
 public:
  Converter(const tinygltf::Model& model, const StopCheck& stop) : model_(model), stop_(stop) {}

  absl::StatusOr<RawMesh> Convert() {
    SIGHTLINE_RETURN_IF_ERROR(CheckRequiredExtensions(model_.extensionsRequired));
    SIGHTLINE_RETURN_IF_ERROR(CheckExtensionsAt("the file", model_.extensions));
    visited_.assign(model_.nodes.size(), false);
    const size_t scene = static_cast<size_t>(std::max(model_.defaultScene, 0));
    SIGHTLINE_RETURN_IF_ERROR(model_.scenes.empty() ? AddAllRoots() : AddScene(scene));
    if (mesh_.triangles.empty() && model_.scenes.size() > 1) {
      return Refuse(absl::StrCat(SceneText(scene),
                                 model_.defaultScene < 0 ? ", the first one," : ", its default,",
                                 " has no triangles; not read were ", OtherScenesText(scene),
                                 ": make the scene of the part the default"));
    }
    if (mesh_.triangles.empty() && skipped_primitives_ > 0) {
      return Refuse("has only points and lines, no triangles");
    }
    return std::move(mesh_);
  }

 private:
  // "scenes[1] "fixture"", or without a name the place alone.
  static std::string PlaceText(const char* list, size_t index, const std::string& name) {
    return absl::StrCat(
        list, "[", index, "]",
        name.empty() ? "" : absl::StrCat(" \"", absl::Utf8SafeCEscape(Excerpt(name)), "\""));
  }
  std::string SceneText(size_t scene) const {
    return PlaceText("scenes", scene, model_.scenes[scene].name);
  }

  // A list for people, of many only some.
  static std::string ListText(const std::vector<std::string>& places) {
    constexpr size_t kMostNamed = 4;
    std::string text;
    for (size_t i = 0; i < places.size() && i < kMostNamed; ++i) {
      absl::StrAppend(&text, i == 0 ? "" : ", ", places[i]);
    }
    if (places.size() > kMostNamed) {
      absl::StrAppend(&text, " and ", places.size() - kMostNamed, " more");
    }
    return text;
  }

  // All scenes but one.
  std::string OtherScenesText(size_t scene) const {
    std::vector<std::string> others;
    for (size_t i = 0; i < model_.scenes.size(); ++i) {
      if (i != scene) others.push_back(SceneText(i));
    }
    return ListText(others);
  }

  // A file without a scene does not say which of its nodes are the part (3.5.1 of the
  // specification): all that have no parent are read, with what is below them.
  absl::Status AddAllRoots() {
    std::vector<bool> is_child(model_.nodes.size(), false);
    for (const tinygltf::Node& node : model_.nodes) {
      for (int child : node.children) {
        if (child >= 0 && static_cast<size_t>(child) < is_child.size()) is_child[child] = true;
      }
    }
    std::vector<std::string> roots;
    for (size_t i = 0; i < model_.nodes.size(); ++i) {
      if (is_child[i]) continue;
      roots.push_back(PlaceText("nodes", i, model_.nodes[i].name));
      SIGHTLINE_RETURN_IF_ERROR(AddTree(static_cast<int>(i)));
    }
    if (roots.size() > 1) {
      mesh_.remarks.push_back(absl::StrCat("has no scene that says which nodes are the part; all ",
                                           roots.size(),
                                           " without a parent were read: ", ListText(roots)));
    }
    return absl::OkStatus();
  }

  absl::Status AddScene(size_t scene) {
    if (scene >= model_.scenes.size()) {
      return Refuse(absl::StrCat("its default scene ", scene, " does not exist"));
    }
    if (model_.defaultScene < 0 && model_.scenes.size() > 1) {
      mesh_.remarks.push_back(absl::StrCat("of its ", model_.scenes.size(),
                                           " scenes none is the default; read was ", SceneText(0),
                                           ", not ", OtherScenesText(0)));
    }
    SIGHTLINE_RETURN_IF_ERROR(
        CheckExtensionsAt(absl::StrCat("scenes[", scene, "]"), model_.scenes[scene].extensions));
    for (int node : model_.scenes[scene].nodes) {
      SIGHTLINE_RETURN_IF_ERROR(AddTree(node));
    }
    return absl::OkStatus();
  }

  // Checks the extensions of an object of the default scene.
  static absl::Status CheckExtensionsAt(const std::string& place,
                                        const tinygltf::ExtensionMap& extensions,
                                        std::initializer_list<std::string_view> obeyed = {}) {
    for (const auto& [name, value] : extensions) {
      if (ConcernsNoShape(name)) continue;
      if (std::find(obeyed.begin(), obeyed.end(), name) != obeyed.end()) continue;
      return RefuseExtension(place, name);
    }
    return absl::OkStatus();
  }

  // KHR_node_visibility: false hides a node and all below it.
  static bool IsVisible(const tinygltf::Node& node) {
    const auto found = node.extensions.find("KHR_node_visibility");
    if (found == node.extensions.end() || !found->second.Has("visible")) return true;
    const tinygltf::Value& visible = found->second.Get("visible");
    return !visible.IsBool() || visible.Get<bool>();
  }

  // The places of a node's mesh, relative to the node: one, or those of EXT_mesh_gpu_instancing.
  absl::StatusOr<std::vector<Eigen::Affine3d>> InstancesOf(const tinygltf::Node& node,
                                                           int index) const {
    const auto extension = node.extensions.find("EXT_mesh_gpu_instancing");
    if (extension == node.extensions.end()) {
      return std::vector<Eigen::Affine3d>{Eigen::Affine3d::Identity()};
    }
    const std::string name = absl::StrCat("nodes[", index, "].EXT_mesh_gpu_instancing");
    const auto read = [&](const char* attribute, size_t components,
                          bool or_integers) -> absl::StatusOr<std::vector<double>> {
      const tinygltf::Value& attributes = extension->second.Get("attributes");
      if (!attributes.IsObject() || !attributes.Has(attribute)) return std::vector<double>();
      const tinygltf::Value& accessor = attributes.Get(attribute);
      return ReadAccessor<double>(accessor.IsInt() ? accessor.Get<int>() : -1, name, components,
                                  or_integers ? kFloatOrNormalised : kFloatOnly);
    };
    SIGHTLINE_ASSIGN_OR_RETURN(const auto translations, read("TRANSLATION", 3, false));
    SIGHTLINE_ASSIGN_OR_RETURN(const auto rotations, read("ROTATION", 4, true));
    SIGHTLINE_ASSIGN_OR_RETURN(const auto scales, read("SCALE", 3, false));
    const size_t count =
        std::max({translations.size() / 3, rotations.size() / 4, scales.size() / 3});
    for (const size_t have : {translations.size() / 3, rotations.size() / 4, scales.size() / 3}) {
      if (count == 0 || (have != 0 && have != count)) {
        return Refuse(name + ": its attributes do not have the same number of instances");
      }
    }
    std::vector<Eigen::Affine3d> instances(count, Eigen::Affine3d::Identity());
    for (size_t i = 0; i < count; ++i) {
      if (!translations.empty()) {
        instances[i].translate(Eigen::Map<const Eigen::Vector3d>(&translations[3 * i]));
      }
      if (!rotations.empty()) {
        const double* q = &rotations[4 * i];
        const Eigen::Quaterniond rotation(q[3], q[0], q[1], q[2]);
        if (!(std::abs(rotation.norm() - 1) < 0.01)) {
          return Refuse(absl::StrCat(name, ": rotation ", i, " is no unit quaternion"));
        }
        instances[i].rotate(rotation.normalized());
      }
      if (!scales.empty()) {
        instances[i].scale(Eigen::Map<const Eigen::Vector3d>(&scales[3 * i]));
      }
    }
    return instances;
  }

  absl::Status AddTree(int root) {
    std::vector<std::pair<int, Eigen::Affine3d>> open = {{root, Eigen::Affine3d::Identity()}};
    while (!open.empty()) {
      const auto [index, parent] = open.back();
      open.pop_back();
      if (index < 0 || static_cast<size_t>(index) >= model_.nodes.size()) {
        return Refuse(absl::StrCat("nodes[", index, "] does not exist"));
      }
      // The nodes of glTF are trees; this also stops cycles and exponential growth.
      if (visited_[index]) return Refuse(absl::StrCat("nodes[", index, "] has several parents"));
      visited_[index] = true;
      const tinygltf::Node& node = model_.nodes[index];
      if (!IsVisible(node)) continue;
      SIGHTLINE_RETURN_IF_ERROR(
          CheckExtensionsAt(absl::StrCat("nodes[", index, "]"), node.extensions,
                            {"EXT_mesh_gpu_instancing", "KHR_node_visibility"}));
      SIGHTLINE_ASSIGN_OR_RETURN(Eigen::Affine3d local, LocalTransform(node, index));
      const Eigen::Affine3d transform = parent * local;
      if (node.mesh >= 0) {
        if (node.skin >= 0) {
          return Refuse(
              absl::StrCat("nodes[", index, "] is skinned: apply the pose and export again"));
        }
        SIGHTLINE_ASSIGN_OR_RETURN(const auto instances, InstancesOf(node, index));
        for (const Eigen::Affine3d& instance : instances) {
          SIGHTLINE_RETURN_IF_ERROR(AddMesh(node.mesh, transform * instance));
        }
      }
      for (auto child = node.children.rbegin(); child != node.children.rend(); ++child) {
        open.emplace_back(*child, transform);
      }
    }
    return absl::OkStatus();
  }

  static absl::StatusOr<Eigen::Affine3d> LocalTransform(const tinygltf::Node& node, int index) {
    const auto bad_size = [&](const char* field, size_t have, size_t need) {
      return Refuse(
          absl::StrCat("nodes[", index, "].", field, " has ", have, " numbers, must have ", need));
    };
    Eigen::Affine3d transform = Eigen::Affine3d::Identity();
    if (!node.matrix.empty()) {
      if (node.matrix.size() != 16) return bad_size("matrix", node.matrix.size(), 16);
      transform.matrix() = Eigen::Map<const Eigen::Matrix4d>(node.matrix.data());  // column-major
      if (transform.matrix().row(3) != Eigen::RowVector4d(0, 0, 0, 1)) {
        return Refuse(absl::StrCat("nodes[", index, "].matrix is not affine"));
      }
      return transform;
    }
    if (!node.translation.empty()) {
      if (node.translation.size() != 3) return bad_size("translation", node.translation.size(), 3);
      transform.translate(Eigen::Map<const Eigen::Vector3d>(node.translation.data()));
    }
    if (!node.rotation.empty()) {
      if (node.rotation.size() != 4) return bad_size("rotation", node.rotation.size(), 4);
      const Eigen::Quaterniond rotation(node.rotation[3], node.rotation[0], node.rotation[1],
                                        node.rotation[2]);
      if (!(std::abs(rotation.norm() - 1) < 1e-3)) {
        return Refuse(absl::StrCat("nodes[", index, "].rotation is no unit quaternion"));
      }
      transform.rotate(rotation.normalized());
    }
    if (!node.scale.empty()) {
      if (node.scale.size() != 3) return bad_size("scale", node.scale.size(), 3);
      transform.scale(Eigen::Map<const Eigen::Vector3d>(node.scale.data()));
    }
    return transform;
  }

  absl::Status AddMesh(int index, const Eigen::Affine3d& transform) {
    if (static_cast<size_t>(index) >= model_.meshes.size()) {
      return Refuse(absl::StrCat("meshes[", index, "] does not exist"));
    }
    const tinygltf::Mesh& mesh = model_.meshes[index];
    SIGHTLINE_RETURN_IF_ERROR(
        CheckExtensionsAt(absl::StrCat("meshes[", index, "]"), mesh.extensions));
    for (size_t i = 0; i < mesh.primitives.size(); ++i) {
      const std::string name = absl::StrCat("meshes[", index, "].primitives[", i, "]");
      SIGHTLINE_RETURN_IF_ERROR(AddPrimitive(mesh.primitives[i], name, transform));
    }
    return absl::OkStatus();
  }

  // The number types that an accessor may have.
  enum AllowedTypes { kFloatOnly, kFloatOrNormalised, kFloatOrSmallInteger, kIndices };

  static size_t BytesOfComponent(int type) {
    switch (type) {
      case TINYGLTF_COMPONENT_TYPE_BYTE:
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
        return 1;
      case TINYGLTF_COMPONENT_TYPE_SHORT:
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
        return 2;
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      case TINYGLTF_COMPONENT_TYPE_FLOAT:
        return 4;
      default:
        return 0;
    }
  }

  static bool IsAllowed(const tinygltf::Accessor& accessor, AllowedTypes types) {
    const int type = accessor.componentType;
    const bool is_float = type == TINYGLTF_COMPONENT_TYPE_FLOAT;
    const bool is_small = BytesOfComponent(type) == 1 || BytesOfComponent(type) == 2;
    switch (types) {
      case kFloatOnly:
        return is_float;
      case kFloatOrNormalised:
        return is_float || (is_small && accessor.normalized);
      case kFloatOrSmallInteger:
        return is_float || is_small;
      case kIndices:
        return !accessor.normalized && (type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE ||
                                        type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ||
                                        type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT);
    }
    return false;
  }

  // A number as 3.11 of the specification decodes it.
  template <typename T>
  static T NumberAt(const unsigned char* bytes, int type, bool normalised) {
    uint32_t word = 0;
    for (size_t i = BytesOfComponent(type); i > 0; --i) word = word << 8 | bytes[i - 1];
    const auto integer = [normalised](double value, double largest) {
      return static_cast<T>(normalised ? std::max(value / largest, -1.0) : value);
    };
    switch (type) {
      case TINYGLTF_COMPONENT_TYPE_BYTE:
        return integer(static_cast<int8_t>(word), 127);
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
        return integer(word, 255);
      case TINYGLTF_COMPONENT_TYPE_SHORT:
        return integer(static_cast<int16_t>(word), 32767);
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
        return integer(word, 65535);
      case TINYGLTF_COMPONENT_TYPE_FLOAT:
        return static_cast<T>(std::bit_cast<float>(word));
      default:
        return static_cast<T>(word);
    }
  }

  // `count` elements in a buffer view, all inside its buffer.
  struct View {
    const unsigned char* data = nullptr;
    size_t stride = 0;
  };

  absl::StatusOr<View> ViewOf(int buffer_view, size_t byte_offset, size_t count,
                              size_t element_size, const std::string& name) const {
    const auto bad = [&](const std::string& reason) {
      return Refuse(absl::StrCat(name, " ", reason));
    };
    if (buffer_view < 0 || static_cast<size_t>(buffer_view) >= model_.bufferViews.size()) {
      return bad("has no buffer view");
    }
    const tinygltf::BufferView& view = model_.bufferViews[buffer_view];
    // Without the word "required" the bytes are there uncompressed as well.
    SIGHTLINE_RETURN_IF_ERROR(
        CheckExtensionsAt(absl::StrCat("bufferViews[", buffer_view, "]"), view.extensions,
                          {"EXT_meshopt_compression", "KHR_meshopt_compression"}));
    if (view.buffer < 0 || static_cast<size_t>(view.buffer) >= model_.buffers.size()) {
      return bad("has no buffer");
    }
    const std::vector<unsigned char>& buffer = model_.buffers[view.buffer].data;
    const size_t stride = view.byteStride == 0 ? element_size : view.byteStride;
    if (stride < element_size || stride > 252) {
      return bad(absl::StrCat("has stride ", stride, ", must be in [", element_size, ", 252]"));
    }
    if (count == 0) return bad("is empty");
    // Written so that nothing can overflow.
    const bool inside =
        view.byteOffset <= buffer.size() && view.byteLength <= buffer.size() - view.byteOffset &&
        byte_offset <= view.byteLength && element_size <= view.byteLength - byte_offset &&
        count - 1 <= (view.byteLength - byte_offset - element_size) / stride;
    if (!inside) return bad("reaches beyond its buffer (truncated file?)");
    return View{buffer.data() + view.byteOffset + byte_offset, stride};
  }

  static size_t ComponentsOf(int type) {
    return type == TINYGLTF_TYPE_SCALAR ? 1
           : type == TINYGLTF_TYPE_VEC3 ? 3
           : type == TINYGLTF_TYPE_VEC4 ? 4
                                        : 0;
  }

  // All numbers of an accessor, sparse ones too. `owner` is for messages.
  template <typename T>
  absl::StatusOr<std::vector<T>> ReadAccessor(int index, const std::string& owner,
                                              size_t components, AllowedTypes types) const {
    // A sparse accessor may have no values of its own, so its count is not limited by bytes.
    constexpr size_t kMostZeros = 1'000'000;
    const std::string name = absl::StrCat(owner, ": accessors[", index, "]");
    if (index < 0 || static_cast<size_t>(index) >= model_.accessors.size()) {
      return Refuse(name + " does not exist");
    }
    const tinygltf::Accessor& accessor = model_.accessors[index];
    SIGHTLINE_RETURN_IF_ERROR(CheckExtensionsAt(name, accessor.extensions));
    const int type = accessor.componentType;
    if (ComponentsOf(accessor.type) != components || !IsAllowed(accessor, types)) {
      return Refuse(
          absl::StrCat(name, " has type ", accessor.type, " of components ", type,
                       accessor.normalized ? " (normalised)" : "", ", must be ",
                       components == 1 ? "scalar" : absl::StrCat(components, " numbers"), ", ",
                       types == kIndices     ? "unsigned 8, 16 or 32 bit"
                       : types == kFloatOnly ? "32-bit float (integers need KHR_mesh_quantization)"
                       : types == kFloatOrNormalised ? "32-bit float or normalised 8 or 16 bit"
                                                     : "32-bit float or 8 or 16 bit"));
    }
    const size_t size = BytesOfComponent(type), element = size * components;
    std::vector<T> values;
    if (accessor.bufferView < 0 && accessor.sparse.isSparse) {
      if (accessor.count > kMostZeros) {
        return Refuse(absl::StrCat(name, " has ", accessor.count,
                                   " elements without a buffer, at most ", kMostZeros,
                                   " are read"));
      }
      values.assign(accessor.count * components, T{});
    } else {
      SIGHTLINE_ASSIGN_OR_RETURN(const View view, ViewOf(accessor.bufferView, accessor.byteOffset,
                                                         accessor.count, element, name));
      values.reserve(accessor.count * components);
      for (size_t i = 0; i < accessor.count; ++i) {
        for (size_t k = 0; k < components; ++k) {
          values.push_back(
              NumberAt<T>(view.data + i * view.stride + k * size, type, accessor.normalized));
        }
      }
    }
    if (!accessor.sparse.isSparse) return values;

    // Replace some of them: sparse.indices says which.
    const auto& sparse = accessor.sparse;
    const int index_type = sparse.indices.componentType;
    const std::string sparse_name = name + ".sparse";
    if (index_type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE &&
        index_type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT &&
        index_type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT) {
      return Refuse(absl::StrCat(sparse_name, ".indices have component type ", index_type,
                                 ", must be unsigned 8, 16 or 32 bit"));
    }
    if (sparse.count < 1 || static_cast<size_t>(sparse.count) > accessor.count ||
        sparse.indices.byteOffset < 0 || sparse.values.byteOffset < 0) {
      return Refuse(
          absl::StrCat(sparse_name, " has ", sparse.count, " elements or a negative offset"));
    }
    const size_t count = static_cast<size_t>(sparse.count);
    const size_t index_size = BytesOfComponent(index_type);
    SIGHTLINE_ASSIGN_OR_RETURN(
        const auto indices,
        ViewOf(sparse.indices.bufferView, static_cast<size_t>(sparse.indices.byteOffset), count,
               index_size, sparse_name + ".indices"));
    SIGHTLINE_ASSIGN_OR_RETURN(
        const auto replaced,
        ViewOf(sparse.values.bufferView, static_cast<size_t>(sparse.values.byteOffset), count,
               element, sparse_name + ".values"));
    for (size_t i = 0, previous = 0; i < count; ++i) {
      const size_t at = NumberAt<uint32_t>(indices.data + i * indices.stride, index_type, false);
      if (at >= accessor.count || (i > 0 && at <= previous)) {
        return Refuse(absl::StrCat(sparse_name, ".indices: ", at,
                                   " is out of range or no larger than the one before"));
      }
      previous = at;
      for (size_t k = 0; k < components; ++k) {
        values[at * components + k] =
            NumberAt<T>(replaced.data + i * replaced.stride + k * size, type, accessor.normalized);
      }
    }
    return values;
  }

  absl::Status AddPrimitive(const tinygltf::Primitive& primitive, const std::string& name,
                            const Eigen::Affine3d& transform) {
    SIGHTLINE_RETURN_IF_ERROR(CheckStop(stop_));
    const int mode = primitive.mode == -1 ? TINYGLTF_MODE_TRIANGLES : primitive.mode;
    if (mode != TINYGLTF_MODE_TRIANGLES && mode != TINYGLTF_MODE_TRIANGLE_STRIP &&
        mode != TINYGLTF_MODE_TRIANGLE_FAN) {
      ++skipped_primitives_;  // points and lines are no surface
      return absl::OkStatus();
    }
    if (!primitive.targets.empty()) {
      return Refuse(name + " has morph targets: apply them and export again");
    }
    const auto attribute = primitive.attributes.find("POSITION");
    if (attribute == primitive.attributes.end()) return Refuse(name + " has no POSITION");
    SIGHTLINE_RETURN_IF_ERROR(
        CheckExtensionsAt(name, primitive.extensions, {"KHR_draco_mesh_compression"}));
    const bool quantised =
        std::find(model_.extensionsUsed.begin(), model_.extensionsUsed.end(),
                  "KHR_mesh_quantization") != model_.extensionsUsed.end() ||
        std::find(model_.extensionsRequired.begin(), model_.extensionsRequired.end(),
                  "KHR_mesh_quantization") != model_.extensionsRequired.end();
    SIGHTLINE_ASSIGN_OR_RETURN(
        const auto positions,
        ReadAccessor<double>(attribute->second, absl::StrCat(name, ".POSITION"), 3,
                             quantised ? kFloatOrSmallInteger : kFloatOnly));
    const size_t count = positions.size() / 3;

    SIGHTLINE_ASSIGN_OR_RETURN(std::vector<uint32_t> indices, Indices(primitive, count, name));
    if (mesh_.positions.size() + count > 3 * kMaxTriangles ||
        mesh_.triangles.size() + indices.size() > kMaxTriangles) {
      return Refuse(absl::StrCat("has more than ", kMaxTriangles, " triangles"));
    }

    const uint32_t base = static_cast<uint32_t>(mesh_.positions.size());
    mesh_.positions.reserve(mesh_.positions.size() + count);
    for (size_t i = 0; i < count; ++i) {
      mesh_.positions.push_back(transform * Eigen::Map<const Eigen::Vector3d>(&positions[3 * i]));
    }
    // A mirroring transform turns the triangles inside out.
    const bool flip = transform.linear().determinant() < 0;
    const auto add = [&](uint32_t a, uint32_t b, uint32_t c) {
      if (flip) std::swap(b, c);
      mesh_.triangles.push_back({base + a, base + b, base + c});
    };
    const std::vector<uint32_t>& v = indices;
    if (mode == TINYGLTF_MODE_TRIANGLES) {
      if (v.size() % 3 != 0) {
        return Refuse(absl::StrCat(name, " has ", v.size(), " corners, no multiple of 3"));
      }
      for (size_t i = 0; i + 2 < v.size(); i += 3) add(v[i], v[i + 1], v[i + 2]);
    } else if (mode == TINYGLTF_MODE_TRIANGLE_STRIP) {
      for (size_t i = 0; i + 2 < v.size(); ++i) {
        // A repeated index ends a strip and begins the next: no triangle of the part.
        if (v[i] == v[i + 1] || v[i + 1] == v[i + 2] || v[i] == v[i + 2]) continue;
        if (i % 2 == 0) {
          add(v[i], v[i + 1], v[i + 2]);
        } else {
          add(v[i], v[i + 2], v[i + 1]);
        }
      }
    } else {
      for (size_t i = 1; i + 1 < v.size(); ++i) add(v[i], v[i + 1], v[0]);
    }
    const bool has_material = primitive.material >= 0 &&
                              static_cast<size_t>(primitive.material) < model_.materials.size();
    mesh_.SetMaterialOfNewTriangles(has_material ? model_.materials[primitive.material].name : "");
    return absl::OkStatus();
  }

  absl::StatusOr<std::vector<uint32_t>> Indices(const tinygltf::Primitive& primitive,
                                                size_t vertex_count,
                                                const std::string& name) const {
    std::vector<uint32_t> indices;
    if (primitive.indices < 0) {
      indices.resize(vertex_count);
      for (size_t i = 0; i < vertex_count; ++i) indices[i] = static_cast<uint32_t>(i);
      return indices;
    }
    SIGHTLINE_ASSIGN_OR_RETURN(
        auto read,
        ReadAccessor<uint32_t>(primitive.indices, absl::StrCat(name, ".indices"), 1, kIndices));
    for (const uint32_t index : read) {
      if (index >= vertex_count) {
        return Refuse(absl::StrCat(name, ": index ", index, " is out of range, there are ",
                                   vertex_count, " vertices"));
      }
    }
    return read;
  }

  const tinygltf::Model& model_;
  const StopCheck& stop_;
  std::vector<bool> visited_;
  RawMesh mesh_;
  size_t skipped_primitives_ = 0;
};

// `load` calls tinygltf.
template <typename Load>
absl::StatusOr<RawMesh> LoadModel(tinygltf::TinyGLTF& loader, const StopCheck& stop, Load load) {
  SIGHTLINE_RETURN_IF_ERROR(CheckStop(stop));
  loader.SetImageLoader(IgnoreImage, nullptr);
  tinygltf::Model model;
  std::string error, warning;
  try {
    if (!load(&model, &error, &warning)) {
      // A required extension, for example of compressed buffers, may be why.
      SIGHTLINE_RETURN_IF_ERROR(CheckRequiredExtensions(model.extensionsRequired));
      return Refuse(absl::StrCat("cannot be parsed: ", OneLine(error)));
    }
  } catch (const std::bad_alloc&) {
    throw;  // not the file's fault: the caller says so
  } catch (const std::exception& e) {
    return Refuse(absl::StrCat("cannot be parsed: ", OneLine(e.what())));
  }
  return Converter(model, stop).Convert();
}

}  // namespace

absl::StatusOr<RawMesh> ReadGlb(std::string_view bytes, const StopCheck& stop) {
  if (bytes.size() < 20 || bytes.substr(0, 4) != "glTF") {
    return Refuse("is no GLB file or is truncated in its header");
  }
  const auto word = [&](size_t at) {
    uint32_t value = 0;
    for (int i = 3; i >= 0; --i) value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
    return value;
  };
  if (word(4) != 2) return Refuse(absl::StrCat("is glTF version ", word(4), ", must be 2"));
  if (word(8) > bytes.size() || word(12) > bytes.size() - 20) {
    return Refuse(absl::StrCat("truncated: claims ", word(8), " bytes, has ", bytes.size()));
  }
  if (word(8) < bytes.size()) {
    return Refuse(absl::StrCat("too long: claims ", word(8), " bytes, has ", bytes.size()));
  }
  // Chunks: JSON, then perhaps BIN, then perhaps others, which the specification says to ignore.
  constexpr uint32_t kJsonChunk = 0x4e4f534a, kBinaryChunk = 0x004e4942;
  uint64_t binary_bytes = 0;
  size_t at = 12;
  for (size_t chunk = 0; at < bytes.size(); ++chunk) {
    if (bytes.size() - at < 8 || word(at) > bytes.size() - at - 8) {
      return Refuse(
          absl::StrCat("truncated or damaged: chunk ", chunk, " reaches beyond the file"));
    }
    const uint32_t type = word(at + 4);
    if ((chunk == 0) != (type == kJsonChunk) || (chunk != 1 && type == kBinaryChunk)) {
      return Refuse(absl::StrCat("chunk ", chunk, " is of a type that does not belong there"));
    }
    if (type == kBinaryChunk) binary_bytes = word(at);
    at += 8 + size_t{word(at)};
  }
  SIGHTLINE_RETURN_IF_ERROR(CheckJson(bytes.substr(20, word(12)), nullptr, binary_bytes));
  tinygltf::TinyGLTF loader;
  loader.SetFsCallbacks({NoSuchFile, SamePath, ReadNoFile, WriteNoFile, nullptr});
  const auto load = [&](tinygltf::Model* model, std::string* error, std::string* warning) {
    return loader.LoadBinaryFromMemory(model, error, warning,
                                       reinterpret_cast<const unsigned char*>(bytes.data()),
                                       static_cast<unsigned int>(bytes.size()));
  };
  return LoadModel(loader, stop, load);
}

absl::StatusOr<RawMesh> ReadGltfFile(std::string_view bytes, const std::string& path,
                                     const StopCheck& stop) {
  SIGHTLINE_ASSIGN_OR_RETURN(const std::string_view text, WithoutByteOrderMark(bytes));
  const std::string_view json = WithoutEndMarks(text);
  BufferFiles files;
  files.folder = std::filesystem::path(path).parent_path().string();
  SIGHTLINE_RETURN_IF_ERROR(CheckJson(json, &files.names, 0));
  tinygltf::TinyGLTF loader;
  loader.SetFsCallbacks({IsBufferFile, SamePath, ReadBufferFile, WriteNoFile, &files});
  const auto load = [&](tinygltf::Model* model, std::string* error, std::string* warning) {
    return loader.LoadASCIIFromString(model, error, warning, json.data(),
                                      static_cast<unsigned int>(json.size()), files.folder);
  };
  return LoadModel(loader, stop, load);
}

}  // namespace sightline
