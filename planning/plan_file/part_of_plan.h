// SPDX-License-Identifier: Apache-2.0
// Check that a plan belongs to the part of an inspection. Files of scans state the digest of the
// part that they were made for (core/part/part_digest.h); every command that reads such a file
// compares it here with the part of its inspection.
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

// Compares the digest that `file` states with that of the part. Returns a remark for people, empty
// if the digests agree or the file states none (as files written by hand). The remark names files
// without folders, since plans keep it. A digest by an older rule cannot be compared: the file is
// accepted with a remark. INVALID_ARGUMENT if the digests differ (names both files and digests), if
// the rule is of a later version, or if the text is no digest.
absl::StatusOr<std::string> CheckPlanBelongsToPart(const std::string& file,
                                                   const std::string& stated_digest,
                                                   const PartDigest& part,
                                                   const std::string& part_file,
                                                   OtherPart other_part);

// Plans given to one command.
struct GivenPlans {
  struct Plan {
    std::string file;
    std::string part_digest;
  };
  std::vector<Plan> plans;
  bool other_part = false;  // --other-part

  // True if any plan states a digest, so that the digest of the part is needed.
  bool StateAPart() const;
  // CheckPlanBelongsToPart of every plan; the remarks in the order of the plans, each once.
  absl::StatusOr<std::vector<std::string>> CheckBelongTo(const PartDigest& part,
                                                         const std::string& part_file) const;
};

}  // namespace sightline
