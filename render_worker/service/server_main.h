// Command line of the render worker.
#pragma once

namespace sightline {

// `render_worker --listen unix:PATH | HOST:PORT [options]`, see ServerMain.
int RenderWorkerMain(int argc, char** argv);

}  // namespace sightline
