// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/other_part.h"

namespace sightline {

void AddOtherPartOption(CLI::App& app, bool* other_part) {
  app.add_flag("--other-part", *other_part,
               "accept a plan that was made for another part; reports say so first");
}

}  // namespace sightline
