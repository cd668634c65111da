// SPDX-License-Identifier: Apache-2.0
// Camera, lens and laser from a catalogue: which combination serves an inspection best.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/catalogue/catalogue.h"
#include "core/catalogue/combination.h"
#include "core/inspection/inspection.h"
#include "planner_client/rpc_client/worker_call.h"
#include "sightline/v1/catalogue.pb.h"
#include "sightline/v1/optics_service.pb.h"

namespace sightline {

struct DeviceRequirements {
  std::optional<double> max_footprint_mm, min_view_mm, min_depth_mm, max_price_eur;
  int rendered = 6;  // combinations that are judged by images
};

// --max-footprint, --min-view, --min-depth (mm), --max-price and --rendered.
void AddDeviceOptions(CLI::App& app, DeviceRequirements* requirements);

// All combinations, those that geometry allows and are to be rendered first.
struct DeviceCandidates {
  struct Candidate {
    v1::DeviceCombination combination;  // with results of geometry
    v1::Inspection devices;             // its camera, lens, laser and costs; the rest is empty
  };
  std::vector<Candidate> rendered;
  std::vector<v1::DeviceCombination> lost;
};

// Combinations by geometry at the camera distance of the request's first frame. The inspection sets
// missing requirements: its targets' largest pixel footprint, and nine tenths of
// the field of view that its own camera and lens have along the rows. Of those that fit, the ones
// with the smallest pixels on the part and the cheapest are rendered, `rendered` of them.
// INVALID_ARGUMENT: an empty catalogue, or no combination fits; the message counts the reasons.
// NOT_FOUND: no such folder.
absl::StatusOr<DeviceCandidates> FindDevices(const std::string& folder,
                                             const Inspection& inspection,
                                             const v1::CreateOpticsRequest& request,
                                             const DeviceRequirements& requirements);

// Judges the candidates by the optical cost of their best setting, as height: cost [px] times the
// height that a pixel makes. Combinations whose height cost is within a twentieth of the least
// count as equal; of these the cheapest wins, then the fastest.
struct ChosenDevices {
  v1::DeviceChoice choice;    // the chosen one first
  v1::Inspection inspection;  // the request's, with the chosen devices
};
absl::StatusOr<ChosenDevices> ChooseDevices(const DeviceCandidates& candidates,
                                            const WorkerClientOptions& client,
                                            const v1::CreateOpticsRequest& request,
                                            const std::vector<AssetFile>& assets);

}  // namespace sightline
