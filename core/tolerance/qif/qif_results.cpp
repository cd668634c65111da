// SPDX-License-Identifier: Apache-2.0
#include "core/tolerance/qif/qif_results.h"

#include <algorithm>
#include <array>
#include <map>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "core/status/status_macros.h"
#include "core/text/number.h"
#include "core/tolerance/qif/qif_units.h"
#include "core/tolerance/qif/qif_xml.h"

namespace sightline {
namespace {

constexpr std::array<const char*, 3> kKeptOfResults = {"FileUnits", "Characteristics", "Results"};
// Measured angles, by their elements without "CharacteristicMeasurement".
constexpr std::array<const char*, 4> kAngles = {"Angle", "AngleBetween", "AngleFrom",
                                                "AngularCoordinate"};
// Their values are texts.
constexpr std::array<const char*, 2> kTexts = {"UserDefinedAttribute", "UserDefinedUnit"};

// Ends reading: the file breaks the rules of QIF.
struct BrokenResults {
  absl::Status status;
};

class ResultsReader {
 public:
  ResultsReader(const QifElement& root, std::string file, QifUnits units)
      : root_(root), file_(std::move(file)), units_(std::move(units)) {}

  std::vector<QifMeasurementResults> Read() {
    IndexItems();
    const QifElement* results = root_.Child("Results");
    const QifElement* sets = results == nullptr ? nullptr : results->Child("MeasurementResultsSet");
    if (sets == nullptr) Break(root_, "the file has no <Results> with a <MeasurementResultsSet>");
    std::vector<QifMeasurementResults> read;
    for (const QifElement& set : sets->children) {
      if (set.name == "MeasurementResults") read.push_back(ReadSet(set));
    }
    return read;
  }

 private:
  [[noreturn]] void Break(const QifElement& element, const std::string& why) const {
    throw BrokenResults{absl::InvalidArgumentError(
        absl::StrCat(file_, ":", element.line, ": <", element.name, ">: ", why))};
  }

  void IndexItems() {
    const QifElement* characteristics = root_.Child("Characteristics");
    const QifElement* items =
        characteristics == nullptr ? nullptr : characteristics->Child("CharacteristicItems");
    if (items == nullptr) return;
    for (const QifElement& item : items->children) {
      const auto id = item.attributes.find("id");
      if (id != item.attributes.end() && !items_.emplace(id->second, &item).second) {
        Break(item, absl::StrCat("another characteristic item has the id ", id->second));
      }
    }
  }

  QifMeasurementResults ReadSet(const QifElement& set) const {
    QifMeasurementResults read;
    read.persistent_id = absl::AsciiStrToLower(set.ChildText("ThisResultsInstanceQPId"));
    if (const QifElement* traceability = set.Child("InspectionTraceability")) {
      if (const QifElement* plan = traceability->Child("ReferencedQIFPlanInstance"))
        read.plan_persistent_id = absl::AsciiStrToLower(plan->ChildText("ItemQPId"));
    }
    const QifElement* measured = set.Child("MeasuredCharacteristics");
    const QifElement* list =
        measured == nullptr ? nullptr : measured->Child("CharacteristicMeasurements");
    if (list == nullptr) return read;
    for (const QifElement& measurement : list->children) {
      if (measurement.name.ends_with(kMeasurement))
        read.characteristics.push_back(ReadMeasurement(measurement));
    }
    return read;
  }

  MeasuredCharacteristic ReadMeasurement(const QifElement& measurement) const {
    MeasuredCharacteristic read;
    read.item_id = measurement.ChildText("CharacteristicItemId");
    const auto found = items_.find(read.item_id);
    if (found == items_.end()) {
      Break(measurement, absl::StrCat("its <CharacteristicItemId> is \"", read.item_id,
                                      "\", which is no characteristic item of the file"));
    }
    const QifElement& item = *found->second;
    read.persistent_id = QifPersistentId(item);
    read.name = item.ChildText("Name");
    if (const QifElement* designator = item.Child("CharacteristicDesignator"))
      read.designator = designator->ChildText("Designator");
    if (const QifElement* status = measurement.Child("Status"))
      read.status = status->ChildText("CharacteristicStatusEnum");
    ReadValue(measurement, read);
    return read;
  }

  void ReadValue(const QifElement& measurement, MeasuredCharacteristic& read) const {
    const std::string kind(absl::StripSuffix(measurement.name, kMeasurement));
    const auto is = [&](const char* name) { return kind == name; };
    const QifElement* value = measurement.Child("Value");
    if (value == nullptr || std::any_of(kTexts.begin(), kTexts.end(), is)) return;
    const bool angle = std::any_of(kAngles.begin(), kAngles.end(), is);
    const auto scale = units_.Scale(*value, angle);
    if (!scale.ok()) throw BrokenResults{scale.status()};
    (angle ? read.value_rad : read.value_m) = *scale * Number(*value, value->text);
    const auto uncertainty = value->attributes.find("combinedUncertainty");
    if (uncertainty == value->attributes.end()) return;
    const double standard = Number(*value, uncertainty->second);
    if (standard < 0) {
      Break(*value, absl::StrCat("combinedUncertainty is ", uncertainty->second, "; must be >= 0"));
    }
    (angle ? read.standard_uncertainty_rad : read.standard_uncertainty_m) = *scale * standard;
  }

  double Number(const QifElement& element, const std::string& text) const {
    const auto number = ParseReal(text);
    if (!number.ok()) Break(element, std::string(number.status().message()));
    return *number;
  }

  static constexpr const char* kMeasurement = "CharacteristicMeasurement";

  const QifElement& root_;
  std::string file_;
  QifUnits units_;
  std::map<std::string, const QifElement*> items_;
};

}  // namespace

absl::StatusOr<std::vector<QifMeasurementResults>> ReadQifResults(const std::string& file,
                                                                  const std::string& schema_folder,
                                                                  const std::string& length_unit) {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto root, ReadQifXml(file, schema_folder, kKeptOfResults));
  try {
    SIGHTLINE_ASSIGN_OR_RETURN(auto units, QifUnits::Read(root, file, length_unit));
    return ResultsReader(root, file, std::move(units)).Read();
  } catch (const BrokenResults& broken) {
    return broken.status;
  } catch (const QifRepeated& repeated) {
    return absl::InvalidArgumentError(absl::StrCat(
        file, ":", repeated.line, ": <", repeated.name, "> stands twice in <", repeated.parent,
        ">, must stand once; the first is in line ", repeated.first_line));
  }
}

}  // namespace sightline
