// SPDX-License-Identifier: Apache-2.0
#include "planning/plan_file/part_of_plan.h"

#include <algorithm>
#include <filesystem>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

// Remarks go into plans, whose content must not depend on the folder of a file.
std::string NameOf(const std::string& file) {
  return std::filesystem::path(file).filename().string();
}

}  // namespace

absl::StatusOr<std::string> CheckPlanBelongsToPart(const std::string& file,
                                                   const std::string& stated_digest,
                                                   const PartDigest& part,
                                                   const std::string& part_file,
                                                   OtherPart other_part) {
  if (stated_digest.empty()) return std::string();
  const auto stated = ParsePartDigest(stated_digest);
  if (!stated.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat(file, ": part_digest ", stated.status().message()));
  }
  const auto both = [&](const std::string& name) {
    return absl::StrCat("part_digest is ", stated->Text(), ", that of ", name, " is ", part.Text());
  };
  switch (Compare(*stated, part)) {
    case DigestComparison::kSame:
      return std::string();
    case DigestComparison::kOtherRule:
      // The file comes from a later version: only its user can know that the part is the same.
      if (stated->rule > part.rule && other_part != OtherPart::kTaken) {
        return absl::InvalidArgumentError(absl::StrCat(
            file, ": ", both(part_file), ": rule ", stated->rule,
            " is of a later version and cannot be compared",
            other_part == OtherPart::kRefusedWithoutOption ? "; --other-part takes it all the same"
                                                           : ""));
      }
      return absl::StrCat(NameOf(file), ": the digest of its part is by rule ", stated->rule,
                          ", which this version cannot compare with rule ", part.rule,
                          ": make sure that it is of ", NameOf(part_file));
    case DigestComparison::kOtherPart:
      break;
  }
  if (other_part == OtherPart::kTaken) {
    return absl::StrCat(NameOf(file), ": was made for another part (", both(NameOf(part_file)),
                        ")");
  }
  return absl::InvalidArgumentError(absl::StrCat(
      file, ": ", both(part_file), ": it was made for another part, revision or unit",
      other_part == OtherPart::kRefusedWithoutOption ? "; --other-part takes it all the same"
                                                     : ""));
}

bool GivenPlans::StateAPart() const {
  return std::any_of(plans.begin(), plans.end(),
                     [](const Plan& plan) { return !plan.part_digest.empty(); });
}

absl::StatusOr<std::vector<std::string>> GivenPlans::CheckBelongTo(
    const PartDigest& part, const std::string& part_file) const {
  std::vector<std::string> remarks;
  for (const Plan& plan : plans) {
    SIGHTLINE_ASSIGN_OR_RETURN(
        auto remark,
        CheckPlanBelongsToPart(plan.file, plan.part_digest, part, part_file,
                               other_part ? OtherPart::kTaken : OtherPart::kRefusedWithoutOption));
    if (remark.empty() || std::find(remarks.begin(), remarks.end(), remark) != remarks.end()) {
      continue;
    }
    remarks.push_back(std::move(remark));
  }
  return remarks;
}

}  // namespace sightline
