// SPDX-License-Identifier: Apache-2.0
#include "planner_client/kept_answers/question_files.h"

#include <google/protobuf/descriptor.pb.h>
#include <google/protobuf/message.h>

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <filesystem>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string_view>
#include <system_error>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/digest/sha256.h"
#include "core/file/read_file.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"
#include "sightline/v1/inspection.pb.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

// Kind of a file, which determines what files it may refer to.
enum class Contains { kNothingMore, kMesh, kRobot, kSensor, kMaterial };

struct FileField {
  std::string_view name;  // MESSAGE.field
  Contains contains;
};

// Every field of an inspection that names a file.
constexpr FileField kFileFields[] = {
    {"Camera.sensor_file", Contains::kSensor},
    {"Conductor.refractive_index_file", Contains::kNothingMore},
    {"HeightField.file", Contains::kNothingMore},
    {"MaterialAssignment.file", Contains::kMaterial},
    {"MeasuredTable.file", Contains::kNothingMore},
    {"Merl.file", Contains::kNothingMore},
    {"Obstacle.file", Contains::kMesh},
    {"PartSource.file", Contains::kMesh},
    {"Robot.urdf", Contains::kRobot},
    {"ToleranceRequirements.file", Contains::kNothingMore},
};

// Every other text of an inspection.
constexpr std::string_view kTextFields[] = {
    "AcceptanceLimit.quantity",
    "AreaLight.name",
    "DetectabilityOfMaterial.part_material",
    "Effect.effect",
    "Inspection.defaults",
    "Inspection.name",
    "Material.name",
    "MaterialAssignment.part_material",
    "Obstacle.name",
    "Obstacle.unit",
    "PartSource.unit",
    "RestingOrientation.name",
    "Robot.base_link",
    "Robot.tip_link",
    "Sensor.mount",
    "Sensor.name",
    "Sensor.sensor_type",
    "Sensor.source",
    "SourceSpectrum.illuminant",
    "TargetRegion.name",
    "ToleranceRequirements.unit",
    "TolerancedRegion.materials",
    "TolerancedRegion.name",
};

// Files that are searched for names of further files. Readers refuse longer ones (glTF's JSON,
// URDF).
constexpr uint64_t kMostSearchedBytes = 64 << 20;

constexpr std::pair<std::string_view, char> kXmlEntities[] = {
    {"amp", '&'}, {"lt", '<'}, {"gt", '>'}, {"quot", '"'}, {"apos", '\''}};

void AppendUtf8(uint32_t code, std::string* text) {
  const auto byte = [&](uint32_t value) { *text += static_cast<char>(value); };
  const auto more = [&](uint32_t value) { byte(0x80 | (value & 0x3f)); };
  if (code < 0x80) {
    byte(code);
  } else if (code < 0x800) {
    byte(0xc0 | code >> 6);
    more(code);
  } else if (code < 0x10000) {
    byte(0xe0 | code >> 12);
    more(code >> 6);
    more(code);
  } else if (code < 0x110000) {
    byte(0xf0 | code >> 18);
    more(code >> 12);
    more(code >> 6);
    more(code);
  }
}

std::string FieldName(const FieldDescriptor& field) {
  return absl::StrCat(field.containing_type()->name(), ".", field.name());
}

const FileField* FindFileField(const FieldDescriptor& field) {
  const std::string name = FieldName(field);
  const auto* const found =
      std::find_if(std::begin(kFileFields), std::end(kFileFields),
                   [&](const FileField& known) { return known.name == name; });
  return found == std::end(kFileFields) ? nullptr : found;
}

// Collects the strings with the key "uri" in a JSON text: buffers of a glTF file, and images, which
// are superfluous but harmless. For damaged text, collects those before the damage; its reader
// rejects it.
class UriCollector : public nlohmann::json_sax<nlohmann::json> {
 public:
  std::vector<std::string> uris;

  bool null() override { return Other(); }
  bool boolean(bool) override { return Other(); }
  bool number_integer(number_integer_t) override { return Other(); }
  bool number_unsigned(number_unsigned_t) override { return Other(); }
  bool number_float(number_float_t, const string_t&) override { return Other(); }
  bool string(string_t& value) override {
    if (is_uri_) uris.push_back(value);
    is_uri_ = false;
    return uris.size() <= kMostQuestionFiles;
  }
  bool binary(binary_t&) override { return Other(); }
  bool key(string_t& name) override {
    is_uri_ = name == "uri";
    return true;
  }
  bool start_object(size_t) override { return Other(); }
  bool start_array(size_t) override { return Other(); }
  bool end_object() override { return Other(); }
  bool end_array() override { return Other(); }
  bool parse_error(size_t, const std::string&, const nlohmann::detail::exception&) override {
    return false;
  }

 private:
  bool Other() {
    is_uri_ = false;
    return true;
  }

  bool is_uri_ = false;
};

std::vector<std::string> UrisOfJson(const std::string& text) {
  UriCollector collector;
  nlohmann::json::sax_parse(text, &collector);
  return std::move(collector.uris);
}

// The character that "#47" or "#x2f" stands for.
std::optional<uint32_t> CodeOfEntity(std::string_view name) {
  if (!name.starts_with('#')) return std::nullopt;
  name.remove_prefix(1);
  const bool hexadecimal = name.starts_with('x');
  if (hexadecimal) name.remove_prefix(1);
  uint32_t code = 0;
  const char* const end = name.data() + name.size();
  const auto read = std::from_chars(name.data(), end, code, hexadecimal ? 16 : 10);
  if (read.ec != std::errc() || read.ptr != end) return std::nullopt;
  return code;
}

// The text of an attribute's value: &amp; and &#47; stand for characters.
std::string WithoutEntities(std::string_view value) {
  std::string text;
  for (size_t at = 0; at < value.size();) {
    const size_t end = value[at] == '&' ? value.find(';', at) : std::string_view::npos;
    const std::string_view name =
        end == std::string_view::npos ? "" : value.substr(at + 1, end - at - 1);
    const auto* const known = std::find_if(
        std::begin(kXmlEntities), std::end(kXmlEntities),
        [&](const std::pair<std::string_view, char>& entity) { return entity.first == name; });
    const std::optional<uint32_t> code = CodeOfEntity(name);
    if (known != std::end(kXmlEntities)) {
      text += known->second;
    } else if (code) {
      AppendUtf8(*code, &text);
    } else {
      text += value[at++];
      continue;
    }
    at = end + 1;
  }
  return text;
}

// Values of an XML attribute, as filename="a.stl". Values in comments are superfluous but
// harmless.
std::vector<std::string> ValuesOfAttribute(std::string_view text, std::string_view key) {
  std::vector<std::string> values;
  for (size_t at = text.find(key); at != std::string_view::npos; at = text.find(key, at)) {
    at += key.size();
    const auto skip_blanks = [&] {
      while (at < text.size() && absl::ascii_isspace(static_cast<unsigned char>(text[at]))) ++at;
    };
    skip_blanks();
    if (at >= text.size() || text[at] != '=') continue;
    ++at;
    skip_blanks();
    if (at >= text.size() || (text[at] != '"' && text[at] != '\'')) continue;
    const size_t end = text.find(text[at], at + 1);
    if (end == std::string_view::npos) break;
    values.push_back(WithoutEntities(text.substr(at + 1, end - at - 1)));
    at = end + 1;
    if (values.size() > kMostQuestionFiles) break;
  }
  return values;
}

// %20 in names of URIs.
std::string WithoutPercent(const std::string& uri) {
  std::string name;
  for (size_t i = 0; i < uri.size(); ++i) {
    const auto hex = [&](size_t k) {
      return k < uri.size() && absl::ascii_isxdigit(static_cast<unsigned char>(uri[k]));
    };
    if (uri[i] == '%' && hex(i + 1) && hex(i + 2)) {
      name += static_cast<char>(std::stoi(uri.substr(i + 1, 2), nullptr, 16));
      i += 2;
    } else {
      name += uri[i];
    }
  }
  return name;
}

class FileList {
 public:
  void Add(const std::string& named_by, const std::string& path, Contains contains) {
    if (full() || !known_.insert(path).second) return;
    files_.push_back({named_by, path});
    switch (contains) {
      case Contains::kNothingMore:
        return;
      case Contains::kMesh:
        return AddBuffers(named_by, path);
      case Contains::kRobot:
        return AddMeshesOfRobot(named_by, path);
      case Contains::kSensor: {
        v1::Sensor sensor;
        return AddMessage(named_by, path, &sensor);
      }
      case Contains::kMaterial: {
        v1::Material material;
        return AddMessage(named_by, path, &material);
      }
    }
  }

  // The files that fields of a message refer to, relative to `folder`.
  void Walk(const Message& message, const std::string& path, const fs::path& folder) {
    std::vector<const FieldDescriptor*> fields;
    message.GetReflection()->ListFields(message, &fields);
    for (const FieldDescriptor* field : fields) {
      const auto* const reflection = message.GetReflection();
      const int count = field->is_repeated() ? reflection->FieldSize(message, field) : 1;
      for (int i = 0; i < count && !full(); ++i) {
        std::string place = absl::StrCat(path, path.empty() ? "" : ".", field->name());
        if (field->is_repeated()) absl::StrAppend(&place, "[", i, "]");
        if (field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
          Walk(field->is_repeated() ? reflection->GetRepeatedMessage(message, field, i)
                                    : reflection->GetMessage(message, field),
               place, folder);
          continue;
        }
        if (field->cpp_type() != FieldDescriptor::CPPTYPE_STRING) continue;
        const FileField* const known = FindFileField(*field);
        const std::string file = field->is_repeated()
                                     ? reflection->GetRepeatedString(message, field, i)
                                     : reflection->GetString(message, field);
        if (known == nullptr || file.empty()) continue;
        Add(place, (folder / file).lexically_normal().string(), known->contains);
      }
    }
  }

  bool full() const { return files_.size() > kMostQuestionFiles; }
  std::vector<QuestionFile>& files() { return files_; }

 private:
  // Files that cannot be read refer to nothing; their users report the error.
  void AddMessage(const std::string& named_by, const std::string& path, Message* message) {
    if (!ReadStrictJsonFile(path, message).ok()) return;
    Walk(*message, named_by, fs::path(path).parent_path());
  }
  void AddBuffers(const std::string& named_by, const std::string& path) {
    if (!absl::EqualsIgnoreCase(fs::path(path).extension().string(), ".gltf")) return;
    const auto text = ReadRegularFile(path, kMostSearchedBytes);
    if (!text.ok()) return;
    for (const std::string& uri : UrisOfJson(*text)) {
      if (uri.starts_with("data:")) continue;
      const std::string name = WithoutPercent(uri);
      Add(absl::StrCat(named_by, " uri ", name),
          (fs::path(path).parent_path() / name).lexically_normal().string(),
          Contains::kNothingMore);
    }
  }
  void AddMeshesOfRobot(const std::string& named_by, const std::string& path) {
    const auto text = ReadRegularFile(path, kMostSearchedBytes);
    if (!text.ok()) return;
    for (const std::string& name : ValuesOfAttribute(*text, "filename")) {
      Add(absl::StrCat(named_by, " mesh ", name),
          (fs::path(path).parent_path() / name).lexically_normal().string(), Contains::kMesh);
    }
  }

  std::vector<QuestionFile> files_;
  std::set<std::string> known_;
};

absl::StatusOr<std::string> ContentDigest(const std::string& path) {
  const auto digest = DigestOfFile(path);
  if (digest.ok()) return digest->sha256;
  if (absl::IsNotFound(digest.status())) return std::string("none");
  return digest.status();
}

}  // namespace

TextField KindOfTextField(const FieldDescriptor& field) {
  if (FindFileField(field) != nullptr) return TextField::kFile;
  const bool text = field.containing_type()->options().map_entry() ||
                    std::find(std::begin(kTextFields), std::end(kTextFields), FieldName(field)) !=
                        std::end(kTextFields);
  return text ? TextField::kText : TextField::kUnknown;
}

absl::StatusOr<std::vector<QuestionFile>> FilesOfInspection(const std::string& inspection_file) {
  v1::Inspection inspection;
  SIGHTLINE_RETURN_IF_ERROR(ReadStrictJsonFile(inspection_file, &inspection));
  FileList list;
  list.Add("inspection", inspection_file, Contains::kNothingMore);
  list.Walk(inspection, "", fs::path(inspection_file).parent_path());
  if (list.full()) {
    return absl::InvalidArgumentError(
        absl::StrCat(inspection_file, ": refers to more than ", kMostQuestionFiles, " files"));
  }
  return std::move(list.files());
}

absl::StatusOr<FileContents> FileContents::Of(std::vector<QuestionFile> files) {
  FileContents contents;
  contents.files_ = std::move(files);
  for (const QuestionFile& file : contents.files_) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto digest, ContentDigest(file.path));
    contents.digests_.push_back(std::move(digest));
  }
  return contents;
}

std::string FileContents::Digest() const {
  Sha256 digest;
  for (size_t i = 0; i < files_.size(); ++i) {
    // Lengths come first, so that no two lists have the same bytes.
    digest.Update(absl::StrCat(files_[i].named_by.size(), " ", files_[i].named_by, " ",
                               digests_[i].size(), " ", digests_[i], "\n"));
  }
  return digest.Hex();
}

absl::Status FileContents::CheckUnchanged() const {
  for (size_t i = 0; i < files_.size(); ++i) {
    const auto now = ContentDigest(files_[i].path);
    if (!now.ok()) return now.status();
    if (*now == digests_[i]) continue;
    return absl::AbortedError(absl::StrCat(files_[i].path, " (", files_[i].named_by,
                                           "): has changed while it was read; start again"));
  }
  return absl::OkStatus();
}

}  // namespace sightline
