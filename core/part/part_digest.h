// SPDX-License-Identifier: Apache-2.0
// The digest of a part decides if two files describe the same part. It includes the number of the
// rule by which the mesh was made from the part's file: another rule gives another mesh of the same
// file, so digests of different rules cannot be compared. In files and calls it is the text
// "RULE:HEX", "2:03eb40a7...". Older digests without a rule number belong to
// rule 1.
//
//   absl::StatusOr<PartDigest> stated = ParsePartDigest(plan.part_digest());
//   switch (Compare(*stated, PartDigestOf(mesh))) {
//     case DigestComparison::kSame: ...       // the same part
//     case DigestComparison::kOtherPart: ...  // refuse, name both
//     case DigestComparison::kOtherRule: ...  // not known: take the file, with a remark
//   }
#pragma once

#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "core/part/mesh.h"

namespace sightline {

// Rule 1: all vertices that a triangle names, triangles without area among them, welded within
//         2^-22 of the largest coordinate of all.
// Rule 2: faces with area alone (core/part/surface/normalise.h).
inline constexpr int kPartDigestRule = 2;

struct PartDigest {
  int rule = kPartDigestRule;
  std::string hex;  // SHA-256, 64 lower-case hexadecimal digits

  // "2:03eb40a7..."
  std::string Text() const;
  bool operator==(const PartDigest&) const = default;
};

// SHA-256 of the mesh's canonical bytes: vertex count, positions, triangles. It does not include
// materials, which change images but not coverage.
PartDigest PartDigestOf(const TriangleMesh& mesh);

// Reads what Text() wrote, and bare hexadecimal digits as rule 1. The message of INVALID_ARGUMENT
// starts with "is ...".
absl::StatusOr<PartDigest> ParsePartDigest(std::string_view text);

// Name of a part including its materials: the digest's text, "+" and the SHA-256 of the materials
// of its triangles; only the digest's text for a mesh without materials. Scenes with limits by
// light use this name (v1::SceneSpec.part_digest).
std::string PartNameWithMaterials(const TriangleMesh& mesh);

// The two parts of such a name; `materials` is empty for a digest's text alone.
struct PartName {
  PartDigest digest;
  std::string materials;  // SHA-256, 64 lower-case hexadecimal digits
};
// The message of INVALID_ARGUMENT starts with "is ...".
absl::StatusOr<PartName> ParsePartName(std::string_view text);

enum class DigestComparison { kSame, kOtherPart, kOtherRule };
DigestComparison Compare(const PartDigest& a, const PartDigest& b);

}  // namespace sightline
