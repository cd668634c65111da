// SPDX-License-Identifier: Apache-2.0
// The files that a question depends on: an inspection and every file that it refers to, directly or
// through other files (sensor, materials and their tables, buffers of glTF, meshes of URDF).
// Answers are kept under the content of all of them.
#pragma once

#include <google/protobuf/descriptor.h>

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace sightline {

// A file and what refers to it: "tolerances.file", "obstacles[2].file", "--measured".
struct QuestionFile {
  std::string named_by;
  std::string path;
};

// More files than any inspection has.
inline constexpr size_t kMostQuestionFiles = 100'000;

// The inspection itself comes first. Files that are referred to need not exist. INVALID_ARGUMENT,
// NOT_FOUND: the inspection cannot be read. INVALID_ARGUMENT also for more than kMostQuestionFiles.
absl::StatusOr<std::vector<QuestionFile>> FilesOfInspection(const std::string& inspection_file);

// Kind of a string field of an inspection: whether it names a file.
enum class TextField { kFile, kText, kUnknown };
// kUnknown: the field is in neither of the two tables of question_files.cpp. Fields that are added
// to the messages of inspections belong into one of them.
TextField KindOfTextField(const google::protobuf::FieldDescriptor& field);

// The content of files at one moment. Two of the same files are equal where no byte has changed.
class FileContents {
 public:
  // A file that is not there has the content "none". INVALID_ARGUMENT: one is no regular file.
  static absl::StatusOr<FileContents> Of(std::vector<QuestionFile> files);

  // SHA-256 of the contents with what refers to each; the folders of the files do not count.
  std::string Digest() const;
  // ABORTED names the first file whose content is another one than it was.
  absl::Status CheckUnchanged() const;

  const std::vector<QuestionFile>& files() const { return files_; }

 private:
  std::vector<QuestionFile> files_;
  std::vector<std::string> digests_;  // of each
};

}  // namespace sightline
