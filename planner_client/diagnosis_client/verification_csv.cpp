// SPDX-License-Identifier: Apache-2.0
#include "planner_client/diagnosis_client/verification_csv.h"

#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/json/strict_json.h"
#include "core/text/number_text.h"

namespace sightline {
namespace {

// Quoted if need be (RFC 4180).
std::string Text(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

std::string Value(bool given, double value) {
  return given && std::isfinite(value) ? NumberText(value) : "";
}

}  // namespace

std::string VerificationCsv(const v1::Verification& verification) {
  std::string csv =
      "recording,file,channel,camera_distance_m,focus_distance_m,f_number,exposure_time_s,"
      "normalised_exposure_s,e_i,recorded_u_px,simulated_u_px,recorded_u_h_m,simulated_u_h_m,"
      "e_u\n";
  for (const v1::RecordingVerification& r : verification.recordings()) {
    for (const v1::ChannelVerification& c : r.channels()) {
      const std::vector<std::string> row = {absl::StrCat(r.recording()),
                                            Text(r.file()),
                                            Text(c.channel()),
                                            NumberText(r.camera_distance_m()),
                                            NumberText(r.focus_distance_m()),
                                            NumberText(r.f_number()),
                                            NumberText(r.exposure_time_s()),
                                            NumberText(r.normalised_exposure()),
                                            Value(c.has_e_i(), c.e_i()),
                                            Value(c.has_recorded_u_px(), c.recorded_u_px()),
                                            Value(c.has_simulated_u_px(), c.simulated_u_px()),
                                            Value(c.has_recorded_u_h_m(), c.recorded_u_h_m()),
                                            Value(c.has_simulated_u_h_m(), c.simulated_u_h_m()),
                                            Value(c.has_e_u(), c.e_u())};
      absl::StrAppend(&csv, absl::StrJoin(row, ","), "\n");
    }
  }
  return csv;
}

}  // namespace sightline
