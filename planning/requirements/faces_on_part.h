// SPDX-License-Identifier: Apache-2.0
// Check that the faces of a tolerance file lie on the part's mesh. A file of another revision of
// the part, in another unit or in other coordinates has the same names and numbers; only its
// positions differ.
//
//   FacesOnPart check(part);
//   absl::Status status = check.Check(face, "tolerance flatness #57");
#pragma once

#include <map>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "core/part/mesh.h"
#include "core/registration/surface_index.h"
#include "core/tolerance/face_surface.h"

namespace sightline {

class FacesOnPart {
 public:
  // `part` must outlive the check. A point of a face may be `most_distance_m` off the mesh: two
  // triangulations of one surface differ by the sum of their chord tolerances.
  explicit FacesOnPart(const TriangleMesh& part,
                       double most_distance_m = FaceMatch{}.max_distance_m);

  // `face` must pass FaceSurface::Make. Compares some 2000 regularly spaced points of the face with
  // the nearest surface of the mesh that faces the same way. INVALID_ARGUMENT names the face, its
  // point farthest from the mesh and the distance; `binds` names the tolerance that binds the face.
  // A face of several tolerances is compared only once.
  absl::Status Check(const FaceTriangles& face, const std::string& binds);

 private:
  struct Farthest {
    double distance_m = 0;
    Eigen::Vector3d place_m = Eigen::Vector3d::Zero();
    bool inside_out = false;  // the mesh is there, but faces the other way
  };
  Farthest FarthestPoint(const FaceTriangles& face);

  const TriangleMesh& part_;
  std::optional<SurfaceIndex> surface_;  // made with the first face, since few parts have any
  const double part_size_m_;
  const double most_distance_m_;
  std::map<int, Farthest> known_;  // by the number of the face
};

}  // namespace sightline
