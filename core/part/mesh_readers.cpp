#include "core/part/mesh_readers.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <charconv>
#include <cmath>

namespace sightline {
namespace {

bool IsSpace(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f'; }

// Twice the signed area of the corner a-b-c in the plane normal to n.
double Turn(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
            const Eigen::Vector3d& n) {
  return (b - a).cross(c - b).dot(n);
}

// Cutting ears takes quadratic time; a larger polygon is fanned.
constexpr size_t kMaxEarPolygon = 4096;

}  // namespace

void RawMesh::SetMaterialOfNewTriangles(const std::string& name) {
  if (triangle_material.size() == triangles.size()) return;
  auto found = std::find(material_names.begin(), material_names.end(), name);
  if (found == material_names.end()) {
    // More names than an index can tell apart: the rest has no material of its own.
    constexpr size_t kMaxMaterials = 65'535;
    if (material_names.size() >= kMaxMaterials) material_names.back().clear();
    if (material_names.size() < kMaxMaterials) material_names.push_back(name);
    found = material_names.end() - 1;
  }
  triangle_material.resize(triangles.size(), static_cast<uint16_t>(found - material_names.begin()));
}

std::string_view TextScanner::WordInLine() {
  while (position_ < text_.size() && IsSpace(text_[position_])) ++position_;
  const size_t start = position_;
  while (position_ < text_.size() && !IsSpace(text_[position_]) && text_[position_] != '\n') {
    ++position_;
  }
  return text_.substr(start, position_ - start);
}

bool TextScanner::NextLine() {
  while (position_ < text_.size() && text_[position_] != '\n') ++position_;
  if (position_ >= text_.size()) return false;
  ++position_;
  ++line_;
  return true;
}

std::string_view TextScanner::Word() {
  while (true) {
    const std::string_view word = WordInLine();
    if (!word.empty() || !NextLine()) return word;
  }
}

std::string Excerpt(std::string_view word) { return std::string(word.substr(0, 40)); }

bool ParseNumber(std::string_view word, double* value) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  const char* end = word.data() + word.size();
  const auto result = std::from_chars(word.data(), end, *value);
  if (result.ec == std::errc::result_out_of_range && result.ptr == end) {
    // Too small for a double counts as zero; too large is the caller's infinity.
    const size_t exponent = word.find_first_of("eE");
    const bool tiny = exponent != std::string_view::npos && word.substr(exponent + 1, 1) == "-";
    *value = tiny ? 0 : HUGE_VAL;
    return true;
  }
  return result.ec == std::errc() && result.ptr == end;
}

bool ParseInteger(std::string_view word, int64_t* value) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  const char* end = word.data() + word.size();
  const auto result = std::from_chars(word.data(), end, *value);
  return result.ec == std::errc() && result.ptr == end;
}

void AddPolygon(std::span<const uint32_t> corners, RawMesh* mesh) {
  const auto& p = mesh->positions;
  if (corners.size() < 3) return;
  if (corners.size() == 3) {
    mesh->triangles.push_back({corners[0], corners[1], corners[2]});
    return;
  }
  std::vector<uint32_t> rest(corners.begin(), corners.end());
  // Newell's normal: right for concave polygons too.
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < rest.size(); ++i) {
    normal += (p[rest[i]] - p[rest[0]]).cross(p[rest[(i + 1) % rest.size()]] - p[rest[0]]);
  }
  const auto convex_at = [&](size_t i) {
    const size_t n = rest.size();
    return Turn(p[rest[(i + n - 1) % n]], p[rest[i]], p[rest[(i + 1) % n]], normal) >= 0;
  };
  bool convex = true;
  for (size_t i = 0; i < rest.size() && convex; ++i) convex = convex_at(i);
  while (!convex && rest.size() > 3 && rest.size() <= kMaxEarPolygon) {
    const size_t n = rest.size();
    size_t ear = n;
    for (size_t i = 0; i < n && ear == n; ++i) {
      const uint32_t a = rest[(i + n - 1) % n], b = rest[i], c = rest[(i + 1) % n];
      if (!(Turn(p[a], p[b], p[c], normal) > 0)) continue;
      const bool empty = std::none_of(rest.begin(), rest.end(), [&](uint32_t q) {
        if (q == a || q == b || q == c || p[q] == p[a] || p[q] == p[b] || p[q] == p[c])
          return false;
        return Turn(p[a], p[b], p[q], normal) >= 0 && Turn(p[b], p[c], p[q], normal) >= 0 &&
               Turn(p[c], p[a], p[q], normal) >= 0;
      });
      if (empty) ear = i;
    }
    if (ear == n) break;  // self-intersecting or degenerate: what is left is fanned
    mesh->triangles.push_back({rest[(ear + n - 1) % n], rest[ear], rest[(ear + 1) % n]});
    rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(ear));
  }
  for (size_t i = 1; i + 1 < rest.size(); ++i) {
    mesh->triangles.push_back({rest[0], rest[i], rest[i + 1]});
  }
}

}  // namespace sightline
