// SPDX-License-Identifier: Apache-2.0
// `sightline effects` and the list inside the program.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <set>

#include "planner_client/commands/commands.h"
#include "planner_client/effect_list/effect_list.h"
#include "tests/planner_client/run_command.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(EffectList, HasEveryEffectWithSoundNumbers) {
  std::set<std::string> names;
  for (const ListedEffect& effect : ListedEffects()) {
    EXPECT_TRUE(names.insert(effect.effect).second) << effect.effect;
    EXPECT_FALSE(effect.summary.empty()) << effect.effect;
    for (const ListedParameter& p : effect.parameters) {
      EXPECT_LE(p.lower, p.without) << effect.effect << " " << p.name;
      EXPECT_LE(p.without, p.upper) << effect.effect << " " << p.name;
      EXPECT_GT(p.usual, 0) << effect.effect << " " << p.name;
      EXPECT_FALSE(p.unit.empty());
    }
  }
  EXPECT_GT(names.size(), 60u);
  EXPECT_TRUE(names.contains("optics.coma"));
}

TEST(EffectsCommand, ListsAllWithRangesAndUnits) {
  const CommandResult all = RunCommand(AddEffectsCommand, {});
  EXPECT_EQ(all.exit_code, kExitDone);
  for (const ListedEffect& effect : ListedEffects()) {
    EXPECT_THAT(all.output, HasSubstr("\n" + effect.effect + "\n"));
    for (const ListedParameter& p : effect.parameters) EXPECT_THAT(all.output, HasSubstr(p.name));
  }
  EXPECT_THAT(all.output, HasSubstr("0 to 100 W/(m^2 sr)"));
}

TEST(EffectsCommand, TellsMoreOfOneAndListsThoseOfAWord) {
  const CommandResult one = RunCommand(AddEffectsCommand, {"illumination.ambient_light"});
  EXPECT_EQ(one.exit_code, kExitDone);
  EXPECT_THAT(one.output, AllOf(HasSubstr("Source:"), HasSubstr("6 decades less"),
                                HasSubstr("{\"effects\": [{\"effect\": "
                                          "\"illumination.ambient_light\", \"parameters\": "
                                          "{\"ambient_radiance_w_m2_sr\": 0.2}}]}")));
  const CommandResult some = RunCommand(AddEffectsCommand, {"optics."});
  EXPECT_THAT(some.output, AllOf(HasSubstr("optics.coma"), Not(HasSubstr("sensor."))));
}

TEST(EffectsCommand, NamesTheNearest) {
  const CommandResult wrong = RunCommand(AddEffectsCommand, {"optics.comma"});
  EXPECT_EQ(wrong.exit_code, kExitWrongInput);
  EXPECT_THAT(wrong.errors, HasSubstr("the nearest is \"optics.coma\""));
}

TEST(EffectsCommand, GivesJsonToPrograms) {
  const CommandResult json = RunCommand(AddEffectsCommand, {"--json"});
  EXPECT_EQ(nlohmann::json::parse(json.output)["effects"].size(), ListedEffects().size());
}

}  // namespace
}  // namespace sightline
