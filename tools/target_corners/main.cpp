// SPDX-License-Identifier: Apache-2.0
// Finds a checkerboard's corners in images, for `sightline calibrate`, which starts this program.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <iostream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>

#include "core/process/start_process.h"
#include "core/version/version.h"
#include "tools/target_corners/corner_request.h"

int main(int argc, char** argv) {
  sightline::EndWithParent();
  constexpr char kProgram[] = "sightline_target_corners";
  constexpr int kFailed = 1, kInputWrong = 2;
  CLI::App app(
      "Finds the corners of a checkerboard in images; reads a request as JSON from standard input "
      "and writes the answer to standard output. `sightline calibrate` starts it.");
  app.set_version_flag("--version", sightline::VersionText(kProgram));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kInputWrong;
  }
  const std::string text((std::istreambuf_iterator<char>(std::cin)),
                         std::istreambuf_iterator<char>());
  const nlohmann::json request = nlohmann::json::parse(text, nullptr, false);
  if (request.is_discarded()) {
    std::fprintf(stderr, "%s: standard input is no JSON\n", kProgram);
    return kInputWrong;
  }
  const auto answer = sightline::AnswerCornerRequest(request);
  if (!answer.ok()) {
    std::fprintf(stderr, "%s: %s\n", kProgram, std::string(answer.status().message()).c_str());
    return absl::IsInternal(answer.status()) ? kFailed : kInputWrong;
  }
  std::cout << answer->dump() << "\n" << std::flush;
  return std::cout.good() ? 0 : kFailed;
}
