// SPDX-License-Identifier: Apache-2.0
#include "planning_service/http/multipart_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <utility>
#include <vector>

#include "core/status/status_macros.h"

namespace sightline {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

struct ReadPart {
  std::string name;
  std::string filename;
  std::string content;
  friend bool operator==(const ReadPart&, const ReadPart&) = default;
};

// All parts of `body`, given to the reader in pieces of `piece_bytes`.
absl::StatusOr<std::vector<ReadPart>> ReadAll(const std::string& body, size_t piece_bytes) {
  size_t offset = 0;
  MultipartReader reader("XYZ", [&]() -> absl::StatusOr<std::string> {
    const std::string piece = body.substr(std::min(offset, body.size()), piece_bytes);
    offset += piece.size();
    return piece;
  });
  std::vector<ReadPart> parts;
  for (;;) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto part, reader.NextPart());
    if (!part.has_value()) return parts;
    ReadPart read{part->name, part->filename, ""};
    for (;;) {
      SIGHTLINE_ASSIGN_OR_RETURN(auto piece, reader.Read());
      if (piece.empty()) break;
      read.content += piece;
    }
    parts.push_back(read);
  }
}

TEST(MultipartReader, ReadsPartsWhereverTheBodyIsCut) {
  const std::string form =
      "--XYZ\r\nContent-Disposition: form-data; name=\"task\"\r\n\r\n{}\r\n--XYZ  \r\n"
      "content-disposition:form-data;filename=\"a \\\"b\\\" \\\\c\\d.stl\" ; name=file\r\n\r\n"
      "\r\n--XY\r\n-\r\r\n--XYZ\r\n"
      "Content-Disposition: form-data; name=\"empty\"; filename=\"x\"; "
      "filename*=UTF-8''na%C3%AFve.stl\r\n\r\n"
      "\r\n--XYZ--\r\nepilogue";
  for (size_t piece = 1; piece <= form.size(); ++piece) {
    const auto parts = ReadAll("preamble\r\n" + form, piece);
    ASSERT_TRUE(parts.ok()) << parts.status() << " in pieces of " << piece;
    ASSERT_THAT(*parts, ElementsAre(ReadPart{"task", "", "{}"},
                                    ReadPart{"file", "a \"b\" \\c\\d.stl", "\r\n--XY\r\n-\r"},
                                    ReadPart{"empty", "na\xc3\xafve.stl", ""}))
        << "in pieces of " << piece;
  }
}

// Browsers encode quotes and line ends in names, and nothing else.
TEST(MultipartReader, DecodesNamesAsBrowsersEncodeThem) {
  const auto parts = ReadAll(
      "--XYZ\r\nContent-Disposition: form-data; name=\"fi%22le\"; "
      "filename=\"3%22 bracket 50%25 %0D%0a.stl\"\r\n\r\n\r\n--XYZ--\r\n",
      100);
  ASSERT_TRUE(parts.ok()) << parts.status();
  EXPECT_THAT(*parts, ElementsAre(ReadPart{"fi\"le", "3\" bracket 50%25 \r\n.stl", ""}));
}

TEST(MultipartReader, ReadsAFormWithoutParts) {
  const auto parts = ReadAll("--XYZ--\r\n", 100);
  ASSERT_TRUE(parts.ok()) << parts.status();
  EXPECT_THAT(*parts, IsEmpty());
}

TEST(MultipartReader, LeavesOutWhatWasNotRead) {
  const std::string body =
      "--XYZ\r\nContent-Disposition: form-data; name=a\r\n\r\n" + std::string(100000, 'x') +
      "\r\n--XYZ\r\nContent-Disposition: form-data; name=b\r\n\r\ny\r\n--XYZ--";
  size_t offset = 0;
  MultipartReader reader("XYZ", [&]() -> absl::StatusOr<std::string> {
    const std::string piece = body.substr(offset, 1000);
    offset += piece.size();
    return piece;
  });
  EXPECT_EQ(reader.NextPart().value()->name, "a");
  EXPECT_EQ(reader.NextPart().value()->name, "b");
  EXPECT_EQ(reader.Read().value(), "y");
  EXPECT_EQ(reader.NextPart().value(), std::nullopt);
}

TEST(MultipartReader, NamesWhatIsWrong) {
  const std::string begin = "--XYZ\r\n";
  const std::string end = "\r\n\r\nx\r\n--XYZ--";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"", "ends before the last boundary"},
      {"no boundary at all", "ends before the last boundary"},
      {begin + "Content-Disposition: form-data; name=a\r\n\r\nx", "part 1: the body ends"},
      {begin + "Content-Disposition: form-data; name=a\r\n\r\nx\r\n--XYZ", "part 2: the body ends"},
      {begin + "Content-Type: text/plain" + end, "part 1: it has no name"},
      {begin + "Content-Disposition: form-data; name=\"\"" + end, "it has no name"},
      {begin + "Content-Disposition: form-data; name=\"a" + end, "cannot be read"},
      {begin + "Content-Disposition: form-data; name=a; x" + end, "cannot be read"},
      {begin + "Content-Disposition: attachment; name=a" + end, "must be form-data"},
      {begin + "Content-Disposition: form-data; name=a; filename*=latin1''x" + end, "filename*"},
      {begin + "Content-Disposition: form-data; name=a; filename*=UTF-8''%x" + end, "filename*"},
      {begin + "nonsense" + end, "no colon"},
      {begin + "X: " + std::string(20000, 'x') + end, "too long"},
      {"--XYZ nonsense\r\nContent-Disposition: form-data; name=a" + end, "end its line"},
      {"--XYZ" + std::string(20000, ' ') + end, "end its line"},
  };
  for (const auto& [body, reason] : cases) {
    for (const size_t piece : {size_t{1}, size_t{1000000}}) {
      const auto parts = ReadAll(body, piece);
      EXPECT_TRUE(absl::IsInvalidArgument(parts.status())) << body.substr(0, 200);
      EXPECT_THAT(std::string(parts.status().message()), HasSubstr(reason));
    }
  }
}

TEST(MultipartReader, GivesTheErrorsOfItsSource) {
  MultipartReader reader("XYZ", [] { return absl::CancelledError("gone"); });
  EXPECT_TRUE(absl::IsCancelled(reader.NextPart().status()));
}

TEST(MultipartBoundary, IsReadFromTheContentType) {
  EXPECT_EQ(MultipartBoundary("multipart/form-data; boundary=abc").value(), "abc");
  EXPECT_EQ(MultipartBoundary("multipart/form-data; charset=utf-8; Boundary=\"a b\"").value(),
            "a b");
  for (const std::string& wrong :
       {std::string("multipart/form-data"), std::string("multipart/form-data; boundary="),
        std::string("multipart/form-data; boundary=\"abc"),
        "multipart/form-data; boundary=" + std::string(71, 'a')}) {
    EXPECT_TRUE(absl::IsInvalidArgument(MultipartBoundary(wrong).status())) << wrong;
  }
}

}  // namespace
}  // namespace sightline
