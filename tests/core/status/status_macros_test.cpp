// SPDX-License-Identifier: Apache-2.0
// Errors leave the function at once; values go where they are wanted, without copies.
#include "core/status/status_macros.h"

#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace sightline {
namespace {

absl::StatusOr<int> Positive(int number) {
  if (number <= 0) return absl::OutOfRangeError("not positive");
  return number;
}

template <int kFirst, int kSecond>
absl::Status CheckSum(int sum) {
  return kFirst + kSecond == sum ? absl::OkStatus() : absl::InvalidArgumentError("another sum");
}

TEST(StatusMacros, ReturnIfErrorReturnsErrorsOnly) {
  int checks = 0;
  const auto check = [&](const absl::Status& given) -> absl::Status {
    // The expression may be a variable of any name.
    const absl::Status& status = given;
    SIGHTLINE_RETURN_IF_ERROR(status);
    ++checks;
    return absl::OkStatus();
  };
  EXPECT_TRUE(check(absl::OkStatus()).ok());
  EXPECT_EQ(checks, 1);
  EXPECT_EQ(check(absl::NotFoundError("no such part")), absl::NotFoundError("no such part"));
  EXPECT_EQ(checks, 1);
}

TEST(StatusMacros, ReturnIfErrorIsOneStatementAndTakesCommas) {
  const auto check = [](bool is_checked, int sum) -> absl::Status {
    if (is_checked)
      SIGHTLINE_RETURN_IF_ERROR(CheckSum<1, 2>(sum));
    else
      return absl::CancelledError("not checked");
    return absl::OkStatus();
  };
  EXPECT_TRUE(check(true, 3).ok());
  EXPECT_EQ(check(true, 4).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(check(false, 3).code(), absl::StatusCode::kCancelled);
}

TEST(StatusMacros, AssignOrReturnDeclaresVariables) {
  const auto sum = [](int one, int other) -> absl::StatusOr<std::string> {
    SIGHTLINE_ASSIGN_OR_RETURN(const int first, Positive(one));
    SIGHTLINE_ASSIGN_OR_RETURN(auto second, Positive(other));
    second += first;
    return std::to_string(second);
  };
  EXPECT_EQ(sum(2, 3).value(), "5");
  EXPECT_EQ(sum(0, 3).status(), absl::OutOfRangeError("not positive"));
  EXPECT_EQ(sum(2, 0).status(), absl::OutOfRangeError("not positive"));
}

TEST(StatusMacros, AssignOrReturnAssignsVariables) {
  std::vector<int> numbers = {7, 7};
  const auto set = [&](size_t index, int number) -> absl::Status {
    SIGHTLINE_ASSIGN_OR_RETURN(numbers[index], Positive(number));
    return absl::OkStatus();
  };
  EXPECT_TRUE(set(1, 4).ok());
  EXPECT_EQ(set(0, -4).code(), absl::StatusCode::kOutOfRange);
  EXPECT_EQ(numbers, (std::vector<int>{7, 4}));
}

TEST(StatusMacros, AssignOrReturnMovesValues) {
  const auto make = [](bool works) -> absl::StatusOr<std::unique_ptr<int>> {
    if (!works) return absl::UnavailableError("not now");
    return std::make_unique<int>(8);
  };
  const auto take = [&](bool works) -> absl::StatusOr<std::unique_ptr<int>> {
    SIGHTLINE_ASSIGN_OR_RETURN(std::unique_ptr<int> made, make(works));
    *made += 1;
    return made;
  };
  EXPECT_EQ(**take(true), 9);
  EXPECT_EQ(take(false).status(), absl::UnavailableError("not now"));
}

TEST(StatusMacros, AssignOrReturnTakesCommasInTheExpression) {
  const auto size = []() -> absl::StatusOr<size_t> {
    SIGHTLINE_ASSIGN_OR_RETURN(
        const auto map, absl::StatusOr<std::map<int, int>>(std::map<int, int>{{1, 2}, {3, 4}}));
    return map.size();
  };
  EXPECT_EQ(size().value(), 2);
}

}  // namespace
}  // namespace sightline
