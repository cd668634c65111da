#include "core/version/version.h"
#include "render_worker/service/server_main.h"

int main(int argc, char** argv) {
  return sightline::RenderWorkerMain(argc, argv, sightline::VersionText("render_worker"));
}
