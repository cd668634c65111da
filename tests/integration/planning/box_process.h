// SPDX-License-Identifier: Apache-2.0
// `sightline` as a process on a box, in a folder of its own.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/json/strict_json.h"
#include "tests/integration/run_process.h"

namespace sightline {

class BoxProcessTest : public ::testing::Test {
 protected:
  // `inspection` names the part's file box.obj; unit: mm.
  explicit BoxProcessTest(const char* inspection) : inspection_(inspection) {}

  void SetUp() override {
    ASSERT_NE(mkdtemp(folder_.data()), nullptr);
    // 60 x 40 x 20 mm.
    Write("box.obj", R"(v 0 0 0
v 60 0 0
v 60 40 0
v 0 40 0
v 0 0 20
v 60 0 20
v 60 40 20
v 0 40 20
f 1 4 3 2
f 5 6 7 8
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
)");
    Write("inspection.json", inspection_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  void Write(const std::string& file, const std::string& text) const {
    std::ofstream(folder_ + "/" + file) << text;
  }
  // Exit code of `sightline ARGUMENTS` in the folder, and what it said.
  std::pair<int, std::string> Run(const std::string& arguments) const {
    const ProcessResult result =
        RunProcess(absl::StrCat("cd ", folder_, " && ", BinFolder(), "/sightline ", arguments));
    return {result.exit_code, result.output};
  }
  template <typename Message>
  Message Read(const std::string& file) const {
    Message message;
    const absl::Status status = ReadStrictJsonFile(folder_ + "/" + file, &message);
    EXPECT_TRUE(status.ok()) << status;
    return message;
  }
  std::string Bytes(const std::string& file) const {
    std::ostringstream bytes;
    bytes << std::ifstream(folder_ + "/" + file, std::ios::binary).rdbuf();
    return bytes.str();
  }

  std::string folder_ = "/tmp/sightline-process-XXXXXX";

 private:
  const char* inspection_;
};

}  // namespace sightline
