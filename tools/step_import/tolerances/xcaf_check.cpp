// SPDX-License-Identifier: Apache-2.0
#include "tools/step_import/tolerances/xcaf_check.h"

#include <Standard_Version.hxx>
#include <TCollection_HAsciiString.hxx>
#include <TDF_LabelSequence.hxx>
#include <TDocStd_Document.hxx>
#include <TopExp_Explorer.hxx>
#include <TopoDS_TShape.hxx>
#include <XCAFDimTolObjects_DimensionObject.hxx>
#include <XCAFDimTolObjects_GeomToleranceObject.hxx>
#include <XCAFDoc_DimTolTool.hxx>
#include <XCAFDoc_Dimension.hxx>
#include <XCAFDoc_DocumentTool.hxx>
#include <XCAFDoc_GeomTolerance.hxx>
#include <XCAFDoc_ShapeTool.hxx>
#include <cmath>
#include <numbers>
#include <optional>

namespace sightline {
namespace {

// Both readings convert the same decimal number.
constexpr double kSameWidthMm = 1e-6;

std::optional<ToleranceKind> KindOf(XCAFDimTolObjects_GeomToleranceType type) {
  switch (type) {
    case XCAFDimTolObjects_GeomToleranceType_Angularity:
      return ToleranceKind::kAngularity;
    case XCAFDimTolObjects_GeomToleranceType_CircularRunout:
      return ToleranceKind::kCircularRunout;
    case XCAFDimTolObjects_GeomToleranceType_CircularityOrRoundness:
      return ToleranceKind::kRoundness;
    case XCAFDimTolObjects_GeomToleranceType_Coaxiality:
      return ToleranceKind::kCoaxiality;
    case XCAFDimTolObjects_GeomToleranceType_Concentricity:
      return ToleranceKind::kConcentricity;
    case XCAFDimTolObjects_GeomToleranceType_Cylindricity:
      return ToleranceKind::kCylindricity;
    case XCAFDimTolObjects_GeomToleranceType_Flatness:
      return ToleranceKind::kFlatness;
    case XCAFDimTolObjects_GeomToleranceType_Parallelism:
      return ToleranceKind::kParallelism;
    case XCAFDimTolObjects_GeomToleranceType_Perpendicularity:
      return ToleranceKind::kPerpendicularity;
    case XCAFDimTolObjects_GeomToleranceType_Position:
      return ToleranceKind::kPosition;
    case XCAFDimTolObjects_GeomToleranceType_ProfileOfLine:
      return ToleranceKind::kLineProfile;
    case XCAFDimTolObjects_GeomToleranceType_ProfileOfSurface:
      return ToleranceKind::kSurfaceProfile;
    case XCAFDimTolObjects_GeomToleranceType_Straightness:
      return ToleranceKind::kStraightness;
    case XCAFDimTolObjects_GeomToleranceType_Symmetry:
      return ToleranceKind::kSymmetry;
    case XCAFDimTolObjects_GeomToleranceType_TotalRunout:
      return ToleranceKind::kTotalRunout;
    default:
      return std::nullopt;
  }
}

// A tolerance or dimension as XCAF has it.
struct Found {
  std::string name;
  std::optional<ToleranceKind> kind;  // of geometric tolerances only
  std::set<int> faces;
  double width_mm = 0;  // 0: it has none. Angles in degrees.
};

std::string Text(const Handle(TCollection_HAsciiString) & name) {
  return name.IsNull() ? "" : name->ToCString();
}

std::set<int> FacesOf(const TDF_LabelSequence& labels, const FaceNumbers& numbers) {
  std::set<int> faces;
  for (const TDF_Label& label : labels) {
    const std::set<int> some = NumbersOf(XCAFDoc_ShapeTool::GetShape(label), numbers);
    faces.insert(some.begin(), some.end());
  }
  return faces;
}

std::vector<Found> GeometricTolerances(const Handle(XCAFDoc_DimTolTool) & tool,
                                       const FaceNumbers& numbers) {
  std::vector<Found> all;
  TDF_LabelSequence labels, first, second;
  tool->GetGeomToleranceLabels(labels);
  for (const TDF_Label& label : labels) {
    Handle(XCAFDoc_GeomTolerance) attribute;
    if (!label.FindAttribute(XCAFDoc_GeomTolerance::GetID(), attribute)) continue;
    const Handle(XCAFDimTolObjects_GeomToleranceObject) object = attribute->GetObject();
    if (object.IsNull()) continue;
    tool->GetRefShapeLabel(label, first, second);
    all.push_back({Text(object->GetSemanticName()), KindOf(object->GetType()),
                   FacesOf(first, numbers), object->GetValue()});
  }
  return all;
}

std::vector<Found> Dimensions(const Handle(XCAFDoc_DimTolTool) & tool, const FaceNumbers& numbers) {
  std::vector<Found> all;
  TDF_LabelSequence labels, first, second;
  tool->GetDimensionLabels(labels);
  for (const TDF_Label& label : labels) {
    Handle(XCAFDoc_Dimension) attribute;
    if (!label.FindAttribute(XCAFDoc_Dimension::GetID(), attribute)) continue;
    const Handle(XCAFDimTolObjects_DimensionObject) object = attribute->GetObject();
    if (object.IsNull()) continue;
    // Pictures and labels, not dimensions.
    if (object->GetType() == XCAFDimTolObjects_DimensionType_DimensionPresentation ||
        object->GetType() == XCAFDimTolObjects_DimensionType_CommonLabel) {
      continue;
    }
    tool->GetRefShapeLabel(label, first, second);
    Found found{Text(object->GetSemanticName()), std::nullopt, FacesOf(first, numbers), 0};
    found.faces.merge(FacesOf(second, numbers));
    if (object->IsDimWithPlusMinusTolerance()) {
      // Both as magnitudes, in millimetres whatever the unit of the nominal value.
      found.width_mm = object->GetUpperTolValue() + object->GetLowerTolValue();
    } else if (object->IsDimWithRange()) {
      found.width_mm = object->GetUpperBound() - object->GetLowerBound();
    }
    all.push_back(found);
  }
  return all;
}

std::string Number(double value) {
  std::string text = std::to_string(value);
  text.erase(text.find_last_not_of('0') + 1);
  if (text.ends_with('.')) text.pop_back();
  return text;
}

double WidthMm(const Tolerance& tolerance) {
  return IsAngular(tolerance.kind) ? tolerance.zone_width_rad * 180 / std::numbers::pi
                                   : tolerance.zone_width_m * 1e3;
}

// Pairs each of `ours` with one of `theirs` of the same kind on the same faces, of the same width
// if there is one, and says how that went.
void Compare(const std::string& what, const std::vector<const Tolerance*>& ours,
             const std::vector<Found>& theirs, std::vector<std::string>& notes) {
  std::vector<const Tolerance*> partner(theirs.size(), nullptr);
  std::set<const Tolerance*> paired;
  for (const bool same_width : {true, false}) {
    for (size_t i = 0; i < theirs.size(); ++i) {
      for (const Tolerance* tolerance : ours) {
        const bool fits =
            (!theirs[i].kind || theirs[i].kind == tolerance->kind) &&
            std::set<int>(tolerance->faces.begin(), tolerance->faces.end()) == theirs[i].faces &&
            (!same_width || std::abs(theirs[i].width_mm - WidthMm(*tolerance)) < kSameWidthMm);
        if (partner[i] != nullptr || !fits || paired.contains(tolerance)) continue;
        partner[i] = tolerance;
        paired.insert(tolerance);
      }
    }
  }
  int same = 0, without = 0;
  std::vector<std::string> remarks;
  for (size_t i = 0; i < theirs.size(); ++i) {
    if (partner[i] == nullptr) {
      // What the file gives no value for is listed as not read.
      if (theirs[i].width_mm > 0) {
        remarks.push_back("OpenCASCADE alone has " + what + " " + theirs[i].name + " of " +
                          Number(theirs[i].width_mm) + ": check it");
      }
    } else if (std::abs(theirs[i].width_mm - WidthMm(*partner[i])) < kSameWidthMm) {
      ++same;
    } else if (theirs[i].width_mm == 0) {
      ++without;
    } else {
      remarks.push_back(partner[i]->name + " (" + partner[i]->id + "): the file's entities say " +
                        Number(WidthMm(*partner[i])) + ", OpenCASCADE says " +
                        Number(theirs[i].width_mm) + "; the former is used");
    }
  }
  notes.push_back("compared with OpenCASCADE " OCC_VERSION_COMPLETE ": of " +
                  std::to_string(ours.size()) + " " + what + "s it finds " +
                  std::to_string(paired.size()) + " on the same faces, " + std::to_string(same) +
                  " of them with the same width, " + std::to_string(without) + " without");
  notes.insert(notes.end(), remarks.begin(), remarks.end());
}

}  // namespace

std::set<int> NumbersOf(const TopoDS_Shape& shape, const FaceNumbers& numbers) {
  std::set<int> all;
  if (shape.IsNull()) return all;
  for (TopExp_Explorer it(shape, TopAbs_FACE); it.More(); it.Next()) {
    const auto found = numbers.find(it.Current().TShape().get());
    if (found != numbers.end()) all.insert(found->second.begin(), found->second.end());
  }
  return all;
}

std::vector<std::string> CompareWithXcaf(const Handle(TDocStd_Document) & document,
                                         const FaceNumbers& numbers,
                                         const ToleranceReport& report) {
  const Handle(XCAFDoc_DimTolTool) tool = XCAFDoc_DocumentTool::DimTolTool(document->Main());
  std::vector<const Tolerance*> tolerances, dimensions;
  for (const auto* list : {&report.read, &report.untoleranced}) {
    for (const Tolerance& tolerance : *list) {
      (IsDimension(tolerance.kind) ? dimensions : tolerances).push_back(&tolerance);
    }
  }
  std::vector<std::string> notes;
  Compare("geometric tolerance", tolerances, GeometricTolerances(tool, numbers), notes);
  Compare("dimension", dimensions, Dimensions(tool, numbers), notes);
  return notes;
}

}  // namespace sightline
