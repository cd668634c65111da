// SPDX-License-Identifier: Apache-2.0
#include "tools/step_import/model/tessellation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

#include "tools/step_import/model/length_unit.h"
#include "tools/step_import/step_input_error.h"

namespace sightline {
namespace {

using ValueKind = Part21Value::Kind;
using Values = std::vector<Part21Value>;

constexpr size_t kMostTriangles = 50'000'000;
constexpr std::array<std::string_view, 2> kBodies = {"TESSELLATED_SOLID", "TESSELLATED_SHELL"};
constexpr std::array<std::string_view, 4> kSurfaces = {
    "TRIANGULATED_FACE", "COMPLEX_TRIANGULATED_FACE", "TRIANGULATED_SURFACE_SET",
    "COMPLEX_TRIANGULATED_SURFACE_SET"};
constexpr std::array<std::string_view, 5> kExactBodies = {
    "MANIFOLD_SOLID_BREP", "BREP_WITH_VOIDS", "FACETED_BREP", "SHELL_BASED_SURFACE_MODEL",
    "FACE_BASED_SURFACE_MODEL"};
// Surfaces of other kinds: a part without them would have holes.
constexpr std::array<std::string_view, 4> kUnreadSurfaces = {
    "CUBIC_BEZIER_TRIANGULATED_FACE", "CUBIC_BEZIER_TESSELLATED_FACE",
    "REPOSITIONED_TESSELLATED_ITEM", "TESSELLATED_STRUCTURED_ITEM"};

template <size_t N>
bool IsOneOf(const Part21File& file, int64_t id, const std::array<std::string_view, N>& types) {
  return std::ranges::any_of(types, [&](std::string_view type) { return file.IsA(id, type); });
}

std::string EntityName(const Part21File& file, int64_t id) {
  const auto types = file.Types(id);
  return file.name() + ": #" + std::to_string(id) + " " +
         (types.empty() ? "" : std::string(types.front()));
}

[[noreturn]] void FailAt(const Part21File& file, int64_t id, const std::string& reason) {
  throw StepInputError(EntityName(file, id) + ": " + reason);
}

// The references directly among the values.
std::vector<int64_t> References(const Values& values) {
  std::vector<int64_t> found;
  for (const Part21Value& value : values) {
    if (value.kind == ValueKind::kReference) found.push_back(value.reference);
  }
  return found;
}

// Attributes of a simple instance.
Values Attributes(const Part21File& file, int64_t id, size_t least) {
  std::vector<Part21Record> records = file.Records(id);
  if (records.size() != 1 || records.front().values.size() < least) {
    FailAt(file, id, "has too few attributes");
  }
  return std::move(records.front().values);
}

// Name, items and context of a representation, simple or complex.
struct RepresentationValues {
  std::string name;
  std::vector<int64_t> items;
  int64_t context = 0;
};
RepresentationValues RepresentationOf(const Part21File& file, int64_t id) {
  RepresentationValues read;
  for (const Part21Record& record : file.Records(id)) {
    const Values& values = record.values;
    if (values.size() < 3 || values[1].kind != ValueKind::kList) continue;
    read.name = values[0].text;
    read.items = References(values[1].list);
    if (values[2].kind == ValueKind::kReference) read.context = values[2].reference;
    break;
  }
  return read;
}

// Sets of representations that relationships join: each is the shape of one product.
class JoinedRepresentations {
 public:
  explicit JoinedRepresentations(const Part21File& file) {
    const auto relations = file.Find([](std::string_view type) {
      return type == "SHAPE_REPRESENTATION_RELATIONSHIP" || type == "REPRESENTATION_RELATIONSHIP";
    });
    for (const int64_t id : relations) {
      // Places a component in an assembly: two products.
      if (file.IsA(id, "REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION")) continue;
      for (const Part21Record& record : file.Records(id)) {
        const auto joined = References(record.values);
        if (joined.size() == 2) Join(joined[0], joined[1]);
      }
    }
  }
  int64_t SetOf(int64_t id) {
    // Union-find with path halving.
    int64_t root = id;
    while (parent_.try_emplace(root, root).first->second != root) {
      parent_[root] = parent_[parent_[root]];
      root = parent_[root];
    }
    return root;
  }
  // Also of an instance that is no representation, such as the property that several define.
  void Join(int64_t a, int64_t b) {
    const int64_t root = SetOf(b);
    parent_[SetOf(a)] = root;
  }

 private:
  std::map<int64_t, int64_t> parent_;
};

// Joins representations that SHAPE_DEFINITION_REPRESENTATIONs use for the same product. Returns
// those of products.
std::vector<int64_t> JoinProducts(const Part21File& file, JoinedRepresentations& joined) {
  std::vector<int64_t> used;
  for (const int64_t id :
       file.Find([](std::string_view t) { return t == "SHAPE_DEFINITION_REPRESENTATION"; })) {
    const Values values = Attributes(file, id, 2);
    if (values[0].kind != ValueKind::kReference || values[1].kind != ValueKind::kReference)
      continue;
    const int64_t property = values[0].reference;
    if (!file.Has(property)) continue;
    const auto of = References(Attributes(file, property, 3));
    const bool product = std::ranges::any_of(of, [&](int64_t definition) {
      return std::ranges::any_of(file.Types(definition), [](std::string_view type) {
        return type.starts_with("PRODUCT_DEFINITION");
      });
    });
    if (!product) continue;
    joined.Join(values[1].reference, property);
    used.push_back(values[1].reference);
  }
  return used;
}

// Millimetres in one unit of the context's lengths; 0 if it states none.
double ContextMillimetres(const Part21File& file, int64_t context) {
  if (!file.Has(context)) return 0;
  const std::optional<ContextLengthUnit> unit = LengthUnitOfContext(file, context);
  return unit ? 1e3 * unit->metres : 0;
}

// Gathers the surfaces of one body.
class BodyMesher {
 public:
  BodyMesher(const Part21File& file, double millimetres) : file_(file), scale_mm_(millimetres) {}

  void AddSurface(int64_t id) {
    if (!IsOneOf(file_, id, kSurfaces))
      FailAt(file_, id, "is tessellated geometry that is not read");
    const bool complex_kind = std::ranges::any_of(
        file_.Types(id), [](std::string_view type) { return type.starts_with("COMPLEX_"); });
    const bool face = std::ranges::any_of(
        file_.Types(id), [](std::string_view type) { return type.ends_with("_FACE"); });
    // name, coordinates, pnmax, normals, [geometric_link of a face], pnindex, triangles or strips,
    // [fans of a complex one].
    const size_t indices = face ? 5 : 4;
    const Values values = Attributes(file_, id, indices + (complex_kind ? 3 : 2));
    if (values[1].kind != ValueKind::kReference) FailAt(file_, id, "has no coordinates");
    const std::vector<uint32_t>& points = Points(values[1].reference);
    const Values& map = values[indices].list;
    const auto vertex = [&](const Part21Value& value) {
      size_t index = IndexOf(id, value);
      if (!map.empty()) {
        if (index > map.size()) FailAt(file_, id, "has an index beyond its pnindex");
        index = IndexOf(id, map[index - 1]);
      }
      if (index > points.size()) FailAt(file_, id, "has an index beyond its coordinates");
      return points[index - 1];
    };
    for (const Part21Value& run : values[indices + 1].list) {
      if (run.list.size() < 3) FailAt(file_, id, "has a triangle of less than three points");
      if (!complex_kind && run.list.size() != 3) {
        FailAt(file_, id, "has a triangle of more than three points");
      }
      // Every other triangle of a strip runs the other way round.
      for (size_t i = 0; i + 2 < run.list.size(); ++i) {
        const size_t odd = i % 2;
        AddTriangle(id, vertex(run.list[i + odd]), vertex(run.list[i + 1 - odd]),
                    vertex(run.list[i + 2]));
      }
    }
    if (!complex_kind) return;
    for (const Part21Value& fan : values[indices + 2].list) {
      if (fan.list.size() < 3) FailAt(file_, id, "has a fan of less than three points");
      for (size_t i = 1; i + 1 < fan.list.size(); ++i) {
        AddTriangle(id, vertex(fan.list[0]), vertex(fan.list[i]), vertex(fan.list[i + 1]));
      }
    }
  }

  ShapeMesh Take(std::string name) {
    mesh_.name = std::move(name);
    return std::move(mesh_);
  }

 private:
  size_t IndexOf(int64_t id, const Part21Value& value) const {
    if (value.kind != ValueKind::kNumber || !(value.number >= 1 && value.number <= 1e9) ||
        value.number != std::floor(value.number)) {
      FailAt(file_, id, "has an index that is no whole number from 1");
    }
    return static_cast<size_t>(value.number);
  }

  // Numbers in the mesh of a list's points, added when it is first used.
  const std::vector<uint32_t>& Points(int64_t id) {
    const auto [place, is_new] = points_.try_emplace(id);
    if (!is_new) return place->second;
    if (!file_.IsA(id, "COORDINATES_LIST")) FailAt(file_, id, "is no COORDINATES_LIST");
    const Values values = Attributes(file_, id, 3);
    for (const Part21Value& point : values[2].list) {
      std::array<double, 3> position_mm{};
      if (point.list.size() != 3) {
        FailAt(file_, id,
               "has a point of " + std::to_string(point.list.size()) + " coordinates, must have 3");
      }
      for (size_t axis = 0; axis < 3; ++axis) {
        if (point.list[axis].kind != ValueKind::kNumber ||
            !std::isfinite(point.list[axis].number)) {
          FailAt(file_, id, "has a coordinate that is no number");
        }
        position_mm[axis] = scale_mm_ * point.list[axis].number;
      }
      place->second.push_back(static_cast<uint32_t>(mesh_.positions_mm.size()));
      mesh_.positions_mm.push_back(position_mm);
    }
    return place->second;
  }

  void AddTriangle(int64_t id, uint32_t a, uint32_t b, uint32_t c) {
    if (mesh_.triangles.size() >= kMostTriangles) {
      FailAt(file_, id, "has more than " + std::to_string(kMostTriangles) + " triangles");
    }
    if (a != b && b != c && c != a) mesh_.triangles.push_back({a, b, c});
  }

  const Part21File& file_;
  const double scale_mm_;
  ShapeMesh mesh_;
  std::map<int64_t, std::vector<uint32_t>> points_;
};

// A tessellated body and the representations that hold it. A shape aspect may refer to a body in a
// representation of its own.
struct FoundBody {
  int64_t id = 0;
  std::vector<int64_t> representations;
  std::string name;
};

std::vector<FoundBody> FindBodies(const Part21File& file) {
  std::vector<FoundBody> found;
  const auto representations = file.Find([](std::string_view type) {
    return type.ends_with("SHAPE_REPRESENTATION") ||
           type.starts_with("TESSELLATED_SHAPE_REPRESENTATION");
  });
  std::map<int64_t, size_t> known;  // index in `found`
  for (const int64_t id : representations) {
    const RepresentationValues representation = RepresentationOf(file, id);
    for (const int64_t item : representation.items) {
      if (!IsOneOf(file, item, kBodies) && !IsOneOf(file, item, kSurfaces) &&
          !IsOneOf(file, item, kUnreadSurfaces)) {
        continue;
      }
      const auto [place, is_new] = known.try_emplace(item, found.size());
      if (!is_new) {
        found[place->second].representations.push_back(id);
        continue;
      }
      std::string name = Attributes(file, item, 1).front().text;
      if (name.empty()) name = representation.name;
      if (name.empty()) name = "body";
      found.push_back({item, {id}, name});
    }
  }
  return found;
}

}  // namespace

TessellatedBodies ReadTessellation(const Part21File& file, const std::string& unit) {
  TessellatedBodies read;
  const std::vector<FoundBody> found = FindBodies(file);
  if (found.empty()) return read;
  JoinedRepresentations joined(file);
  std::set<int64_t> products, exact;
  const std::vector<int64_t> used = JoinProducts(file, joined);
  for (const int64_t id : used) products.insert(joined.SetOf(id));
  for (const int64_t id :
       file.Find([](std::string_view type) { return type.ends_with("SHAPE_REPRESENTATION"); })) {
    const std::vector<int64_t> items = RepresentationOf(file, id).items;
    if (std::ranges::any_of(items, [&](int64_t i) { return IsOneOf(file, i, kExactBodies); })) {
      exact.insert(joined.SetOf(id));
    }
  }
  const bool assembly =
      !file.Find([](std::string_view t) { return t == "NEXT_ASSEMBLY_USAGE_OCCURRENCE"; }).empty();
  for (const FoundBody& body : found) {
    const auto representation = std::ranges::find_if(
        body.representations, [&](int64_t id) { return products.contains(joined.SetOf(id)); });
    if (representation == body.representations.end()) {
      read.of_no_product.push_back(body.name);
      continue;
    }
    if (exact.contains(joined.SetOf(*representation))) {
      read.left_out.push_back(body.name);
      continue;
    }
    if (!exact.empty()) {
      FailAt(file, body.id,
             "tessellated geometry is not read beside exact geometry of another product; save all "
             "of the part as exact geometry");
    }
    if (assembly) {
      FailAt(file, body.id,
             "tessellated geometry of an assembly is not read; save it as exact geometry, or as a "
             "single part");
    }
    double millimetres = ContextMillimetres(file, RepresentationOf(file, *representation).context);
    if (millimetres > 0 && !unit.empty()) {
      FailWithSecondLengthUnit(file.name(), std::to_string(millimetres) + " mm");
    }
    if (millimetres == 0) {
      if (unit.empty()) FailWithoutLengthUnit(file.name());
      millimetres = MillimetresPer(unit);
    }
    BodyMesher mesher(file, millimetres);
    if (IsOneOf(file, body.id, kBodies)) {
      for (const int64_t face : References(Attributes(file, body.id, 2)[1].list)) {
        mesher.AddSurface(face);
      }
    } else {
      mesher.AddSurface(body.id);
    }
    ShapeMesh mesh = mesher.Take(body.name);
    if (mesh.triangles.empty()) FailAt(file, body.id, "has no triangles");
    SetOrigin(mesh);
    read.bodies.push_back(std::move(mesh));
  }
  return read;
}

std::string ItemTypesText(const Part21File& file) {
  constexpr size_t kMostNamed = 8;
  std::set<std::string> types;
  for (const int64_t id :
       file.Find([](std::string_view type) { return type.ends_with("SHAPE_REPRESENTATION"); })) {
    for (const int64_t item : RepresentationOf(file, id).items) {
      for (const std::string_view type : file.Types(item)) types.emplace(type);
    }
    if (types.size() > kMostNamed) break;
  }
  std::string text;
  size_t named = 0;
  for (const std::string& type : types) {
    if (++named > kMostNamed) return text + ", ...";
    text += (text.empty() ? "" : ", ") + type;
  }
  return text.empty() ? "nothing" : text;
}

}  // namespace sightline
