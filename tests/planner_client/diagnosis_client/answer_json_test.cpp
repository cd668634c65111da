// SPDX-License-Identifier: Apache-2.0
#include "planner_client/diagnosis_client/answer_json.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

namespace sightline {
namespace {

using Json = nlohmann::ordered_json;

v1::FittedEffect* AddEffectTo(v1::Explanation* explanation, const std::string& id,
                              const std::string& stage) {
  v1::FittedEffect* effect = explanation->add_effects();
  effect->set_effect(id);
  effect->set_stage(stage);
  return effect;
}

v1::Explanation* AddExplanation(v1::Diagnosis* diagnosis, const std::string& id,
                                const std::string& stage, double probability) {
  v1::Explanation* explanation = diagnosis->add_ranked();
  explanation->set_effect(id);
  explanation->set_stage(stage);
  explanation->set_probability(probability);
  return explanation;
}

// The example of the recordings format, section 5, key by key.
TEST(AnswerJson, FormOfTheRecordingsFormat) {
  v1::Diagnosis diagnosis;
  diagnosis.set_set("set_003");
  diagnosis.set_verdict("effect");
  v1::FittedEffect* effect =
      AddEffectTo(AddExplanation(&diagnosis, "optics.veiling_glare", "optics", 0.8),
                  "optics.veiling_glare", "optics");
  v1::FittedParameter* fraction = effect->add_parameters();
  fraction->set_name("glare_fraction");
  fraction->set_value(0.05);
  fraction->set_standard_error(0.01);
  v1::FittedParameter* radius = effect->add_parameters();
  radius->set_name("halo_radius_m");
  radius->set_value(2.1e-4);
  effect->add_regions("background");
  effect->add_depends_on("signal_level");
  v1::HeldOutImprovement* held_out = diagnosis.mutable_held_out_improvement();
  held_out->set_measure("chi^2 per degree of freedom");
  held_out->set_null(3.1);
  held_out->set_with_effect(1.2);
  for (const int recording : {4, 9, 17}) held_out->add_recordings(recording);
  const Json expected = Json::parse(R"({
      "set": "set_003",
      "verdict": "effect",
      "ranked": [
        {"effect": "optics.veiling_glare", "stage": "optics", "probability": 0.8,
         "parameters": {"glare_fraction": 0.05, "halo_radius_m": 2.1e-4},
         "standard_errors": {"glare_fraction": 0.01},
         "regions": ["background"], "depends_on": ["signal_level"]}
      ],
      "also_present": [],
      "held_out_improvement": {"measure": "chi^2 per degree of freedom", "null": 3.1,
        "with_effect": 1.2, "recordings": [4, 9, 17]}
    })");
  EXPECT_EQ(Json::parse(AnswerJson(diagnosis)), expected);
}

TEST(AnswerJson, NoneAndUnknownHaveEveryKey) {
  v1::Diagnosis diagnosis;
  diagnosis.set_set("a \"set\"");
  diagnosis.set_verdict("none");
  AddExplanation(&diagnosis, "none", "none", 0.9);
  AddExplanation(&diagnosis, "unknown", "sensor", 0.1);
  const Json answer = Json::parse(AnswerJson(diagnosis));
  EXPECT_EQ(answer["set"], "a \"set\"");
  EXPECT_EQ(answer["also_present"], Json::array());
  ASSERT_EQ(answer["ranked"].size(), 2u);
  for (const Json& entry : answer["ranked"]) {
    EXPECT_EQ(entry["parameters"], Json::object());
    EXPECT_EQ(entry["standard_errors"], Json::object());
    EXPECT_EQ(entry["regions"], Json::array());
    EXPECT_EQ(entry["depends_on"], Json::array());
  }
  EXPECT_EQ(answer["ranked"][1]["stage"], "sensor");
}

TEST(AnswerJson, PairsAreOneEntryWithTheRestBesideIt) {
  v1::Diagnosis diagnosis;
  diagnosis.set_verdict("effect");
  v1::Explanation* both = AddExplanation(&diagnosis, "sensor.prnu", "sensor", 0.6);
  AddEffectTo(both, "sensor.prnu", "sensor");
  AddEffectTo(both, "optics.dust", "optics");
  AddEffectTo(AddExplanation(&diagnosis, "sensor.smear", "sensor", 0.2), "sensor.smear", "sensor");
  AddEffectTo(AddExplanation(&diagnosis, "sensor.prnu", "sensor", 0.15), "sensor.prnu", "sensor");
  v1::Explanation* other = AddExplanation(&diagnosis, "optics.coma", "optics", 0.05);
  AddEffectTo(other, "optics.coma", "optics");
  AddEffectTo(other, "optics.dust", "optics");
  const Json answer = Json::parse(AnswerJson(diagnosis));
  ASSERT_EQ(answer["ranked"].size(), 3u);
  EXPECT_EQ(answer["ranked"][0]["effect"], "sensor.prnu");
  EXPECT_DOUBLE_EQ(answer["ranked"][0]["probability"].get<double>(), 0.75);
  EXPECT_EQ(answer["ranked"][1]["effect"], "sensor.smear");
  ASSERT_EQ(answer["also_present"].size(), 1u);
  EXPECT_EQ(answer["also_present"][0]["effect"], "optics.dust");
  EXPECT_EQ(answer["also_present"][0]["stage"], "optics");
  EXPECT_DOUBLE_EQ(answer["also_present"][0]["probability"].get<double>(), 0.65);
}

TEST(AnswerJson, RemainderStandsOnlyWhereThereIsOne) {
  v1::Diagnosis diagnosis;
  AddExplanation(&diagnosis, "optics.coma", "optics", 1);
  EXPECT_FALSE(Json::parse(AnswerJson(diagnosis)).contains("remainder"));
  v1::Remainder* remainder = diagnosis.mutable_remainder();
  remainder->set_share(0.02);
  remainder->set_probability(0.97);
  remainder->set_group("f_number 1.4");
  // No term describes it: the stage stays empty.
  EXPECT_EQ(Json::parse(AnswerJson(diagnosis))["remainder"],
            Json::parse(R"({"stage": "", "share": 0.02, "probability": 0.97,
                            "group": "f_number 1.4"})"));
  remainder->set_share(NAN);
  EXPECT_FALSE(Json::parse(AnswerJson(diagnosis))["remainder"].contains("share"));
}

TEST(AnswerJson, LocatedStagesStandInTheirOrder) {
  v1::Diagnosis diagnosis;
  AddExplanation(&diagnosis, "unknown", "sensor", 1);
  EXPECT_FALSE(Json::parse(AnswerJson(diagnosis)).contains("located_stages"));
  diagnosis.add_located_stages("sensor");
  diagnosis.add_located_stages("optics");
  EXPECT_EQ(Json::parse(AnswerJson(diagnosis))["located_stages"],
            Json::parse(R"(["sensor", "optics"])"));
}

TEST(AnswerJson, NumbersThatAreNoneAreLeftOut) {
  v1::Diagnosis diagnosis;
  v1::FittedEffect* effect = AddEffectTo(AddExplanation(&diagnosis, "sensor.smear", "sensor", 1),
                                         "sensor.smear", "sensor");
  v1::FittedParameter* smear = effect->add_parameters();
  smear->set_name("smear_relative");
  smear->set_value(0.01);
  smear->set_standard_error(INFINITY);
  v1::FittedParameter* other = effect->add_parameters();
  other->set_name("other");
  other->set_value(NAN);
  const Json entry = Json::parse(AnswerJson(diagnosis))["ranked"][0];
  EXPECT_EQ(entry["parameters"], Json::parse(R"({"smear_relative": 0.01})"));
  EXPECT_EQ(entry["standard_errors"], Json::object());
}

}  // namespace
}  // namespace sightline
