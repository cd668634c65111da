// SPDX-License-Identifier: Apache-2.0
// Changing any byte of any file that an inspection can refer to changes the key of kept answers.
#include "planner_client/kept_answers/question_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <set>
#include <string>

#include "sightline/v1/inspection.pb.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

// A file that an inspection refers to, and the field that names it (empty: no field of a message
// does). A new reference joins by a line here and by its files in kFiles.
struct Reference {
  const char* field;
  const char* file;
};
constexpr Reference kReferences[] = {
    {"", "inspection.json"},
    {"PartSource.file", "part/box.gltf"},
    {"", "part/box 1.bin"},
    {"Obstacle.file", "clamp.gltf"},
    {"", "clamp.bin"},
    {"ToleranceRequirements.file", "box.stp"},
    {"Camera.sensor_file", "sensor.json"},
    {"Robot.urdf", "robot/arm.urdf"},
    {"", "robot/meshes/link.stl"},
    {"", "robot/meshes/link.gltf"},
    {"", "robot/meshes/link.bin"},
    {"MaterialAssignment.file", "materials/steel.json"},
    {"Conductor.refractive_index_file", "materials/steel.csv"},
    {"HeightField.file", "materials/heights.txt"},
    {"MeasuredTable.file", "brdf.csv"},
    {"Merl.file", "paint.binary"},
};

constexpr std::pair<const char*, const char*> kFiles[] = {
    {"inspection.json", R"({
      "part": {"file": "part/box.gltf"},
      "camera": {"sensor_file": "sensor.json"},
      "rig": {"robot": {"urdf": "robot/arm.urdf"}},
      "obstacles": [{"file": "clamp.gltf"}],
      "tolerances": {"file": "box.stp"},
      "materials": [
        {"file": "materials/steel.json"},
        {"part_material": "a", "material": {"measured_table": {"file": "brdf.csv"}}},
        {"part_material": "b", "material": {"merl": {"file": "paint.binary"}}}]
    })"},
    {"part/box.gltf", R"({"buffers": [{"byteLength": 1, "uri" : "box%201.bin"},
                                      {"uri": "data:application/octet-stream;base64,AA=="}]})"},
    {"part/box 1.bin", "1"},
    {"clamp.gltf", R"({"buffers":[{"uri":"clamp.bin"}]})"},
    {"clamp.bin", "2"},
    {"box.stp", "ISO-10303-21;"},
    {"sensor.json", R"({"name": "sensor"})"},
    {"robot/arm.urdf", R"(<robot><link><visual><mesh filename = 'meshes/link.gltf'/></visual>
      <collision><mesh filename="meshes/link.stl"/></collision></link></robot>)"},
    {"robot/meshes/link.stl", "solid"},
    {"robot/meshes/link.gltf", R"({"buffers": [{"uri": "link.bin"}]})"},
    {"robot/meshes/link.bin", "3"},
    {"materials/steel.json", R"({"conductor": {"refractive_index_file": "steel.csv"},
                                 "height_field": {"file": "heights.txt"}})"},
    {"materials/steel.csv", "500,1,1"},
    {"materials/heights.txt", "0 1"},
    {"brdf.csv", "0,0,0,1"},
    {"paint.binary", "4"},
};

class QuestionFilesTest : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_NE(mkdtemp(folder_.data()), nullptr);
    WriteAll(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  static void WriteAll(const std::string& folder) {
    for (const auto& [file, text] : kFiles) {
      const fs::path path = fs::path(folder) / file;
      fs::create_directories(path.parent_path());
      std::ofstream(path, std::ios::binary) << text;
    }
  }
  static FileContents ContentsIn(const std::string& folder) {
    const auto files = FilesOfInspection(folder + "/inspection.json");
    EXPECT_TRUE(files.ok()) << files.status();
    auto contents = FileContents::Of(*files);
    EXPECT_TRUE(contents.ok()) << contents.status();
    return *std::move(contents);
  }
  void Append(const std::string& file, const std::string& text) const {
    std::ofstream(folder_ + "/" + file, std::ios::binary | std::ios::app) << text;
  }

  std::string folder_ = "/tmp/sightline-question-XXXXXX";
};

TEST_F(QuestionFilesTest, EveryFileThatIsReferredToCounts) {
  std::set<std::string> found, expected;
  const FileContents contents = ContentsIn(folder_);
  for (const QuestionFile& file : contents.files()) {
    found.insert(fs::path(file.path).lexically_relative(folder_).string());
  }
  for (const Reference& reference : kReferences) expected.insert(reference.file);
  EXPECT_EQ(found, expected);
}

// The same names as their readers take, however JSON and XML write them.
TEST_F(QuestionFilesTest, NamesAreReadAsTheirReadersReadThem) {
  for (const auto& [json, file] :
       {std::pair(R"({"buffers": [{"uri": "b\/a.bin"}]})", "b/a.bin"),
        std::pair(R"({"buffers": [{"uri": "caf\u00e9.bin"}]})", "caf\u00e9.bin"),
        std::pair(R"({"buffers": [{"\u0075ri": "key.bin"}]})", "key.bin"),
        std::pair(R"({"buffers": [{"name": "\"uri\": \"no.bin\"", "uri":
                      "yes%2520.bin"}]})",
                  "yes%20.bin"),
        std::pair(R"({"buffers": [{"uri": "whole.bin"}], "extras": {"uri": ["no.bin"]}} )",
                  "whole.bin")}) {
    std::ofstream(folder_ + "/clamp.gltf") << json;
    std::set<std::string> names;
    const FileContents contents = ContentsIn(folder_);
    for (const QuestionFile& question : contents.files()) {
      names.insert(fs::path(question.path).lexically_relative(folder_).string());
    }
    EXPECT_TRUE(names.contains(file)) << json;
    EXPECT_FALSE(names.contains("no.bin")) << json;
  }
  for (const auto& [name, file] :
       {std::pair("a&amp;b.stl", "a&b.stl"), std::pair("&#97;&#x62;.stl", "ab.stl"),
        std::pair("&#xe9;.stl", "\u00e9.stl"), std::pair("a&b;.stl", "a&b;.stl")}) {
    std::ofstream(folder_ + "/robot/arm.urdf") << R"(<robot><link><collision><mesh filename=")"
                                               << name << R"("/></collision></link></robot>)";
    std::set<std::string> names;
    const FileContents contents = ContentsIn(folder_);
    for (const QuestionFile& question : contents.files()) {
      names.insert(fs::path(question.path).lexically_relative(folder_).string());
    }
    EXPECT_TRUE(names.contains(std::string("robot/") + file)) << name;
  }
}

TEST_F(QuestionFilesTest, AnyChangeOfAnyFileChangesTheKey) {
  std::set<std::string> keys = {ContentsIn(folder_).Digest()};
  for (const Reference& reference : kReferences) {
    const FileContents before = ContentsIn(folder_);
    EXPECT_TRUE(before.CheckUnchanged().ok());
    Append(reference.file, " ");
    const absl::Status changed = before.CheckUnchanged();
    EXPECT_EQ(changed.code(), absl::StatusCode::kAborted) << reference.file;
    EXPECT_THAT(std::string(changed.message()), HasSubstr(reference.file));
    EXPECT_TRUE(keys.insert(ContentsIn(folder_).Digest()).second) << reference.file;
    // A file that is gone is another content, too.
    if (reference.file == std::string("inspection.json")) continue;
    const fs::path path = fs::path(folder_) / reference.file;
    fs::rename(path, path.string() + "-away");
    const auto gone = FileContents::Of(before.files());
    ASSERT_TRUE(gone.ok()) << gone.status();
    EXPECT_TRUE(keys.insert(gone->Digest()).second) << reference.file;
    fs::rename(path.string() + "-away", path);
  }
}

// Jobs of a service run in folders of their own.
TEST_F(QuestionFilesTest, FoldersDoNotCount) {
  std::string other = "/tmp/sightline-question-XXXXXX";
  ASSERT_NE(mkdtemp(other.data()), nullptr);
  WriteAll(other);
  EXPECT_EQ(ContentsIn(other).Digest(), ContentsIn(folder_).Digest());
  fs::remove_all(other);
}

TEST_F(QuestionFilesTest, WhatIsNoFileIsRefused) {
  fs::remove(folder_ + "/box.stp");
  fs::create_directory(folder_ + "/box.stp");
  const auto files = FilesOfInspection(folder_ + "/inspection.json");
  ASSERT_TRUE(files.ok());
  EXPECT_FALSE(FileContents::Of(*files).ok());
  EXPECT_FALSE(FilesOfInspection(folder_ + "/none.json").ok());
}

// A field that is added to the messages of an inspection is known to name a file or not to, and one
// that names a file is in the table above.
TEST(QuestionFields, EveryTextOfAnInspectionIsKnown) {
  std::set<std::string> covered;
  for (const Reference& reference : kReferences) covered.insert(reference.field);
  std::set<const google::protobuf::Descriptor*> seen;
  int files = 0;
  const std::function<void(const google::protobuf::Descriptor*)> walk =
      [&](const google::protobuf::Descriptor* message) {
        if (!seen.insert(message).second) return;
        for (int i = 0; i < message->field_count(); ++i) {
          const google::protobuf::FieldDescriptor& field = *message->field(i);
          if (field.cpp_type() == google::protobuf::FieldDescriptor::CPPTYPE_MESSAGE) {
            walk(field.message_type());
          }
          if (field.cpp_type() != google::protobuf::FieldDescriptor::CPPTYPE_STRING) continue;
          EXPECT_NE(KindOfTextField(field), TextField::kUnknown) << field.full_name();
          if (KindOfTextField(field) != TextField::kFile) continue;
          ++files;
          EXPECT_EQ(covered.count(message->name() + "." + field.name()), 1u) << field.full_name();
        }
      };
  walk(v1::Inspection::descriptor());
  EXPECT_EQ(files, static_cast<int>(covered.size()) - 1);  // one is empty
}

}  // namespace
}  // namespace sightline
