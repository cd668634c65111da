// SPDX-License-Identifier: Apache-2.0
#include "planning/requirements/characteristic_of.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

// Recognition tolerances: targets lie on mesh facets, up to the chord tolerance off the surface.
constexpr Recognition kOnFacets{2e-4, 0.3};

// A surface with the targets of the plan that lie on it.
struct TargetedSurface {
  NominalSurface surface;
  bool width = false;
  std::vector<uint32_t> targets;
};

class SurfaceBinder {
 public:
  SurfaceBinder(const Requirements& requirements, const TargetSet& targets)
      : requirements_(requirements), targets_(targets) {}

  // Surfaces of faces; those of one nominal surface are joined. A target belongs to one of them.
  std::vector<TargetedSurface> SurfacesOf(const std::vector<const FaceSurface*>& faces) const {
    std::vector<TargetedSurface> surfaces;
    std::set<uint32_t> taken;
    for (const FaceSurface* face : faces) {
      const auto nominal = requirements_.nominal.find(face->face());
      TargetedSurface found;
      if (nominal != requirements_.nominal.end()) found.surface = nominal->second;
      for (size_t t = 0; t < targets_.size(); ++t) {
        if (!face->Contains(targets_.positions_m[t].cast<double>(),
                            targets_.normals[t].cast<double>()) ||
            !taken.insert(static_cast<uint32_t>(t)).second) {
          continue;
        }
        found.targets.push_back(static_cast<uint32_t>(t));
      }
      const auto same = std::find_if(
          surfaces.begin(), surfaces.end(),
          [&](const TargetedSurface& other) { return SameSurface(other.surface, found.surface); });
      if (same == surfaces.end()) {
        surfaces.push_back(std::move(found));
      } else {
        same->targets.insert(same->targets.end(), found.targets.begin(), found.targets.end());
      }
    }
    return surfaces;
  }

  // Surface fitted to the targets themselves, for boxes and materials.
  TargetedSurface SurfaceOfTargets(std::vector<uint32_t> chosen) const {
    constexpr size_t kMostPoints = 400;
    std::vector<Eigen::Vector3d> points, normals;
    const size_t stride = chosen.size() / kMostPoints + 1;
    for (size_t i = 0; i < chosen.size(); i += stride) {
      points.push_back(targets_.positions_m[chosen[i]].cast<double>());
      normals.push_back(targets_.normals[chosen[i]].cast<double>().normalized());
    }
    return {RecogniseSurface(points, normals, kOnFacets), false, std::move(chosen)};
  }

 private:
  const Requirements& requirements_;
  const TargetSet& targets_;
};

// Joins pairs of parallel planes with opposite normals.
void JoinWidths(std::vector<TargetedSurface>& surfaces) {
  for (size_t a = 0; a < surfaces.size(); ++a) {
    if (surfaces[a].surface.kind != SurfaceKind::kPlane || surfaces[a].width) continue;
    for (size_t b = a + 1; b < surfaces.size(); ++b) {
      if (surfaces[b].surface.kind != SurfaceKind::kPlane || surfaces[b].width) continue;
      if (surfaces[a].surface.axis.dot(surfaces[b].surface.axis) > -1 + 1e-8) continue;
      surfaces[a].width = true;
      surfaces[a].targets.insert(surfaces[a].targets.end(), surfaces[b].targets.begin(),
                                 surfaces[b].targets.end());
      surfaces.erase(surfaces.begin() + static_cast<std::ptrdiff_t>(b));
      break;
    }
  }
}

bool IsPlaceOrOrientation(ToleranceKind kind) {
  switch (kind) {
    case ToleranceKind::kPosition:
    case ToleranceKind::kConcentricity:
    case ToleranceKind::kCoaxiality:
    case ToleranceKind::kSymmetry:
    case ToleranceKind::kParallelism:
    case ToleranceKind::kPerpendicularity:
    case ToleranceKind::kAngularity:
      return true;
    default:
      return false;
  }
}

bool IsProfile(ToleranceKind kind) {
  return kind == ToleranceKind::kSurfaceProfile || kind == ToleranceKind::kLineProfile;
}

std::string TooFewTargets(size_t count, const std::string& on) {
  return absl::StrCat("only ", count, count == 1 ? " target lies on " : " targets lie on ", on,
                      ", at least ", kFewestFeatureTargets,
                      " are needed: sample it more densely (targets.spacing_m or a region)");
}

// Letters of a datum as written: "A", "B(M)", "C-D".
std::vector<std::string> LettersOf(const std::string& datum) {
  std::vector<std::string> letters;
  std::string letter;
  int depth = 0;
  for (const char c : datum + "-") {
    if (c == '(' || c == '[') ++depth;
    if (depth == 0 && c == '-') {
      if (!letter.empty()) letters.push_back(letter);
      letter.clear();
    } else if (depth == 0 && c != ' ') {
      letter += c;
    }
    if (c == ')' || c == ']') --depth;
  }
  return letters;
}

absl::StatusOr<std::vector<TargetedSurface>> SurfacesOfDatum(const std::string& datum,
                                                             const Requirements& requirements,
                                                             const SurfaceBinder& binder) {
  std::vector<const FaceSurface*> faces;
  for (const std::string& letter : LettersOf(datum)) {
    const auto found =
        std::find_if(requirements.datums.begin(), requirements.datums.end(),
                     [&](const Datum& d) { return !d.target && d.letter == letter; });
    if (found == requirements.datums.end()) {
      return absl::UnimplementedError(absl::StrCat("the file has no datum ", letter));
    }
    const size_t before = faces.size();
    for (const FaceSurface& face : requirements.datum_faces) {
      if (std::find(found->faces.begin(), found->faces.end(), face.face()) != found->faces.end())
        faces.push_back(&face);
    }
    if (faces.size() == before) {
      return absl::UnimplementedError(
          absl::StrCat("its datum ", letter,
                       " binds no face: datum targets, points and lines are not evaluated"));
    }
  }
  std::vector<TargetedSurface> surfaces = binder.SurfacesOf(faces);
  JoinWidths(surfaces);
  for (const TargetedSurface& surface : surfaces) {
    if (surface.targets.size() >= kFewestFeatureTargets) continue;
    return absl::UnimplementedError(
        TooFewTargets(surface.targets.size(), absl::StrCat("a surface of its datum ", datum)));
  }
  return surfaces;
}

// Takes every n-th target of each surface so that the sum is at most `most`.
void Thin(std::vector<TargetedSurface*>& surfaces, size_t most) {
  size_t total = 0;
  for (const TargetedSurface* surface : surfaces) total += surface->targets.size();
  if (total <= most) return;
  const double share = static_cast<double>(most) / static_cast<double>(total);
  for (TargetedSurface* surface : surfaces) {
    const size_t count = surface->targets.size();
    const size_t kept = std::min(
        count,
        std::max(kFewestFeatureTargets, static_cast<size_t>(share * static_cast<double>(count))));
    std::vector<uint32_t> chosen;
    for (size_t i = 0; i < kept; ++i) chosen.push_back(surface->targets[i * count / kept]);
    surface->targets = std::move(chosen);
  }
}

// Indices of a surface's targets within the characteristic. Targets of several surfaces appear
// there only once.
FeatureElement ElementOf(const TargetedSurface& surface, std::map<uint32_t, int>& index,
                         std::vector<uint32_t>& targets) {
  FeatureElement element;
  element.surface = surface.surface;
  element.width = surface.width;
  for (const uint32_t t : surface.targets) {
    const auto [entry, fresh] = index.try_emplace(t, static_cast<int>(targets.size()));
    if (fresh) targets.push_back(t);
    element.targets.push_back(entry->second);
  }
  return element;
}

}  // namespace

absl::StatusOr<BoundCharacteristic> BindCharacteristic(const TolerancedFeature& feature,
                                                       const Requirements& requirements,
                                                       const TargetSet& targets,
                                                       size_t most_targets) {
  const SurfaceBinder binder(requirements, targets);
  std::vector<TargetedSurface> own;
  const bool by_hand = feature.id.empty();
  if (feature.box_m || feature.by_material) {
    own = {binder.SurfaceOfTargets(requirements.TargetsOf(feature, targets))};
  } else {
    std::vector<const FaceSurface*> faces;
    for (const FaceSurface& face : feature.faces) faces.push_back(&face);
    own = binder.SurfacesOf(faces);
  }
  if (IsPlaceOrOrientation(feature.kind)) JoinWidths(own);
  size_t count = 0, fewest = targets.size();
  for (const TargetedSurface& surface : own) {
    count += surface.targets.size();
    fewest = std::min(fewest, surface.targets.size());
  }
  if (count < kFewestFeatureTargets) return absl::UnimplementedError(TooFewTargets(count, "it"));
  if (fewest < kFewestFeatureTargets && !IsProfile(feature.kind)) {
    return absl::UnimplementedError(
        TooFewTargets(fewest, absl::StrCat("one of its ", own.size(), " surfaces")));
  }

  BoundCharacteristic bound;
  Characteristic& c = bound.characteristic;
  c.kind = feature.kind;
  c.exact_datum = by_hand;
  c.association = feature.association;
  std::vector<std::vector<TargetedSurface>> datums;
  for (const std::string& datum : feature.datums) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto surfaces, SurfacesOfDatum(datum, requirements, binder));
    datums.push_back(std::move(surfaces));
  }
  std::vector<TargetedSurface*> all;
  for (TargetedSurface& surface : own) all.push_back(&surface);
  for (auto& datum : datums) {
    for (TargetedSurface& surface : datum) all.push_back(&surface);
  }
  Thin(all, most_targets);
  std::map<uint32_t, int> index;
  for (const TargetedSurface& surface : own) {
    c.elements.push_back(ElementOf(surface, index, bound.targets));
  }
  bound.own_targets = bound.targets.size();
  for (const auto& datum : datums) {
    std::vector<FeatureElement>& group = c.datums.emplace_back();
    for (const TargetedSurface& surface : datum) {
      group.push_back(ElementOf(surface, index, bound.targets));
    }
  }
  const NominalSurface& first = c.elements.front().surface;
  const double radius_m = first.kind == SurfaceKind::kTorus ? first.tube_radius_m : first.radius_m;
  if (feature.kind == ToleranceKind::kLinearSize && feature.nominal_m && radius_m > 0) {
    c.radius =
        std::abs(*feature.nominal_m - radius_m) < std::abs(*feature.nominal_m - 2 * radius_m);
  }
  const bool sized = std::all_of(c.elements.begin(), c.elements.end(), [](const auto& element) {
    return element.width || element.surface.kind == SurfaceKind::kCylinder ||
           element.surface.kind == SurfaceKind::kSphere;
  });
  if (sized && feature.smallest_size_m && feature.kind == ToleranceKind::kPosition)
    c.material = feature.material;
  return bound;
}

}  // namespace sightline
