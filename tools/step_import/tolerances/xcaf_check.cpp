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
#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <map>
#include <numbers>
#include <optional>
#include <set>
#include <utility>

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
  std::vector<int> faces;             // ascending, each once
  double width_mm = 0;                // 0: it has none. Angles in degrees.
};

std::string Text(const Handle(TCollection_HAsciiString) & name) {
  return name.IsNull() ? "" : name->ToCString();
}

// Tolerances and dimensions of XCAF, with their faces.
class XcafReading {
 public:
  XcafReading(const Handle(XCAFDoc_DimTolTool) & tool, const FaceNumbers& numbers)
      : tool_(tool), numbers_(numbers) {}

  std::vector<Found> GeometricTolerances() {
    std::vector<Found> all;
    TDF_LabelSequence labels, first, second;
    tool_->GetGeomToleranceLabels(labels);
    for (const TDF_Label& label : labels) {
      Handle(XCAFDoc_GeomTolerance) attribute;
      if (!label.FindAttribute(XCAFDoc_GeomTolerance::GetID(), attribute)) continue;
      const Handle(XCAFDimTolObjects_GeomToleranceObject) object = attribute->GetObject();
      if (object.IsNull()) continue;
      tool_->GetRefShapeLabel(label, first, second);
      all.push_back({Text(object->GetSemanticName()), KindOf(object->GetType()), FacesOf({&first}),
                     object->GetValue()});
    }
    return all;
  }

  std::vector<Found> Dimensions() {
    std::vector<Found> all;
    TDF_LabelSequence labels, first, second;
    tool_->GetDimensionLabels(labels);
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
      tool_->GetRefShapeLabel(label, first, second);
      Found found{Text(object->GetSemanticName()), std::nullopt, FacesOf({&first, &second}), 0};
      if (object->IsDimWithPlusMinusTolerance()) {
        // Both as magnitudes, in millimetres whatever the unit of the nominal value.
        found.width_mm = object->GetUpperTolValue() + object->GetLowerTolValue();
      } else if (object->IsDimWithRange()) {
        found.width_mm = object->GetUpperBound() - object->GetLowerBound();
      }
      all.push_back(std::move(found));
    }
    return all;
  }

  // More faces than are looked at: some lack theirs.
  bool cut() const { return bound_faces_ > kMostBoundFaces; }

 private:
  std::vector<int> FacesOf(std::initializer_list<const TDF_LabelSequence*> sequences) {
    std::vector<int> faces;
    for (const TDF_LabelSequence* labels : sequences) {
      for (const TDF_Label& label : *labels) {
        if (cut()) return {};
        const std::vector<int> some = NumbersOf(XCAFDoc_ShapeTool::GetShape(label), numbers_);
        bound_faces_ += some.size();
        faces.insert(faces.end(), some.begin(), some.end());
      }
    }
    std::sort(faces.begin(), faces.end());
    faces.erase(std::unique(faces.begin(), faces.end()), faces.end());
    return faces;
  }

  Handle(XCAFDoc_DimTolTool) tool_;
  const FaceNumbers& numbers_;
  size_t bound_faces_ = 0;
};

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
  // Our tolerances without a partner, by their faces.
  std::map<std::vector<int>, std::vector<const Tolerance*>> single;
  for (const Tolerance* tolerance : ours) single[tolerance->faces].push_back(tolerance);
  size_t paired = 0;
  for (const bool same_width : {true, false}) {
    for (size_t i = 0; i < theirs.size(); ++i) {
      const auto on_same_faces = single.find(theirs[i].faces);
      if (partner[i] != nullptr || on_same_faces == single.end()) continue;
      std::vector<const Tolerance*>& candidates = on_same_faces->second;
      const auto fits = [&](const Tolerance* tolerance) {
        return (!theirs[i].kind || theirs[i].kind == tolerance->kind) &&
               (!same_width || std::abs(theirs[i].width_mm - WidthMm(*tolerance)) < kSameWidthMm);
      };
      const auto found = std::find_if(candidates.begin(), candidates.end(), fits);
      if (found == candidates.end()) continue;
      partner[i] = *found;
      candidates.erase(found);
      ++paired;
    }
  }
  int same = 0, without = 0;
  std::vector<std::string> remarks;
  for (size_t i = 0; i < theirs.size(); ++i) {
    if (partner[i] == nullptr) {
      // Tolerances to which the file gives no value are listed as not read.
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
                  std::to_string(paired) + " on the same faces, " + std::to_string(same) +
                  " of them with the same width, " + std::to_string(without) + " without");
  notes.insert(notes.end(), remarks.begin(), remarks.end());
}

}  // namespace

std::vector<int> NumbersOf(const TopoDS_Shape& shape, const FaceNumbers& numbers) {
  std::vector<int> all;
  if (shape.IsNull()) return all;
  std::set<const TopoDS_TShape*> seen;
  for (TopExp_Explorer it(shape, TopAbs_FACE); it.More(); it.Next()) {
    const TopoDS_TShape* face = it.Current().TShape().get();
    const auto found = numbers.find(face);
    if (found == numbers.end() || !seen.insert(face).second) continue;
    all.insert(all.end(), found->second.begin(), found->second.end());
  }
  std::sort(all.begin(), all.end());
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
  XcafReading xcaf(tool, numbers);
  const std::vector<Found> their_tolerances = xcaf.GeometricTolerances();
  const std::vector<Found> their_dimensions = xcaf.Dimensions();
  if (xcaf.cut()) return {"not compared with OpenCASCADE's own reading: it binds too many faces"};
  std::vector<std::string> notes;
  Compare("geometric tolerance", tolerances, their_tolerances, notes);
  Compare("dimension", dimensions, their_dimensions, notes);
  return notes;
}

}  // namespace sightline
