// SPDX-License-Identifier: Apache-2.0
#include "core/process/out_of_memory.h"
#include "core/version/version.h"
#include "render_worker/service/server_main.h"

int main(int argc, char** argv) {
  sightline::ReportOutOfMemory("render_worker");
  return sightline::RenderWorkerMain(argc, argv, sightline::VersionText("render_worker"));
}
