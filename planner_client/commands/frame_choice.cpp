// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/frame_choice.h"

#include <array>
#include <filesystem>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/json/strict_json.h"
#include "core/part/part_digest.h"
#include "core/status/status_macros.h"
#include "core/text/number.h"
#include "core/text/number_text.h"
#include "planner_client/commands/other_part.h"
#include "planner_client/part_files/part_file.h"
#include "planning/plan_file/plan_file.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

// Nine numbers in metres and degrees.
absl::StatusOr<Measurement> ParseMeasurementText(const std::string& text) {
  const std::vector<std::string> parts = absl::StrSplit(text, ',');
  v1::Measurement message;
  std::array<double, kMeasurementParameters> values{};
  bool ok = parts.size() == values.size();
  for (size_t i = 0; ok && i < values.size(); ++i) {
    const auto value = ParseReal(parts[i]);
    ok = value.ok();
    if (!ok) break;
    values[i] = *value;
    const auto* field =
        v1::Measurement::descriptor()->FindFieldByName(kMeasurementParameterNames[i]);
    message.GetReflection()->SetDouble(&message, field, values[i]);
  }
  if (!ok) {
    std::string names;
    for (const char* name : kMeasurementParameterNames)
      absl::StrAppend(&names, names.empty() ? "" : ",", name);
    return absl::InvalidArgumentError(
        absl::StrCat("--measurement ", text, ": must be nine numbers ", names));
  }
  const Measurement measurement = MeasurementFromProto(message);
  const MeasurementDomain domain = ThesisDomain();
  const auto internal = ToArray(measurement);
  for (int i = 0; i < kMeasurementParameters; ++i) {
    if (domain.parameters[i].Contains(internal[i])) continue;
    return absl::InvalidArgumentError(absl::StrCat("--measurement: ", kMeasurementParameterNames[i],
                                                   " is ", NumberText(values[i]),
                                                   ", which is outside Table 2.1"));
  }
  return measurement;
}

// The inspection's measurement if it fixes all parameters.
absl::StatusOr<Measurement> FixedMeasurement(const Inspection& inspection,
                                             const std::string& file) {
  std::array<double, kMeasurementParameters> values{};
  const MeasurementDomain& domain = inspection.domain;
  const bool resting = domain.resting_orientations.size() == 1;
  std::string open;
  for (int i = 0; i < kMeasurementParameters; ++i) {
    const ParameterDomain& parameter = domain.parameters[i];
    if (resting && (i == kPartAlpha || i == kPartBeta)) {
      values[i] = i == kPartAlpha ? domain.resting_orientations[0].part_alpha_rad
                                  : domain.resting_orientations[0].part_beta_rad;
    } else if (parameter.ranges.empty() && parameter.values.size() == 1 &&
               (domain.resting_orientations.empty() || (i != kPartAlpha && i != kPartBeta))) {
      values[i] = parameter.values[0];
    } else {
      absl::StrAppend(&open, open.empty() ? "" : ", ", kMeasurementParameterNames[i]);
    }
  }
  if (open.empty()) return FromArray(values);
  // A resting part has no angles of its own that could be fixed.
  const char* by_face = inspection.part_holding == PartHolding::kResting && !resting
                            ? " (part_alpha_deg and part_beta_deg by a single entry of "
                              "measurement.resting_orientations)"
                            : "";
  return absl::InvalidArgumentError(
      absl::StrCat(file, ": measurement does not fix ", open, "; fix each of them", by_face,
                   ", or give --plan plan.json or --measurement with nine numbers"));
}

v1::PartFrame MakeFrame(const v1::Measurement& measurement, double stage_m, int scan, int frame) {
  v1::PartFrame message;
  *message.mutable_measurement() = measurement;
  message.set_stage_position_m(stage_m);
  message.set_scan(scan);
  message.set_frame(frame);
  return message;
}

// Reads the part only if a plan states one.
absl::Status CheckPart(const GivenPlans& plans, const Inspection& inspection,
                       std::vector<std::string>* remarks) {
  if (!plans.StateAPart()) return absl::OkStatus();
  PartFileOptions part_options;
  part_options.construction_geometry = inspection.part_construction_geometry;
  SIGHTLINE_ASSIGN_OR_RETURN(
      const auto part, LoadPartFile(inspection.part_file, inspection.part_unit, part_options));
  SIGHTLINE_ASSIGN_OR_RETURN(auto found,
                             plans.CheckBelongTo(PartDigestOf(part), inspection.part_file));
  remarks->insert(remarks->end(), found.begin(), found.end());
  return absl::OkStatus();
}

absl::StatusOr<std::vector<v1::PartFrame>> FramesOfPlan(const FrameChoice& options,
                                                        const Inspection& inspection,
                                                        std::vector<std::string>* remarks) {
  GivenPlans given;
  given.other_part = options.other_part;
  SIGHTLINE_ASSIGN_OR_RETURN(const auto plan, ReadPlanScans(options.plan, &given));
  SIGHTLINE_RETURN_IF_ERROR(CheckPart(given, inspection, remarks));
  const int scans = plan.plan.scans_size();
  if (scans == 0) return absl::InvalidArgumentError(absl::StrCat(options.plan, ": has no scans"));
  if (options.scan && (*options.scan < 1 || *options.scan > scans)) {
    return absl::InvalidArgumentError(absl::StrCat("--scan ", *options.scan, ": must be in [1, ",
                                                   scans, "], the scans of ", options.plan));
  }
  if (!options.scan && scans > 1 && (options.frame || options.stage_position_m)) {
    return absl::InvalidArgumentError(absl::StrCat(options.frame ? "--frame" : "--stage-position",
                                                   " needs --scan: ", options.plan, " has ", scans,
                                                   " scans"));
  }
  std::vector<v1::PartFrame> frames;
  for (int s = options.scan ? *options.scan - 1 : 0; s < (options.scan ? *options.scan : scans);
       ++s) {
    const v1::PlannedScan& scan = plan.plan.scans(s);
    if (options.stage_position_m) {
      frames.push_back(MakeFrame(scan.measurement(), *options.stage_position_m, s + 1, 0));
      if (scan.has_setting()) *frames.back().mutable_setting() = scan.setting();
      continue;
    }
    const int triggers = scan.trigger_positions_m_size();
    if (triggers == 0) {
      return absl::InvalidArgumentError(
          absl::StrCat(options.plan, ": scans[", s,
                       "].trigger_positions_m is empty; run `sightline evaluate` on the plan "
                       "first, or give --stage-position"));
    }
    if (options.frame && (*options.frame < 0 || *options.frame >= triggers)) {
      return absl::InvalidArgumentError(absl::StrCat("--frame ", *options.frame,
                                                     ": must be in [0, ", triggers - 1,
                                                     "], the frames of scan ", s + 1));
    }
    for (int f = options.frame.value_or(0); f <= options.frame.value_or(triggers - 1); ++f) {
      frames.push_back(MakeFrame(scan.measurement(), scan.trigger_positions_m(f), s + 1, f));
      if (scan.has_setting()) *frames.back().mutable_setting() = scan.setting();
    }
  }
  return frames;
}

// The plan of --scan without --plan: in the output folder or beside the inspection.
absl::StatusOr<std::string> FindPlan(const FrameChoice& options) {
  const fs::path beside = fs::path(options.input).parent_path() / "plan.json";
  const fs::path in_out = fs::path(options.out) / "plan.json";
  for (const fs::path& path : {in_out, beside}) {
    if (fs::exists(path)) return path.string();
  }
  return absl::InvalidArgumentError(absl::StrCat("--scan needs a plan: there is none at ",
                                                 in_out.string(), " and ", beside.string(),
                                                 "; give --plan plan.json"));
}

}  // namespace

absl::StatusOr<std::vector<v1::PartFrame>> ChooseFrames(FrameChoice options,
                                                        const Inspection& inspection,
                                                        std::vector<std::string>* remarks) {
  if (options.scan && options.plan.empty()) {
    SIGHTLINE_ASSIGN_OR_RETURN(options.plan, FindPlan(options));
  }
  if (options.frame && options.stage_position_m) {
    return absl::InvalidArgumentError("--frame and --stage-position exclude each other");
  }
  if (!options.plan.empty()) {
    if (!options.measurement.empty()) {
      return absl::InvalidArgumentError("--plan and --measurement exclude each other");
    }
    return FramesOfPlan(options, inspection, remarks);
  }
  SIGHTLINE_ASSIGN_OR_RETURN(Measurement measurement,
                             options.measurement.empty()
                                 ? FixedMeasurement(inspection, options.input)
                                 : ParseMeasurementText(options.measurement));
  const double stage_m =
      options.stage_position_m.value_or(options.frame.value_or(0) * inspection.rig.scan_step_m);
  return std::vector<v1::PartFrame>{
      MakeFrame(MeasurementToProto(measurement), stage_m, 1, options.frame.value_or(0))};
}

void AddFrameOptions(CLI::App& app, FrameChoice* choice) {
  app.add_option("--plan", choice->plan, "plan.json: render its scans");
  app.add_option("--measurement", choice->measurement,
                 "nine numbers in metres and degrees, separated by commas: camera distance, "
                 "triangulation angle, azimuth, polar angle, alpha, beta, gamma, offset y, z");
  app.add_option("--scan", choice->scan,
                 "only this scan of the plan, from 1; without --plan that in --out or beside "
                 "the inspection");
  app.add_option("--frame", choice->frame,
                 "only this frame: number in the scan's trigger positions, from 0; without --plan "
                 "the stage position is this many scan steps");
  AddOtherPartOption(app, &choice->other_part);
  app.add_option("--stage-position", choice->stage_position_m, "only this stage position [m]");
}

}  // namespace sightline
