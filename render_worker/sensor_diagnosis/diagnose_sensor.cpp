// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor_diagnosis/diagnose_sensor.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/sensor/emva1288_data.h"
#include "core/status/status_macros.h"
#include "render_worker/sensor_diagnosis/answer/camera_values.h"
#include "render_worker/sensor_diagnosis/answer/departure_messages.h"
#include "render_worker/sensor_diagnosis/answer/transfer_messages.h"
#include "render_worker/sensor_diagnosis/converter/converter_departures.h"
#include "render_worker/sensor_diagnosis/fixed_pattern/fixed_pattern.h"
#include "render_worker/sensor_diagnosis/fixed_pattern/pattern_departures.h"
#include "render_worker/sensor_diagnosis/frames/frame_means.h"
#include "render_worker/sensor_diagnosis/frames/frame_memory.h"
#include "render_worker/sensor_diagnosis/frames/shared_noise.h"
#include "render_worker/sensor_diagnosis/photon_transfer/standard_values.h"
#include "render_worker/sensor_diagnosis/photon_transfer/transfer_terms.h"

namespace sightline {
namespace {

void Append(std::vector<Departure> more, std::vector<Departure>* departures) {
  for (Departure& departure : more) departures->push_back(std::move(departure));
}

// Tests of changes from frame to frame and of noise that pixels share.
std::vector<Departure> FrameDepartures(const FlatFieldSteps& steps, const Saturation& saturation) {
  std::vector<const FlatFieldStatistics*> unsaturated;
  for (const FlatFieldStatistics* step : steps.bright) {
    if (IsBelowSaturation(*step, steps.DarkMeanDn(step->exposure_time_s), saturation.signal_dn)) {
      unsaturated.push_back(step);
    }
  }
  std::vector<Departure> departures = LightChanges(unsaturated);
  Append(BlackLevelChanges(steps.dark), &departures);
  departures.push_back(FrameCorrelation(unsaturated));
  departures.push_back(FirstFrameDeficit(unsaturated));
  Append(LineNoiseDepartures(steps.dark), &departures);
  std::vector<const FlatFieldStatistics*> all = unsaturated;
  all.insert(all.end(), steps.dark.begin(), steps.dark.end());
  std::vector<double> signal_dn;
  for (const FlatFieldStatistics* step : all) signal_dn.push_back(steps.SignalDn(*step));
  Append(NeighbourDepartures(all, signal_dn), &departures);
  return departures;
}

double LargestShareAtZero(const FlatFieldSteps& steps) {
  double largest = 0;
  for (const FlatFieldStatistics* step : steps.dark) {
    largest = std::max(largest, step->share_at_zero);
  }
  return largest;
}

absl::StatusOr<v1::SensorDiagnosis> DiagnoseStatistics(const v1::SensorSet& set,
                                                       const SensorSetStatistics& statistics) {
  const FlatFieldSteps steps(statistics.steps);
  const Saturation saturation = FindSaturation(steps);
  SIGHTLINE_ASSIGN_OR_RETURN(auto transfer, AnalyseTransfer(steps, saturation));
  const MeasuredCamera measured{.set = set,
                                .steps = steps,
                                .saturation = saturation,
                                .standard = MeasureByStandard(steps),
                                .transfer = std::move(transfer),
                                .patterns = FindFixedPatterns(steps)};
  std::vector<Departure> departures = measured.transfer.departures;
  Append(PatternDepartures(measured.patterns), &departures);
  Append(FrameDepartures(steps, saturation), &departures);
  Append(ConverterDepartures(statistics.counts, set.bit_depth_bit(), LargestShareAtZero(steps)),
         &departures);

  v1::SensorDiagnosis answer;
  answer.set_set(set.name());
  for (const std::string& remark : SensorSetRemarks(set)) answer.add_warnings(remark);
  if (!measured.standard.warning.empty()) answer.add_warnings(measured.standard.warning);
  if (measured.transfer.undetermined.empty()) {
    AddTransferMessages(measured.transfer, steps, saturation, &answer);
  } else {
    answer.add_warnings(absl::StrCat("gain and what follows from it are not determined: ",
                                     measured.transfer.undetermined));
  }
  AddCameraValues(measured, &answer);
  AddDepartures(departures, &answer);
  return answer;
}

}  // namespace

absl::StatusOr<v1::SensorDiagnosis> DiagnoseSensor(const v1::SensorSet& set,
                                                   const SensorDiagnosisHooks& hooks) {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto statistics, ReadSensorFrames(set, hooks));
  if (hooks.on_progress) hooks.on_progress(kReadingShare, "fitting the photon transfer");
  auto answer = DiagnoseStatistics(set, statistics);
  if (hooks.on_progress) hooks.on_progress(1, "done");
  return answer;
}

}  // namespace sightline
