// SPDX-License-Identifier: Apache-2.0
// Whether a plan belongs to the part of an inspection. Files of scans state the digest of the part
// that they were made for (core/part/part_digest.h); every command that takes such a file compares
// it here with the part of its inspection.
//
//   GivenPlans plans;                        // --other-part sets plans.other_part
//   auto scans = ReadPlanScans(path, &plans);
//   auto remarks = plans.CheckBelongTo(PartDigestOf(mesh), inspection.part_file);
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/part/part_digest.h"

namespace sightline {

// Treatment of a file of another part.
enum class OtherPart {
  kRefused,
  kRefusedWithoutOption,  // refused; the message names --other-part
  kTaken,                 // taken, with a remark
};

// Compares the digest that `file` states with that of the part. The answer is a remark for people,
// empty if the file is of this part or states no digest, as those that are written by hand. It
// names files without their folders, since plans keep it. A digest by an older rule cannot be
// compared: the file is taken, and the remark says so. INVALID_ARGUMENT names both files and both
// digests of two parts, a rule of a later version, or a text that is no digest.
absl::StatusOr<std::string> CheckPlanBelongsToPart(const std::string& file,
                                                   const std::string& stated_digest,
                                                   const PartDigest& part,
                                                   const std::string& part_file,
                                                   OtherPart other_part);

// The plans that a command was given.
struct GivenPlans {
  struct Plan {
    std::string file;
    std::string part_digest;
  };
  std::vector<Plan> plans;
  bool other_part = false;  // --other-part

  // Whether any of them states a digest, so that the part's is needed.
  bool StateAPart() const;
  // CheckPlanBelongsToPart of every plan; the remarks in the order of the plans, each once.
  absl::StatusOr<std::vector<std::string>> CheckBelongTo(const PartDigest& part,
                                                         const std::string& part_file) const;
};

}  // namespace sightline
