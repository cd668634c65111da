// SPDX-License-Identifier: Apache-2.0
#include "report/diagnosis/check_sizes.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

absl::Status SizeError(const std::string& field, int size, int expected, const char* what) {
  return absl::InvalidArgumentError(
      absl::StrFormat("report: %s has size %d, must be %d (%s)", field, size, expected, what));
}

absl::Status CheckTerm(const std::string& name, const v1::FreeFormTerm& term) {
  if (term.abscissa_values_size() != term.values_size()) {
    return SizeError(absl::StrCat(name, ".abscissa_values"), term.abscissa_values_size(),
                     term.values_size(), "size of values");
  }
  if (!term.standard_errors().empty() && term.standard_errors_size() != term.values_size()) {
    return SizeError(absl::StrCat(name, ".standard_errors"), term.standard_errors_size(),
                     term.values_size(), "size of values");
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckSizes(const v1::Diagnosis& diagnosis) {
  for (int i = 0; i < diagnosis.profiles_size(); ++i) {
    const v1::ProfileComparison& profile = diagnosis.profiles(i);
    const int rows = profile.row_px_size();
    const auto name = [&](const char* field) { return absl::StrCat("profiles[", i, "].", field); };
    const std::pair<const char*, int> needed[] = {{"observed_dn", profile.observed_dn_size()},
                                                  {"null_dn", profile.null_dn_size()}};
    const std::pair<const char*, int> optional[] = {
        {"model_dn", profile.model_dn_size()},
        {"standard_deviation_dn", profile.standard_deviation_dn_size()}};
    for (const auto& [field, size] : needed) {
      if (size != rows) return SizeError(name(field), size, rows, "size of row_px");
    }
    for (const auto& [field, size] : optional) {
      if (size != 0 && size != rows) return SizeError(name(field), size, rows, "size of row_px");
    }
  }
  for (int i = 0; i < diagnosis.region_maps_size(); ++i) {
    const v1::RegionMap& map = diagnosis.region_maps(i);
    const auto name = [&](const char* field) {
      return absl::StrCat("region_maps[", i, "].", field);
    };
    if (map.rows() < 0 || map.columns() < 0) {
      return absl::InvalidArgumentError(absl::StrFormat("report: %s is %d, must be at least 0",
                                                        name(map.rows() < 0 ? "rows" : "columns"),
                                                        std::min(map.rows(), map.columns())));
    }
    const int64_t cells = int64_t{map.rows()} * map.columns();
    const std::pair<const char*, int> fields[] = {{"null_z", map.null_z_size()},
                                                  {"model_z", map.model_z_size()}};
    for (const auto& [field, size] : fields) {
      if (size != 0 && size != cells) {
        return SizeError(name(field), size, static_cast<int>(cells), "rows x columns");
      }
    }
    if (!map.row_edges_px().empty() && map.row_edges_px_size() != map.rows() + 1) {
      return SizeError(name("row_edges_px"), map.row_edges_px_size(), map.rows() + 1, "rows + 1");
    }
    if (!map.column_edges_px().empty() && map.column_edges_px_size() != map.columns() + 1) {
      return SizeError(name("column_edges_px"), map.column_edges_px_size(), map.columns() + 1,
                       "columns + 1");
    }
    const std::pair<const char*, const google::protobuf::RepeatedField<double>*> edges[] = {
        {"row_edges_px", &map.row_edges_px()}, {"column_edges_px", &map.column_edges_px()}};
    for (const auto& [field, values] : edges) {
      for (int k = 0; k < values->size(); ++k) {
        if (std::isfinite(values->Get(k)) && (k == 0 || values->Get(k) > values->Get(k - 1))) {
          continue;
        }
        return absl::InvalidArgumentError(
            absl::StrFormat("report: %s[%d] is %g, must be finite and greater than the one before",
                            name(field), k, values->Get(k)));
      }
    }
  }
  SIGHTLINE_RETURN_IF_ERROR(CheckTerm("free_form", diagnosis.free_form()));
  for (int k = 0; k < diagnosis.further_free_forms_size(); ++k) {
    SIGHTLINE_RETURN_IF_ERROR(
        CheckTerm(absl::StrFormat("further_free_forms[%d]", k), diagnosis.further_free_forms(k)));
  }
  return absl::OkStatus();
}

}  // namespace sightline
