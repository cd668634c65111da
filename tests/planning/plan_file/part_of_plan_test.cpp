// SPDX-License-Identifier: Apache-2.0
// Plans belong to a part, and say so.
#include "planning/plan_file/part_of_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

const PartDigest kPart{kPartDigestRule, std::string(64, 'a')};
const PartDigest kOther{kPartDigestRule, std::string(64, 'b')};

absl::StatusOr<std::string> Check(const std::string& stated, OtherPart other) {
  return CheckPlanBelongsToPart("old/plan.json", stated, kPart, "parts/box.stl", other);
}

TEST(PartOfPlan, TakesThisPartAndPlansByHandWithoutAWord) {
  for (const OtherPart other :
       {OtherPart::kRefused, OtherPart::kRefusedWithoutOption, OtherPart::kTaken}) {
    for (const std::string& stated : {kPart.Text(), std::string()}) {
      const auto remark = Check(stated, other);
      ASSERT_TRUE(remark.ok()) << remark.status();
      EXPECT_EQ(*remark, "");
    }
  }
}

TEST(PartOfPlan, RefusesAnotherPartAndNamesBoth) {
  for (const OtherPart other : {OtherPart::kRefused, OtherPart::kRefusedWithoutOption}) {
    const absl::Status refused = Check(kOther.Text(), other).status();
    EXPECT_EQ(refused.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(std::string(refused.message()),
                AllOf(HasSubstr("old/plan.json: part_digest"), HasSubstr("parts/box.stl"),
                      HasSubstr(kPart.Text()), HasSubstr(kOther.Text())));
    EXPECT_EQ(refused.message().find("--other-part") != std::string::npos,
              other == OtherPart::kRefusedWithoutOption);
  }
}

// Remarks are kept in plans, which do not depend on folders.
TEST(PartOfPlan, TakesAnotherPartIfAskedToAndSaysSo) {
  const auto remark = Check(kOther.Text(), OtherPart::kTaken);
  ASSERT_TRUE(remark.ok()) << remark.status();
  EXPECT_THAT(*remark,
              AllOf(HasSubstr("plan.json"), HasSubstr("another part"), HasSubstr("box.stl"),
                    HasSubstr(kPart.Text()), HasSubstr(kOther.Text()), Not(HasSubstr("/"))));
}

TEST(PartOfPlan, DigestsOfAnOlderRuleAreTakenWithARemark) {
  static_assert(kPartDigestRule > 1, "bare digits are of an older rule");
  for (const OtherPart other : {OtherPart::kRefused, OtherPart::kTaken}) {
    const auto remark = Check(kOther.hex, other);
    ASSERT_TRUE(remark.ok()) << remark.status();
    EXPECT_THAT(*remark, AllOf(HasSubstr("plan.json"), HasSubstr("rule")));
  }
}

// Else a digest of any rule would do for any part.
TEST(PartOfPlan, DigestsOfALaterRuleAreRefusedUnlessAskedFor) {
  for (const int rule : {kPartDigestRule + 1, kPartDigestRule + 997}) {
    const std::string later = PartDigest{rule, kOther.hex}.Text();
    const absl::Status refused = Check(later, OtherPart::kRefusedWithoutOption).status();
    EXPECT_EQ(refused.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(std::string(refused.message()),
                AllOf(HasSubstr("later version"), HasSubstr("--other-part")));
    const auto taken = Check(later, OtherPart::kTaken);
    ASSERT_TRUE(taken.ok()) << taken.status();
    EXPECT_THAT(*taken, HasSubstr("rule"));
  }
}

TEST(PartOfPlan, RefusesWhatIsNoDigestWhateverIsAsked) {
  for (const char* stated : {"0", "2:", "2:abc", "x:0", "sha256"}) {
    for (const OtherPart other : {OtherPart::kRefused, OtherPart::kTaken}) {
      const absl::Status refused = Check(stated, other).status();
      EXPECT_EQ(refused.code(), absl::StatusCode::kInvalidArgument) << stated;
      EXPECT_THAT(std::string(refused.message()), HasSubstr("old/plan.json: part_digest"));
    }
  }
}

TEST(GivenPlans, AllPlansAreCompared) {
  GivenPlans given;
  EXPECT_FALSE(given.StateAPart());
  given.plans = {{"by_hand.json", ""}};
  EXPECT_FALSE(given.StateAPart());
  given.plans.push_back({"a.json", kPart.Text()});
  EXPECT_TRUE(given.StateAPart());
  auto remarks = given.CheckBelongTo(kPart, "box.stl");
  ASSERT_TRUE(remarks.ok()) << remarks.status();
  EXPECT_THAT(*remarks, IsEmpty());
  given.plans.push_back({"b.json", kOther.Text()});
  EXPECT_THAT(std::string(given.CheckBelongTo(kPart, "box.stl").status().message()),
              HasSubstr("b.json"));
  // The same plan may be given in two ways.
  given.plans.push_back({"b.json", kOther.Text()});
  given.other_part = true;
  remarks = given.CheckBelongTo(kPart, "box.stl");
  ASSERT_TRUE(remarks.ok()) << remarks.status();
  EXPECT_THAT(*remarks, ElementsAre(HasSubstr("b.json")));
}

}  // namespace
}  // namespace sightline
