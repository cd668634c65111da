// SPDX-License-Identifier: Apache-2.0
// Finished images count for the same request to the same build of the worker alone.
#include "planner_client/render_client/finished_images.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "core/digest/sha256.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class FinishedImagesTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_NE(mkdtemp(folder_.data()), nullptr);
    spec_.mutable_plate()->set_seed(1);
  }
  void TearDown() override { fs::remove_all(folder_); }

  FinishedImages Open(const v1::RenderSpec& spec, const std::string& build) const {
    auto finished = FinishedImages::Open(folder_ + "/kept/finished_images", folder_, spec, build);
    EXPECT_TRUE(finished.ok()) << finished.status();
    return *std::move(finished);
  }
  // Two images, the second of which is not known to be whole.
  void Render(const std::string& build) const {
    FinishedImages finished = Open(spec_, build);
    for (int image = 0; image < 2; ++image) {
      const std::string file = std::to_string(image) + ".png", bytes = "image " + file;
      std::ofstream(folder_ + "/" + file) << bytes;
      finished.AddFile(image, file, Sha256Hex(bytes));
    }
  }

  std::string folder_ = "/tmp/sightline-finished-XXXXXX";
  v1::RenderSpec spec_;
};

TEST_F(FinishedImagesTest, ImagesOfTheSameQuestionCount) {
  EXPECT_THAT(Open(spec_, "a").remarks(), IsEmpty());
  Render("a");
  const FinishedImages again = Open(spec_, "a");
  EXPECT_THAT(again.images(), ElementsAre(0));
  EXPECT_THAT(again.files(), ElementsAre("0.png"));
  EXPECT_THAT(again.remarks(), IsEmpty());
}

// Image 0 is the one that counts (see the test before).
TEST_F(FinishedImagesTest, ImagesThatAreMadeAgainAreNamed) {
  Render("a");
  std::ofstream(folder_ + "/0.png") << "other bytes";
  const FinishedImages damaged = Open(spec_, "a");
  EXPECT_THAT(damaged.images(), IsEmpty());
  EXPECT_THAT(damaged.remarks(), ElementsAre(HasSubstr("kept image 0 (0.png)")));
  // It is named once: the list no longer has it.
  EXPECT_THAT(Open(spec_, "a").remarks(), IsEmpty());
}

TEST_F(FinishedImagesTest, ImagesOfAnotherRequestOrBuildAreNamedAndDoNotCount) {
  v1::RenderSpec other = spec_;
  other.mutable_plate()->set_seed(2);
  for (const auto& [spec, build] :
       {std::pair(spec_, "b"), std::pair(spec_, ""), std::pair(other, "a")}) {
    Render("a");
    const FinishedImages finished = Open(spec, build);
    EXPECT_THAT(finished.images(), IsEmpty()) << build;
    EXPECT_THAT(finished.remarks(), ElementsAre(HasSubstr("kept/finished_images: its images")));
    // The list is that of the new question now.
    EXPECT_THAT(Open(spec, build).remarks(), IsEmpty());
  }
}

TEST_F(FinishedImagesTest, ImagesWithOtherBytesDoNotCount) {
  Render("a");
  std::ofstream(folder_ + "/0.png") << "damaged";
  EXPECT_THAT(Open(spec_, "a").images(), IsEmpty());
}

}  // namespace
}  // namespace sightline
