// SPDX-License-Identifier: Apache-2.0
// The real server process around the fake engine. SIGHTLINE_FAKE_QUERY_MS, SIGHTLINE_FAKE_BUILD_MS:
// time of one query and of one build. SIGHTLINE_FAKE_QUERY_FILE: a file that a query makes when it
// begins. SIGHTLINE_FAKE_DEAF: builds do not listen when they are cancelled.
#include <cstdlib>
#include <utility>

#include "coverage_server/service/server_main.h"
#include "tests/integration/coverage_server/fake_scene.h"

namespace {

absl::Duration FromEnvironment(const char* name) {
  const char* text = std::getenv(name);
  return absl::Milliseconds(text == nullptr ? 0 : std::atoi(text));
}

}  // namespace

int main(int argc, char** argv) {
  sightline::FakeOptions options;
  options.query_time = FromEnvironment("SIGHTLINE_FAKE_QUERY_MS");
  options.build_time = FromEnvironment("SIGHTLINE_FAKE_BUILD_MS");
  if (const char* file = std::getenv("SIGHTLINE_FAKE_QUERY_FILE")) options.query_file = file;
  sightline::CoverageBackend backend = sightline::MakeFakeBackend(options);
  if (std::getenv("SIGHTLINE_FAKE_DEAF") != nullptr) {
    backend.build_scene = [build = backend.build_scene](
                              sightline::SceneDefinition definition,
                              sightline::SceneBuildOptions build_options) {
      build_options.cancelled = nullptr;
      return build(std::move(definition), build_options);
    };
  }
  return sightline::CoverageServerMain(argc, argv, backend);
}
