// SPDX-License-Identifier: Apache-2.0
// Chooses camera, lens and laser from a catalogue: the best combination for an inspection.
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
  int rendered = 6;  // combinations that are rendered
};

// --max-footprint, --min-view, --min-depth (mm), --max-price and --rendered.
void AddDeviceOptions(CLI::App& app, DeviceRequirements* requirements);

// All combinations; those that pass the geometric check and are to be rendered come first.
struct DeviceCandidates {
  struct Candidate {
    v1::DeviceCombination combination;  // with results of geometry
    v1::Inspection devices;             // its camera, lens, laser and costs; the rest is empty
  };
  std::vector<Candidate> rendered;
  std::vector<v1::DeviceCombination> lost;
};

// Evaluates combinations by geometry at the camera distance of the request's first frame. The
// inspection supplies missing requirements: its targets' largest pixel footprint, and nine tenths
// of the field of view along the rows of its own camera and lens. Among fitting combinations, those
// with the smallest pixels on the part and the cheapest are rendered, `rendered` in total.
// INVALID_ARGUMENT if the catalogue is empty or no combination fits; the message counts the
// reasons. NOT_FOUND if there is no such folder.
absl::StatusOr<DeviceCandidates> FindDevices(const std::string& folder,
                                             const Inspection& inspection,
                                             const v1::CreateOpticsRequest& request,
                                             const DeviceRequirements& requirements);

// Rates the candidates by the optical cost of their best setting, as a height: cost [px] times the
// height of one pixel. Combinations whose height cost is within 5 % of the least count as equal; of
// these the cheapest wins, then the fastest.
struct ChosenDevices {
  v1::DeviceChoice choice;    // the chosen one first
  v1::Inspection inspection;  // the request's, with the chosen devices
};
absl::StatusOr<ChosenDevices> ChooseDevices(const DeviceCandidates& candidates,
                                            const WorkerClientOptions& client,
                                            const v1::CreateOpticsRequest& request,
                                            const std::vector<AssetFile>& assets);

}  // namespace sightline
