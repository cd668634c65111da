// SPDX-License-Identifier: Apache-2.0
#include "planner_client/calibration/target_corners.h"

#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "core/process/program_path.h"
#include "core/process/run_program.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

absl::StatusOr<std::string> Run(const std::string& request) {
  const std::filesystem::path program = FindProgram(kTargetCornersProgram);
  if (access(program.c_str(), X_OK) != 0) {
    return absl::NotFoundError(
        absl::StrCat("the checkerboard is found by the program ", kTargetCornersProgram,
                     ", and there is no executable ", program.string(),
                     "; install the package sightline-target-corners, or in a source folder run "
                     "deploy/add-program target-corners"));
  }
  const int descriptor = memfd_create("sightline-corners", MFD_CLOEXEC);
  const absl::Cleanup closing = [descriptor] {
    if (descriptor >= 0) close(descriptor);
  };
  if (descriptor < 0 ||
      write(descriptor, request.data(), request.size()) != static_cast<ssize_t>(request.size()) ||
      lseek(descriptor, 0, SEEK_SET) != 0) {
    return absl::ResourceExhaustedError("no memory for the list of images");
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto finished,
                             RunProgram({.words = {program.string()},
                                         .descriptors = {{.number = 0, .ours = descriptor}},
                                         .in_our_group = true,
                                         .ends_with_us = true},
                                        {.time_limit = absl::Minutes(20)}));
  absl::StripAsciiWhitespace(&finished.errors);
  const int status = finished.wait_status;
  if (WIFSIGNALED(status)) {
    if (WTERMSIG(status) == SIGINT) return absl::CancelledError("interrupted");
    return absl::InternalError(absl::StrCat(kTargetCornersProgram, " was killed by signal ",
                                            WTERMSIG(status), ": ", finished.errors));
  }
  if (WEXITSTATUS(status) != 0) {
    const std::string message(
        absl::StripPrefix(finished.errors, absl::StrCat(kTargetCornersProgram, ": ")));
    if (WEXITSTATUS(status) == 2) return absl::InvalidArgumentError(message);
    return absl::InternalError(absl::StrCat(kTargetCornersProgram, ": ", message));
  }
  return std::move(finished.output);
}

}  // namespace

absl::StatusOr<FoundTargets> FindTargets(const std::vector<std::string>& images,
                                         const TargetBoard& board) {
  const nlohmann::json request = {{"images", images},
                                  {"inner_corners_x", board.inner_corners_x},
                                  {"inner_corners_y", board.inner_corners_y},
                                  {"square_m", board.square_m}};
  SIGHTLINE_ASSIGN_OR_RETURN(const auto output, Run(request.dump()));
  try {
    const nlohmann::json answer = nlohmann::json::parse(output);
    FoundTargets found;
    found.columns_px = answer.at("columns_px").get<int>();
    found.rows_px = answer.at("rows_px").get<int>();
    const nlohmann::json& camera = answer.at("camera");
    found.camera = {.fx = camera.at("fx").get<double>(),
                    .fy = camera.at("fy").get<double>(),
                    .cx = camera.at("cx").get<double>(),
                    .cy = camera.at("cy").get<double>(),
                    .distortion = camera.at("distortion").get<std::array<double, 5>>()};
    found.rms_px = camera.at("rms_px").get<double>();
    const Eigen::Vector2d first = board.Corner(0);
    for (const nlohmann::json& from : answer.at("frames")) {
      FoundTargets::Frame frame;
      if (from.contains("because")) {
        frame.because = from.at("because").get<std::string>();
      } else {
        for (const nlohmann::json& corner : from.at("corners_px")) {
          frame.corners_px.emplace_back(corner.at(0).get<double>(), corner.at(1).get<double>());
        }
        const auto turn = from.at("rotation_vector").get<std::array<double, 3>>();
        const auto shift = from.at("translation_m").get<std::array<double, 3>>();
        frame.pose.resize(6);
        frame.pose << turn[0], turn[1], turn[2], shift[0], shift[1], shift[2];
        frame.pose.tail<3>() =
            (MotionOf(frame.pose) * Eigen::Vector3d(-first.x(), -first.y(), 0)).eval();
      }
      found.frames.push_back(std::move(frame));
    }
    return found;
  } catch (const nlohmann::json::exception& error) {
    return absl::InternalError(absl::StrCat(kTargetCornersProgram, ": ", error.what()));
  }
}

}  // namespace sightline
