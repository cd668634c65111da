// SPDX-License-Identifier: Apache-2.0
// Files that a question depends on: an inspection and every file that it refers to, directly or
// through other files (sensor, materials and their tables, buffers of glTF, meshes of URDF).
// Answers are stored under a digest of all their contents.
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

// The inspection itself comes first. Referenced files may be missing. INVALID_ARGUMENT or NOT_FOUND
// if the inspection cannot be read; INVALID_ARGUMENT also for more than kMostQuestionFiles.
absl::StatusOr<std::vector<QuestionFile>> FilesOfInspection(const std::string& inspection_file);

// Kind of a string field of an inspection: a file name or other text.
enum class TextField { kFile, kText, kUnknown };
// kUnknown: the field is missing from both tables of question_files.cpp. Every new field of the
// inspection messages must be added to one of them.
TextField KindOfTextField(const google::protobuf::FieldDescriptor& field);

// Contents of files at one moment. Two objects for the same files are equal if no byte has changed.
class FileContents {
 public:
  // A missing file has the content "none". INVALID_ARGUMENT if a file is not a regular file.
  static absl::StatusOr<FileContents> Of(std::vector<QuestionFile> files);

  // SHA-256 of the contents and the referring fields; folders of the files do not matter.
  std::string Digest() const;
  // ABORTED names the first file whose content has changed.
  absl::Status CheckUnchanged() const;

  const std::vector<QuestionFile>& files() const { return files_; }

 private:
  std::vector<QuestionFile> files_;
  std::vector<std::string> digests_;  // of each
};

}  // namespace sightline
