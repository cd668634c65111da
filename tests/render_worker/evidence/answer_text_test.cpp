// SPDX-License-Identifier: Apache-2.0
#include "render_worker/evidence/answer_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "render_worker/evidence/judgement.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

v1::Diagnosis WithRemainder(const char* effect, double share, double probability,
                            const char* group) {
  v1::Diagnosis diagnosis;
  diagnosis.add_ranked()->set_effect(effect);
  diagnosis.mutable_remainder()->set_share(share);
  diagnosis.mutable_remainder()->set_probability(probability);
  diagnosis.mutable_remainder()->set_group(group);
  return diagnosis;
}

TEST(RemainderText, SaysShareGroupAndProbability) {
  EXPECT_EQ(RemainderText(WithRemainder("optics.coma", 0.02, 0.97, "texture")),
            "2 % of the difference is left, mostly in texture; no known effect describes it "
            "(probability 0.97).");
  EXPECT_THAT(RemainderText(WithRemainder("optics.coma", 0.0049, 0.97, "f_number 1.4")),
              HasSubstr("less than 1 % of the difference is left, mostly in recordings at f_number "
                        "1.4"));
  // No sentence claims certainty.
  EXPECT_THAT(
      RemainderText(WithRemainder("optics.coma", 0.3, 1, "")),
      AllOf(HasSubstr("30 % of the difference is left; "), HasSubstr("(probability 0.99)")));
}

TEST(RemainderText, IsEmptyUnlessItIsMoreLikelyThanNot) {
  EXPECT_THAT(RemainderText({}), IsEmpty());
  EXPECT_THAT(RemainderText(WithRemainder("optics.coma", 0.02, 0.5, "texture")), IsEmpty());
  v1::Diagnosis without = WithRemainder("optics.coma", 0.02, 0.97, "texture");
  without.clear_remainder();
  EXPECT_THAT(RemainderText(without), IsEmpty());
}

TEST(RemainderText, ANullModelIsAccusedOnlyIfItIsRejected) {
  v1::Diagnosis diagnosis = WithRemainder("none", 1, 0.97, "texture");
  diagnosis.mutable_named_check()->set_p_value(0.2);
  EXPECT_FALSE(NullIsRejectedAnswer(diagnosis));
  EXPECT_THAT(RemainderText(diagnosis), IsEmpty());
  diagnosis.mutable_named_check()->set_p_value(1.2e-9);
  EXPECT_TRUE(NullIsRejectedAnswer(diagnosis));
  EXPECT_THAT(RemainderText(diagnosis),
              AllOf(HasSubstr("No effect that is known predicts these recordings better"),
                    HasSubstr("p = 1.2e-09; the largest difference is in texture.")));
  diagnosis.mutable_named_check()->set_p_value(0);
  EXPECT_THAT(RemainderText(diagnosis), HasSubstr("p < 1e-300"));
}

// The text names the first condition that fails, and only that one.
TEST(WhyTermDoesNotLead, NamesTheConditionThatFails) {
  for (const double evidence : {-20.0, 20.0}) {
    for (const double score : {1.0, 40.0}) {
      for (const double share : {0.01, 0.4}) {
        const std::string why = WhyTermDoesNotLead({.more_evidence = evidence,
                                                    .more_held_out_score = score,
                                                    .share_left = share,
                                                    .share_names_may_leave = 0.2});
        const bool more = evidence > 0, much = share > 0.2;
        const bool predicts = score > kClearGain_nats;
        const auto says = [&](const char* text, bool expected) {
          if (expected) {
            EXPECT_THAT(why, HasSubstr(text));
          } else {
            EXPECT_THAT(why, Not(HasSubstr(text)));
          }
        };
        says("20 nats less evidence", !more);
        says("20 nats more evidence", more);
        says("leaves only 1 %", more && !much);
        says("1 nats in the prediction", more && much && !predicts);
        says("errors of the model itself", more && much && predicts);
        EXPECT_THAT(why, Not(HasSubstr("-")));
      }
    }
  }
}

}  // namespace
}  // namespace sightline
