// SPDX-License-Identifier: Apache-2.0
// The bytes of a STEP file (ISO 10303-21, clear text), read once. Everything that the importer says
// of a file comes from these bytes, whatever happens to the file on disk meanwhile.
#pragma once

#include <filesystem>
#include <streambuf>
#include <string>
#include <string_view>

namespace sightline {

struct StepText {
  std::string name;  // name of the file in messages
  std::string text;  // from ISO-10303-21; to END-ISO-10303-21;
};

// Reads a file. Throws StepInputError if there is no such file, if it cannot be read, or as
// CheckedStepText.
StepText ReadStepText(const std::filesystem::path& file);

// Reads standard input to its end, and calls it `name`.
StepText ReadStepTextFromInput(const std::string& name);

// Looks for the marks at both ends of an exchange structure, for OpenCASCADE reads a truncated file
// as far as it goes and calls that success. Leaves out a byte order mark and what may stand behind
// the end mark: white space, NUL, Ctrl-Z, and the signature sections of edition 3. Throws
// StepInputError if a mark is missing, if anything else stands behind the end, or if the text is
// larger than 2 GiB.
StepText CheckedStepText(std::string name, std::string bytes);

// A stream over text that somebody else keeps.
class TextBuffer : public std::streambuf {
 public:
  explicit TextBuffer(std::string_view text) {
    char* begin = const_cast<char*>(text.data());  // a get area is never written
    setg(begin, begin, begin + text.size());
  }
};

}  // namespace sightline
