// SPDX-License-Identifier: Apache-2.0
// Sizes and distances with their limits.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/tolerance/tolerance.h"
#include "tools/step_import/tolerances/part21.h"
#include "tools/step_import/tolerances/pmi_reader.h"
#include "tools/step_import/tolerances/pmi_values.h"
#include "tools/step_import/tolerances/step_pmi.h"

namespace sightline::step_pmi {

void PmiReader::ReadDimension(int64_t id) {
  const std::vector<std::string_view> types = file_.Types(id);
  const bool size = std::ranges::any_of(types, IsSize);
  Tolerance tolerance;
  tolerance.id = Label(id);
  const std::string own = OwnName(id);
  const std::vector<int64_t> aspects = DimensionedAspects(id);
  if (aspects.empty()) throw Unreadable{"it does not say what it dimensions"};
  PmiBinding binding = Resolve(aspects);

  std::optional<Measure> nominal, lower, upper;
  std::vector<std::string> notes;
  ReadValues(id, nominal, lower, upper, notes);
  const auto [first, last] = ranges_.equal_range(id);
  if (std::distance(first, last) > 1) throw Unreadable{"it has more than one pair of limits"};
  if (first != last) ReadRange(first->second, nominal, lower, upper);

  const std::optional<Measure>& any = nominal ? nominal : lower ? lower : upper;
  if (!any) throw Unreadable{"the file gives no value for it"};
  const bool angle = any->angle;
  for (const auto& measure : {nominal, lower, upper}) {
    if (measure && measure->angle != angle) {
      throw Unreadable{"its values mix lengths and angles"};
    }
  }
  tolerance.kind = size
                       ? (angle ? ToleranceKind::kAngularSize : ToleranceKind::kLinearSize)
                       : (angle ? ToleranceKind::kAngularDistance : ToleranceKind::kLinearDistance);
  tolerance.name = own.empty() ? std::string(ToleranceKindName(tolerance.kind)) : own;
  const auto value = [](const std::optional<Measure>& measure) {
    return measure ? std::optional<double>(measure->value) : std::nullopt;
  };
  (angle ? tolerance.nominal_rad : tolerance.nominal_m) = value(nominal);
  (angle ? tolerance.lower_rad : tolerance.lower_m) = value(lower);
  (angle ? tolerance.upper_rad : tolerance.upper_m) = value(upper);
  tolerance.modifiers = notes;
  tolerance.text = DimensionText(id, tolerance, nominal, lower, upper);

  if (!lower || !upper) {
    if (lower || upper) {
      throw Unreadable{"it has one limit only (" + tolerance.text + "): no zone"};
    }
    pmi_.report.untoleranced.push_back(std::move(tolerance));
    pmi_.untoleranced.push_back(std::move(binding));
    return;
  }
  const double width = upper->value - lower->value;
  if (!(width > 0)) {
    throw Unreadable{"its lower limit is not below its upper one (" + tolerance.text + ")"};
  }
  (angle ? tolerance.zone_width_rad : tolerance.zone_width_m) = width;
  pmi_.report.read.push_back(std::move(tolerance));
  pmi_.read.push_back(std::move(binding));
}

void PmiReader::ReadValues(int64_t id, std::optional<Measure>& nominal,
                           std::optional<Measure>& lower, std::optional<Measure>& upper,
                           std::vector<std::string>& notes) const {
  const auto [first, last] = representations_.equal_range(id);
  for (auto it = first; it != last; ++it) {
    const Values values = Base(Records(it->second), "REPRESENTATION");
    std::vector<int64_t> items;
    CollectReferences(At(values, 1, "item"), items);
    Count(it->second, kBytesOfLink * items.size());
    for (const int64_t item : items) {
      if (file_.IsA(item, "DESCRIPTIVE_REPRESENTATION_ITEM")) {
        const Values text = Base(Records(item), "DESCRIPTIVE_REPRESENTATION_ITEM");
        if (!TextAt(text, 1).empty()) notes.push_back(TextAt(text, 1));
        continue;
      }
      const auto types = file_.Types(item);
      const bool measure_like = std::ranges::any_of(types, [](std::string_view type) {
        return type.find("MEASURE") != std::string_view::npos;
      });
      if (!measure_like) continue;  // decimal places, placements
      const Measure measure = MeasureOf(item);
      const bool low = measure.name.find("lower") != std::string::npos;
      const bool high = measure.name.find("upper") != std::string::npos;
      std::optional<Measure>& slot = low ? lower : high ? upper : nominal;
      // The same value may be given in several units.
      if (slot && std::abs(slot->value - measure.value) > 1e-3 * std::abs(slot->value)) {
        throw Unreadable{"it has two values that differ, " + std::to_string(slot->value) + " and " +
                         std::to_string(measure.value) + " (SI)"};
      }
      if (!slot) slot = measure;
    }
  }
}

void PmiReader::ReadRange(int64_t range, const std::optional<Measure>& nominal,
                          std::optional<Measure>& lower, std::optional<Measure>& upper) const {
  if (file_.IsA(range, "LIMITS_AND_FITS")) {
    const Values values = Base(Records(range), "LIMITS_AND_FITS");
    throw Unreadable{"its limits are the tolerance class " + TextAt(values, 0) + TextAt(values, 2) +
                     " (" + TextAt(values, 3) +
                     "), whose table is not built in; give its zone width by hand"};
  }
  if (!file_.IsA(range, "TOLERANCE_VALUE")) {
    throw Unreadable{"its limits are " + Label(range) + " " + TypeText(range) +
                     ", which is unknown"};
  }
  const Values values = Base(Records(range), "TOLERANCE_VALUE");
  const Measure low = MeasureOf(ReferenceAt(values, 0, "lower deviation"));
  const Measure high = MeasureOf(ReferenceAt(values, 1, "upper deviation"));
  if (low.angle != high.angle) throw Unreadable{"its deviations mix lengths and angles"};
  // Deviations from the nominal value, with their signs.
  lower = low;
  upper = high;
  if (!nominal) throw Unreadable{"it has deviations but no nominal value"};
  lower->value += nominal->value;
  upper->value += nominal->value;
}

std::string PmiReader::DimensionText(int64_t id, const Tolerance& tolerance,
                                     const std::optional<Measure>& nominal,
                                     const std::optional<Measure>& lower,
                                     const std::optional<Measure>& upper) const {
  const bool angle = IsAngular(tolerance.kind);
  const auto number = [&](double value) { return angle ? Degrees(value) : Millimetres(value); };
  std::string own;
  if (std::ranges::any_of(file_.Types(id), IsSize)) {
    const std::vector<Part21Record> records = Records(id);
    const Values* base = Partial(records, "DIMENSIONAL_SIZE");
    const Values& values = base != nullptr ? *base : records[0].values;
    const bool aspect_first = !values.empty() && values[0].kind == Kind::kText;
    own = TextAt(values, aspect_first ? 5 : 1);
  } else {
    own = FirstText(id);
  }
  std::string text = own.empty() ? std::string(ToleranceKindName(tolerance.kind)) : own;
  if (nominal) text += " " + number(nominal->value);
  if (nominal && lower && upper) {
    const double down = lower->value - nominal->value, up = upper->value - nominal->value;
    if (std::abs(up + down) <= 1e-9 * std::abs(up - down)) {
      text += " +-" + number(up);
    } else {
      text += " " + std::string(up < 0 ? "" : "+") + number(up) + "/" + (down > 0 ? "+" : "") +
              number(down);
    }
  } else if (lower && upper) {
    text += " " + number(lower->value) + " to " + number(upper->value);
  } else if (lower || upper) {
    text += lower ? " least " + number(lower->value) : " at most " + number(upper->value);
  }
  text += angle ? " deg" : " mm";
  for (const std::string& modifier : tolerance.modifiers) text += ", " + modifier;
  return text;
}

}  // namespace sightline::step_pmi
