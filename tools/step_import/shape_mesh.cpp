// SPDX-License-Identifier: Apache-2.0
#include "tools/step_import/shape_mesh.h"

#include <BRepGProp.hxx>
#include <BRepMesh_IncrementalMesh.hxx>
#include <BRep_Tool.hxx>
#include <GProp_GProps.hxx>
#include <IMeshTools_Parameters.hxx>
#include <Poly_PolygonOnTriangulation.hxx>
#include <Poly_Triangulation.hxx>
#include <Standard_Failure.hxx>
#include <TopExp.hxx>
#include <TopExp_Explorer.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>
#include <TopoDS_Shape.hxx>
#include <TopoDS_Vertex.hxx>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>
#include <stdexcept>
#include <string>
#include <tuple>
#include <unordered_map>
#include <utility>

namespace sightline {
namespace {

using Point = std::array<double, 3>;
using Triangle = std::array<std::uint32_t, 3>;

constexpr std::uint32_t kUnset = 0xffffffffu;

std::uint64_t EdgeKey(std::uint32_t a, std::uint32_t b) {
  return (static_cast<std::uint64_t>(std::min(a, b)) << 32) | std::max(a, b);
}

Point Cross(const Point& a, const Point& b, const Point& c) {
  const Point u = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
  const Point v = {c[0] - a[0], c[1] - a[1], c[2] - a[2]};
  return {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
}

double Norm(const Point& v) { return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

// As the file stores it.
std::array<float, 3> FloatMetres(const ShapeMesh& mesh, const Point& p_mm) {
  std::array<float, 3> stored;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    stored[axis] = static_cast<float>((p_mm[axis] - mesh.origin_mm[axis]) * 1e-3);
  }
  return stored;
}

// Place at which people find a face in a viewer: " with a corner at (1, 2, 3) mm".
std::string Place(const TopoDS_Face& face) {
  const TopExp_Explorer corner(face, TopAbs_VERTEX);
  if (!corner.More()) return "";
  const gp_Pnt p = BRep_Tool::Pnt(TopoDS::Vertex(corner.Current()));
  std::ostringstream text;
  text << " with a corner at (" << p.X() << ", " << p.Y() << ", " << p.Z() << ") mm";
  return text.str();
}

// One mesh vertex per model vertex and per inner point of a discretised model edge.
class Welder {
 public:
  explicit Welder(const TopoDS_Shape& shape) {
    TopExp::MapShapes(shape, TopAbs_VERTEX, vertices_);
    TopExp::MapShapes(shape, TopAbs_EDGE, edges_);
    vertex_ids_.assign(static_cast<std::size_t>(vertices_.Extent()) + 1, kUnset);
    edge_ids_.resize(static_cast<std::size_t>(edges_.Extent()) + 1);
  }

  void AddFace(const TopoDS_Face& face) {
    TopLoc_Location location;
    const Handle(Poly_Triangulation) triangulation = BRep_Tool::Triangulation(face, location);
    ++faces_;
    if (triangulation.IsNull()) {
      throw std::runtime_error("face " + std::to_string(faces_) + " of the body" + Place(face) +
                               " cannot be meshed");
    }
    std::vector<Point> nodes(static_cast<std::size_t>(triangulation->NbNodes()) + 1);
    for (int i = 1; i <= triangulation->NbNodes(); ++i) {
      const gp_Pnt p = triangulation->Node(i).Transformed(location.Transformation());
      nodes[static_cast<std::size_t>(i)] = {p.X(), p.Y(), p.Z()};
    }
    std::vector<std::uint32_t> ids(nodes.size(), kUnset);

    for (TopExp_Explorer it(face, TopAbs_EDGE); it.More(); it.Next()) {
      const TopoDS_Edge edge = TopoDS::Edge(it.Current());
      // A seam is met twice, once in each direction, each time with its own row of nodes.
      const Handle(Poly_PolygonOnTriangulation) polygon =
          BRep_Tool::PolygonOnTriangulation(edge, triangulation, location);
      if (!polygon.IsNull()) WeldEdge(edge, *polygon, nodes, ids);
    }
    for (std::size_t i = 1; i < nodes.size(); ++i) {
      if (ids[i] == kUnset) ids[i] = AddPoint(nodes[i]);
    }

    const bool reversed = face.Orientation() == TopAbs_REVERSED;
    const bool mirrored = location.Transformation().VectorialPart().Determinant() < 0.0;
    for (int i = 1; i <= triangulation->NbTriangles(); ++i) {
      int a = 0, b = 0, c = 0;
      triangulation->Triangle(i).Get(a, b, c);
      if (reversed != mirrored) std::swap(b, c);
      const Triangle t = {ids[static_cast<std::size_t>(a)], ids[static_cast<std::size_t>(b)],
                          ids[static_cast<std::size_t>(c)]};
      if (t[0] != t[1] && t[1] != t[2] && t[2] != t[0]) mesh_.triangles.push_back(t);
    }
  }

  ShapeMesh Take() { return std::move(mesh_); }

 private:
  std::uint32_t AddPoint(const Point& p) {
    mesh_.positions_mm.push_back(p);
    return static_cast<std::uint32_t>(mesh_.positions_mm.size() - 1);
  }

  std::uint32_t VertexId(const TopoDS_Vertex& vertex) {
    std::uint32_t& id = vertex_ids_[static_cast<std::size_t>(vertices_.FindIndex(vertex))];
    if (id == kUnset) {
      const gp_Pnt p = BRep_Tool::Pnt(vertex);
      id = AddPoint({p.X(), p.Y(), p.Z()});
    }
    return id;
  }

  void WeldEdge(const TopoDS_Edge& edge, const Poly_PolygonOnTriangulation& polygon,
                const std::vector<Point>& nodes, std::vector<std::uint32_t>& ids) {
    // Ends in the sense of the curve, as the nodes of the polygon are.
    const TopoDS_Edge forward = TopoDS::Edge(edge.Oriented(TopAbs_FORWARD));
    const TopoDS_Vertex first = TopExp::FirstVertex(forward);
    const TopoDS_Vertex last = TopExp::LastVertex(forward);
    const int count = polygon.NbNodes();
    const bool collapsed = BRep_Tool::Degenerated(edge);
    std::vector<std::uint32_t>& known = edge_ids_[static_cast<std::size_t>(edges_.FindIndex(edge))];
    if (known.empty()) known.assign(static_cast<std::size_t>(count), kUnset);
    if (known.size() != static_cast<std::size_t>(count)) {
      throw std::runtime_error("two faces of the model disagree about the points of their edge");
    }
    for (int k = 1; k <= count; ++k) {
      const std::size_t node = static_cast<std::size_t>(polygon.Node(k));
      std::uint32_t& id = known[static_cast<std::size_t>(k - 1)];
      if (id == kUnset) {
        if ((collapsed || k == 1) && !first.IsNull()) {
          id = VertexId(first);
        } else if (k == count && !last.IsNull()) {
          id = VertexId(last);
        } else {
          id = AddPoint(nodes[node]);
        }
      }
      ids[node] = id;
    }
  }

  std::size_t faces_ = 0;  // so far
  TopTools_IndexedMapOfShape vertices_, edges_;
  std::vector<std::uint32_t> vertex_ids_;
  std::vector<std::vector<std::uint32_t>> edge_ids_;
  ShapeMesh mesh_;
};

double EdgeLength(const ShapeMesh& mesh, const Triangle& t, int k) {
  const Point& p = mesh.positions_mm[t[k]];
  const Point& q = mesh.positions_mm[t[(k + 1) % 3]];
  return std::hypot(p[0] - q[0], p[1] - q[1], p[2] - q[2]);
}

bool FlatAsFloat(const ShapeMesh& mesh, const Triangle& t) {
  std::array<Point, 3> p;
  for (int k = 0; k < 3; ++k) {
    const std::array<float, 3> f = FloatMetres(mesh, mesh.positions_mm[t[k]]);
    p[k] = {f[0], f[1], f[2]};
  }
  return Norm(Cross(p[0], p[1], p[2])) <= 0.0;
}

// Gives the long edge of a triangle without area to its middle vertex: the triangle and its
// neighbour across that edge become two triangles with area. The surface stays the same.
void FlipFlatTriangles(ShapeMesh& mesh) {
  std::vector<std::size_t> flat;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    if (FlatAsFloat(mesh, mesh.triangles[i])) flat.push_back(i);
  }
  if (flat.empty()) return;
  std::unordered_map<std::uint64_t, std::vector<std::size_t>> at_edge;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Triangle& t = mesh.triangles[i];
    for (int k = 0; k < 3; ++k) at_edge[EdgeKey(t[k], t[(k + 1) % 3])].push_back(i);
  }
  for (const std::size_t i : flat) {
    const Triangle t = mesh.triangles[i];
    int longest = 0;
    for (int k = 1; k < 3; ++k) {
      if (EdgeLength(mesh, t, k) > EdgeLength(mesh, t, longest)) longest = k;
    }
    const std::uint32_t a = t[longest], b = t[(longest + 1) % 3], middle = t[(longest + 2) % 3];
    const std::vector<std::size_t>& pair = at_edge[EdgeKey(a, b)];
    if (pair.size() != 2) continue;
    const std::size_t other = pair[0] == i ? pair[1] : pair[0];
    const Triangle& n = mesh.triangles[other];
    const int at_b = static_cast<int>(std::find(n.begin(), n.end(), b) - n.begin());
    if (at_b == 3 || n[(at_b + 1) % 3] != a)
      continue;  // changed by an earlier flip, or misoriented
    const std::uint32_t opposite = n[(at_b + 2) % 3];
    const Triangle first = {a, opposite, middle}, second = {opposite, b, middle};
    if (at_edge.contains(EdgeKey(middle, opposite)) || FlatAsFloat(mesh, first) ||
        FlatAsFloat(mesh, second)) {
      continue;
    }
    mesh.triangles[i] = first;
    mesh.triangles[other] = second;
    at_edge.erase(EdgeKey(a, b));
    at_edge[EdgeKey(middle, opposite)] = {i, other};
    for (const auto& [from, to, owner, previous] :
         {std::tuple{a, opposite, i, other}, std::tuple{b, middle, other, i}}) {
      std::vector<std::size_t>& owners = at_edge[EdgeKey(from, to)];
      std::replace(owners.begin(), owners.end(), previous, owner);
    }
  }
}

double AreaOfTriangles(const TopoDS_Face& face) {
  TopLoc_Location location;
  const Handle(Poly_Triangulation) triangulation = BRep_Tool::Triangulation(face, location);
  if (triangulation.IsNull()) return 0;
  double area = 0;
  for (int i = 1; i <= triangulation->NbTriangles(); ++i) {
    std::array<int, 3> nodes{};
    triangulation->Triangle(i).Get(nodes[0], nodes[1], nodes[2]);
    std::array<Point, 3> p;
    for (std::size_t k = 0; k < 3; ++k) {
      const gp_Pnt node = triangulation->Node(nodes[k]).Transformed(location.Transformation());
      p[k] = {node.X(), node.Y(), node.Z()};
    }
    area += 0.5 * Norm(Cross(p[0], p[1], p[2]));
  }
  return area;
}

}  // namespace

ShapeMesh MeshShape(const TopoDS_Shape& shape, const MeshingOptions& options) {
  if (!(options.chord_tolerance_mm > 0.0)) {
    throw std::invalid_argument("chord_tolerance_mm must be > 0");
  }
  if (!(options.angular_tolerance_deg > 0.0 && options.angular_tolerance_deg <= 90.0)) {
    throw std::invalid_argument("angular_tolerance_deg must be in (0, 90]");
  }
  IMeshTools_Parameters parameters;
  parameters.Deflection = options.chord_tolerance_mm;
  parameters.Angle = options.angular_tolerance_deg * std::numbers::pi / 180.0;
  parameters.Relative = false;
  parameters.InParallel = false;
  const BRepMesh_IncrementalMesh mesher(shape, parameters);

  Welder welder(shape);
  for (TopExp_Explorer it(shape, TopAbs_FACE); it.More(); it.Next()) {
    welder.AddFace(TopoDS::Face(it.Current()));
  }
  ShapeMesh mesh = welder.Take();
  SetOrigin(mesh);
  FlipFlatTriangles(mesh);
  return mesh;
}

std::vector<FaceTriangles> TriangulatedFaces(const TopoDS_Shape& shape, bool turned) {
  std::vector<FaceTriangles> faces;
  for (TopExp_Explorer it(shape, TopAbs_FACE); it.More(); it.Next()) {
    const TopoDS_Face face = TopoDS::Face(it.Current());
    TopLoc_Location location;
    const Handle(Poly_Triangulation) triangulation = BRep_Tool::Triangulation(face, location);
    if (triangulation.IsNull()) throw std::runtime_error("a face of the model is not meshed");
    FaceTriangles out;
    for (int i = 1; i <= triangulation->NbNodes(); ++i) {
      const gp_Pnt p = triangulation->Node(i).Transformed(location.Transformation());
      // Finer digits would say nothing about a surface known to a chord of 0.05 mm.
      const auto metres = [](double mm) { return std::round(mm * 1e6) / 1e9; };
      out.positions_m.emplace_back(metres(p.X()), metres(p.Y()), metres(p.Z()));
    }
    const bool reversed = face.Orientation() == TopAbs_REVERSED;
    const bool mirrored = location.Transformation().VectorialPart().Determinant() < 0.0;
    for (int i = 1; i <= triangulation->NbTriangles(); ++i) {
      int a = 0, b = 0, c = 0;
      triangulation->Triangle(i).Get(a, b, c);
      if ((reversed != mirrored) != turned) std::swap(b, c);
      out.triangles.push_back({static_cast<std::uint32_t>(a - 1), static_cast<std::uint32_t>(b - 1),
                               static_cast<std::uint32_t>(c - 1)});
    }
    faces.push_back(std::move(out));
  }
  return faces;
}

std::vector<std::string> FacesOfOtherArea(const TopoDS_Shape& shape,
                                          const MeshingOptions& options) {
  constexpr double kLargestShare = 0.05;
  constexpr std::size_t kMostNamed = 10;
  std::vector<std::string> texts;
  std::size_t number = 0, more = 0;
  for (TopExp_Explorer it(shape, TopAbs_FACE); it.More(); it.Next()) {
    const TopoDS_Face face = TopoDS::Face(it.Current());
    ++number;
    const double meshed = AreaOfTriangles(face);
    double exact = 0, edges = 0;
    try {
      GProp_GProps surface, lines;
      BRepGProp::SurfaceProperties(face, surface);
      BRepGProp::LinearProperties(face, lines);
      exact = surface.Mass();
      edges = lines.Mass();
    } catch (const Standard_Failure&) {
      continue;  // its area is not known
    }
    const double tolerated =
        kLargestShare * std::abs(exact) + options.chord_tolerance_mm * std::abs(edges);
    if (std::abs(meshed - std::abs(exact)) <= tolerated) continue;
    if (texts.size() == kMostNamed) {
      ++more;
      continue;
    }
    std::ostringstream text;
    text << "face " << number << " of the body" << Place(face) << " has an area of "
         << std::abs(exact) << " mm2, its triangles have " << meshed
         << " mm2: look at it before you trust what is planned there";
    texts.push_back(text.str());
  }
  if (more > 0)
    texts.push_back(std::to_string(more) + " more faces have triangles of another area");
  return texts;
}

void SetOrigin(ShapeMesh& mesh) {
  constexpr double kNear_mm = 2000;
  mesh.origin_mm = {};
  if (mesh.positions_mm.empty()) return;
  Point low = mesh.positions_mm.front(), high = low;
  for (const Point& p : mesh.positions_mm) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], p[axis]);
      high[axis] = std::max(high[axis], p[axis]);
    }
  }
  const auto near = [](double coordinate) { return std::abs(coordinate) <= kNear_mm; };
  if (std::ranges::all_of(low, near) && std::ranges::all_of(high, near)) return;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    mesh.origin_mm[axis] = std::round((low[axis] + high[axis]) / 2);
  }
}

MeshHealth CheckMesh(const ShapeMesh& mesh) {
  MeshHealth health;
  // Per undirected edge: uses along the order of its key and against it.
  std::unordered_map<std::uint64_t, std::pair<int, int>> uses;
  uses.reserve(mesh.triangles.size() * 2);
  for (const Triangle& t : mesh.triangles) {
    for (int k = 0; k < 3; ++k) {
      const std::uint32_t a = t[k], b = t[(k + 1) % 3];
      auto& use = uses[EdgeKey(a, b)];
      ++(a < b ? use.first : use.second);
    }
    const Point& a = mesh.positions_mm[t[0]];
    const Point& b = mesh.positions_mm[t[1]];
    const Point& c = mesh.positions_mm[t[2]];
    const Point n = Cross(a, b, c);
    health.area_mm2 += 0.5 * Norm(n);
    health.volume_mm3 += (a[0] * n[0] + a[1] * n[1] + a[2] * n[2]) / 6.0;
    if (FlatAsFloat(mesh, t)) ++health.degenerate_triangles;
  }
  for (const auto& [key, use] : uses) {
    const int total = use.first + use.second;
    if (total == 1) {
      ++health.boundary_edges;
    } else if (total > 2) {
      ++health.non_manifold_edges;
    } else if (use.first != 1) {
      ++health.misoriented_edges;
    }
  }
  std::vector<std::array<float, 3>> stored;
  stored.reserve(mesh.positions_mm.size());
  for (const Point& p : mesh.positions_mm) stored.push_back(FloatMetres(mesh, p));
  std::sort(stored.begin(), stored.end());
  for (std::size_t i = 1; i < stored.size(); ++i) {
    if (stored[i] == stored[i - 1]) ++health.repeated_positions;
  }
  return health;
}

}  // namespace sightline
