// SPDX-License-Identifier: Apache-2.0
#include "report/optics/optics_text.h"

#include <cmath>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "report/document/report_parts.h"
#include "report/page/number_text.h"

namespace sightline {
v1::OpticalSetting SettingOf(const v1::OpticsPoint& point) {
  v1::OpticalSetting setting = point.setting();
  if (setting.f_number() == 0) setting.set_f_number(point.f_number());
  if (setting.exposure_time_s() == 0) setting.set_exposure_time_s(point.exposure_time_s());
  if (setting.focus_distance_m() == 0) setting.set_focus_distance_m(point.focus_distance_m());
  return setting;
}

std::string FNumberText(double f_number) { return absl::StrCat("f/", ShortNumber(f_number)); }

std::string TiltWords(const v1::OpticalSetting& setting) {
  std::vector<std::string> words;
  if (setting.sensor_tilt_x_deg() != 0) {
    words.push_back(
        absl::StrCat(SettingText("tilt_deg", setting.sensor_tilt_x_deg()), " about its rows"));
  }
  if (setting.sensor_tilt_y_deg() != 0) {
    words.push_back(
        absl::StrCat(SettingText("tilt_deg", setting.sensor_tilt_y_deg()), " about its columns"));
  }
  return words.empty() ? "" : absl::StrCat("sensor tilted by ", absl::StrJoin(words, " and "));
}

std::string SettingWords(const v1::OpticsPoint& point) {
  const v1::OpticalSetting setting = SettingOf(point);
  std::vector<std::string> words;
  if (setting.f_number() != 0) words.push_back(FNumberText(setting.f_number()));
  if (setting.exposure_time_s() != 0) {
    words.push_back(SettingText("exposure_time_s", setting.exposure_time_s()));
    if (setting.second_exposure_time_s() != 0) {
      absl::StrAppend(&words.back(), " and ",
                      SettingText("exposure_time_s", setting.second_exposure_time_s()));
    }
  }
  if (setting.focus_distance_m() != 0) {
    words.push_back(
        absl::StrCat("focus ", SettingText("focus_distance_m", setting.focus_distance_m())));
  }
  if (setting.laser_power_w() != 0) {
    words.push_back(absl::StrCat("laser ", SettingText("laser_power_w", setting.laser_power_w())));
  }
  if (const std::string tilt = TiltWords(setting); !tilt.empty()) words.push_back(tilt);
  return absl::StrJoin(words, ", ");
}

std::string ShareText(double share) {
  if (share > 0 && share < 0.0005) return "<\u202f0.1\u202f%";
  if (share > 0.9995 && share < 1) return ">\u202f99.9\u202f%";
  if (share > 0 && share < 1) return absl::StrCat(FixedNumber(100 * share, 1), "\u202f%");
  return SettingText("share_fraction", share);
}

v1::ReportCell ShareOfLineCell(double share) {
  return NumberCell(100 * share, ShareText(share), "%");
}

double UPx(const v1::OpticsPoint& point) {
  return point.profile_coverage() > 0 ? point.u_px() : kNoNumber;
}

double ExpectedRealUPx(const v1::OpticsPoint& point) {
  return point.expected_real_u_px() > 0 ? point.expected_real_u_px() : kNoNumber;
}

}  // namespace sightline
