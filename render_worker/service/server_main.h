// SPDX-License-Identifier: Apache-2.0
// Command line of the render worker.
#pragma once

#include <string>

namespace sightline {

// `render_worker --listen unix:PATH | HOST:PORT [options]`, see ServerMain. `version`: text of
// --version.
int RenderWorkerMain(int argc, char** argv, const std::string& version);

}  // namespace sightline
