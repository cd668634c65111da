// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/other_part.h"

namespace sightline {

void AddOtherPartOption(CLI::App& app, bool* other_part) {
  app.add_flag("--other-part", *other_part,
               "take a plan that states another part than the inspection's; reports begin with it");
}

}  // namespace sightline
