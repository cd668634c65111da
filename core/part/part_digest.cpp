// SPDX-License-Identifier: Apache-2.0
#include "core/part/part_digest.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "core/digest/sha256.h"
#include "core/status/status_macros.h"
#include "core/text/number.h"

namespace sightline {
namespace {

constexpr size_t kHexDigits = 64;
constexpr int64_t kLargestRule = 999;
constexpr size_t kBufferedBytes = 1 << 14;

bool IsHexDigit(char c) { return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f'); }

void AppendLittleEndian(uint32_t word, std::string* bytes) {
  for (int shift = 0; shift < 32; shift += 8) *bytes += static_cast<char>(word >> shift);
}

bool IsHex64(std::string_view text) {
  return text.size() == kHexDigits && std::all_of(text.begin(), text.end(), IsHexDigit);
}

// The order of the names in the file does not count: materials are numbered as triangles name them.
std::string MaterialsDigest(const TriangleMesh& mesh) {
  Sha256 hash;
  std::string bytes;
  std::vector<int64_t> number_of(mesh.material_names.size(), -1);
  uint32_t next = 0;
  for (const uint16_t material : mesh.triangle_material) {
    if (number_of[material] < 0) {
      const std::string& name = mesh.material_names[material];
      number_of[material] = next++;
      AppendLittleEndian(static_cast<uint32_t>(name.size()), &bytes);
      bytes += name;
    }
    AppendLittleEndian(static_cast<uint32_t>(number_of[material]), &bytes);
    if (bytes.size() < kBufferedBytes) continue;
    hash.Update(bytes);
    bytes.clear();
  }
  hash.Update(bytes);
  return hash.Hex();
}

}  // namespace

std::string PartDigest::Text() const { return absl::StrCat(rule, ":", hex); }

PartDigest PartDigestOf(const TriangleMesh& mesh) {
  Sha256 hash;
  std::string bytes;
  bytes.reserve(kBufferedBytes + 16);
  const auto add = [&](uint32_t word) {
    AppendLittleEndian(word, &bytes);
    if (bytes.size() < kBufferedBytes) return;
    hash.Update(bytes);
    bytes.clear();
  };
  const uint64_t count = mesh.positions_m.size();
  add(static_cast<uint32_t>(count));
  add(static_cast<uint32_t>(count >> 32));
  for (const Eigen::Vector3f& position : mesh.positions_m) {
    for (int axis = 0; axis < 3; ++axis) add(std::bit_cast<uint32_t>(position[axis]));
  }
  for (const auto& triangle : mesh.triangles) {
    for (const uint32_t index : triangle) add(index);
  }
  hash.Update(bytes);
  return {kPartDigestRule, hash.Hex()};
}

absl::StatusOr<PartDigest> ParsePartDigest(std::string_view text) {
  PartDigest digest;
  digest.rule = 1;
  digest.hex = text;
  bool good_rule = true;
  if (const size_t colon = text.find(':'); colon != std::string_view::npos) {
    const absl::StatusOr<int64_t> rule = ParseWhole(text.substr(0, colon));
    good_rule = rule.ok() && *rule >= 1 && *rule <= kLargestRule && text[0] != '0';
    digest.rule = good_rule ? static_cast<int>(*rule) : 0;
    digest.hex = text.substr(colon + 1);
  }
  if (!good_rule || !IsHex64(digest.hex)) {
    return absl::InvalidArgumentError(
        "is no digest of a part, must be the number of its rule, a colon and 64 lower-case "
        "hexadecimal digits");
  }
  return digest;
}

std::string PartNameWithMaterials(const TriangleMesh& mesh) {
  const std::string digest = PartDigestOf(mesh).Text();
  if (mesh.triangle_material.empty()) return digest;
  return absl::StrCat(digest, "+", MaterialsDigest(mesh));
}

absl::StatusOr<PartName> ParsePartName(std::string_view text) {
  PartName name;
  if (const size_t plus = text.find('+'); plus != std::string_view::npos) {
    name.materials = text.substr(plus + 1);
    if (!IsHex64(name.materials)) {
      return absl::InvalidArgumentError(
          "is no name of a part with materials, must end with \"+\" and 64 lower-case hexadecimal "
          "digits");
    }
    text = text.substr(0, plus);
  }
  SIGHTLINE_ASSIGN_OR_RETURN(name.digest, ParsePartDigest(text));
  return name;
}

DigestComparison Compare(const PartDigest& a, const PartDigest& b) {
  if (a.rule != b.rule) return DigestComparison::kOtherRule;
  return a.hex == b.hex ? DigestComparison::kSame : DigestComparison::kOtherPart;
}

}  // namespace sightline
