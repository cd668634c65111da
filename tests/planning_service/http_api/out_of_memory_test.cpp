// SPDX-License-Identifier: Apache-2.0
// A request for which the memory does not suffice is refused alone, and may be sent again.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <new>

#include "tests/planning_service/http_api/http_api_fixture.h"

namespace sightline {
namespace {

using ::testing::_;
using ::testing::HasSubstr;
using ::testing::NiceMock;
using ::testing::Return;
using ::testing::Throw;

class MockStore : public PlanningJobStore {
 public:
  MOCK_METHOD(absl::StatusOr<bool>, BeginService, (), (override));
  MOCK_METHOD(absl::StatusOr<PlanningJob>, Create, (const NewPlanningJob&, const ClientQuota&),
              (override));
  MOCK_METHOD(absl::StatusOr<PlanningJob>, Get, (const std::string&), (override));
  MOCK_METHOD(absl::StatusOr<std::vector<PlanningJob>>, List, (const PlanningJobFilter&),
              (override));
  MOCK_METHOD(absl::StatusOr<PlanningJob>, RequestCancel, (const std::string&), (override));
  MOCK_METHOD(absl::StatusOr<PlanningJob>, WaitForChange,
              (const std::string&, int64_t, absl::Duration), (override));
  MOCK_METHOD(absl::StatusOr<Counts>, Count, (const std::optional<std::string>&), (override));
  MOCK_METHOD(absl::StatusOr<std::optional<PlanningJob>>, Claim,
              (const std::function<ClientQuota(const std::string&)>&), (override));
  MOCK_METHOD(absl::StatusOr<bool>, ReportProgress, (const Attempt&, double, const std::string&),
              (override));
  MOCK_METHOD(absl::Status, Succeed, (const Attempt&, const std::vector<JobFile>&), (override));
  MOCK_METHOD(absl::Status, Fail, (const Attempt&, const JobFailure&), (override));
  MOCK_METHOD(absl::Status, MarkCancelled, (const Attempt&), (override));
  MOCK_METHOD(absl::Status, Requeue, (const Attempt&, bool, bool), (override));
  MOCK_METHOD(absl::StatusOr<int>, RequeueOrphans, (), (override));
  MOCK_METHOD(absl::StatusOr<Recipe>, GetRecipe, (const std::string&, const std::string&),
              (override));
  MOCK_METHOD(absl::Status, PutRecipe, (const Recipe&, const ClientQuota&), (override));
  MOCK_METHOD(absl::Status, DeleteRecipe, (const std::string&, const std::string&), (override));
  MOCK_METHOD(absl::StatusOr<int>, CountRecipes, (const std::string&), (override));
  MOCK_METHOD(absl::Status, AddUpload, (const std::string&, const JobFile&, const ClientQuota&),
              (override));
  MOCK_METHOD(absl::StatusOr<std::optional<int64_t>>, FindFile,
              (const std::string&, const std::string&), (override));
  MOCK_METHOD(absl::StatusOr<std::vector<JobEvent>>, Events,
              (int64_t, const std::optional<std::string>&, int), (override));
  MOCK_METHOD(void, WaitForEvent, (int64_t, absl::Duration), (override));
  MOCK_METHOD(absl::StatusOr<int64_t>, NewestEvent, (), (override));
  MOCK_METHOD(absl::StatusOr<bool>, HasEvent, (int64_t), (override));
  MOCK_METHOD(absl::StatusOr<int64_t>, EventCursor, (const std::string&), (override));
  MOCK_METHOD(absl::Status, SetEventCursor, (const std::string&, int64_t), (override));
  MOCK_METHOD(bool, HoldsReceiver, (const std::string&), (override));
  MOCK_METHOD(absl::Status, AdvanceServiceTime, (absl::Duration), (override));
  MOCK_METHOD(absl::StatusOr<int>, RemoveOlderThan, (absl::Duration), (override));
  MOCK_METHOD(absl::StatusOr<std::set<std::string>>, NamedDigests, (), (override));
};

using HttpApiMemory = HttpApiTest;

TEST_F(HttpApiMemory, ARequestWithoutMemoryIsRefusedAlone) {
  NiceMock<MockStore> store;
  jobs_ = std::make_unique<PlanningJobs>(&store, artefacts_.get());
  StartServer();
  EXPECT_CALL(store, List(_))
      .WillOnce(Throw(std::bad_alloc()))
      .WillOnce(Return(std::vector<PlanningJob>()));
  const auto client = NewClient();
  const auto refused = client->Get("/v1/jobs");
  EXPECT_THAT(Error(refused, 503, "OVERLOADED"), HasSubstr("out of memory"));
  EXPECT_EQ(refused->get_header_value("Retry-After"), "5");
  // The same connection goes on.
  const auto again = client->Get("/v1/jobs");
  ASSERT_TRUE(again) << httplib::to_string(again.error());
  EXPECT_EQ(again->status, 200);
  server_.reset();
}

}  // namespace
}  // namespace sightline
