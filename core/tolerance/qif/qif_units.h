// SPDX-License-Identifier: Apache-2.0
// Units of the lengths and angles of a QIF 3.0 document (Units.xsd).
//
// A unit is known if the file gives its UnitConversion, or if its UnitName is that of the table:
// the names of the standard's own table of conversions and the usual symbols ("mm", "inch", "deg").
// A file that gives both must not contradict the table. No unit is guessed: a value whose unit is
// not stated or not known is refused.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/tolerance/qif/qif_xml.h"

namespace sightline {

// Metres of one unit of length, radians of one unit of angle, by a name of the table ("inch", also
// "INCH" and "Inch"); nullopt: not in the table.
std::optional<double> MetresOfQifUnit(const std::string& name);
std::optional<double> RadiansOfQifUnit(const std::string& name);

// True if an error is about the length unit: a length has no known unit, or the stated unit is not
// valid, or it is given although the file states its own.
bool IsAboutQifLengthUnit(const absl::Status& status);

class QifUnits {
 public:
  // `file` starts every error message. `stated_length_unit`: the unit of lengths for which the file
  // states none or one that is not known ("mm", ...); empty: such a length is refused.
  // INVALID_ARGUMENT names line and element: SIUnitName is not the SI unit, UnitName is missing or
  // stands twice for different units, the conversion is no positive factor or contradicts the name;
  // and IsAboutQifLengthUnit if the stated unit is unknown, or if the file states its unit itself.
  // Throws QifRepeated for a second primary unit of the same element name.
  static absl::StatusOr<QifUnits> Read(const QifElement& document, const std::string& file,
                                       const std::string& stated_length_unit);

  // Metres or radians of one unit of `value`, an element with a number. The unit is that of its
  // attribute linearUnit or angularUnit, otherwise the document's primary unit; units of the PMI
  // come before the others. INVALID_ARGUMENT names line and element.
  absl::StatusOr<double> Scale(const QifElement& value, bool angle) const;

  // The units of features and of the product: units of the PMI do not count there, and angles
  // without a unit of their own are radians.
  QifUnits ForGeometry() const;

 private:
  struct Unit {
    std::string name;
    int64_t line = 0;
    // Nothing: the file gives no conversion, and the table does not have the name.
    std::optional<double> factor;
  };

  absl::Status Add(const QifElement& unit, bool angle, bool primary);
  absl::Status ErrorAt(int64_t line, const std::string& reason) const;

  std::string file_;
  std::map<std::string, Unit> linear_, angular_;  // by UnitName
  std::optional<Unit> primary_linear_, primary_angular_;
  std::optional<Unit> geometry_linear_, geometry_angular_;  // primary units that are not of the PMI
  std::optional<double> stated_length_;
};

}  // namespace sightline
