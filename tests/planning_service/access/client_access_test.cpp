// SPDX-License-Identifier: Apache-2.0
// Clients files: what they allow, what is wrong with them, and how they change under a running
// service.
#include "planning_service/access/client_access.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ringbuffer_sink.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <thread>

#include "absl/strings/str_cat.h"
#include "core/digest/sha256.h"
#include "core/file/atomic_write.h"
#include "proto/status/rpc_status.h"
#include "tests/limits/wait_until.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr char kTokenA[] = "token-of-line-3-that-nobody-guesses";
constexpr char kTokenB[] = "token-of-the-gateway-that-nobody-guesses";

std::string TwoClients() {
  return absl::StrCat(
      R"({"clients":[
        {"name":"mes-line-3","certificate_names":["mes.line3.plant","10.0.0.3"],"token_sha256":")",
      Sha256Hex(kTokenA),
      R"(","kinds":["plan","evaluate"],"max_priority":10,"max_queued_jobs":100,
         "max_running_jobs":2,"max_stored_bytes":5000,"max_upload_bytes":4000},
        {"name":"gateway","certificate_names":["gateway.plant"],"operator":true,"token_sha256":")",
      Sha256Hex(kTokenB), R"("},
        {"name":"certificate-only","certificate_names":["only.plant"]}]})");
}

class ClientAccessTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = "/tmp/sightline-clients-XXXXXX";
    ASSERT_NE(mkdtemp(pattern.data()), nullptr);
    folder_ = pattern;
    file_ = folder_ + "/clients.json";
    before_ = spdlog::default_logger();
    spdlog::set_default_logger(std::make_shared<spdlog::logger>("test", sink_));
    spdlog::set_level(spdlog::level::trace);
  }
  void TearDown() override {
    spdlog::set_default_logger(before_);
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }

  void Write(const std::string& text) { ASSERT_TRUE(WriteFileAtomically(file_, text).ok()); }
  std::unique_ptr<ClientAccess> Open(const std::string& text) {
    Write(text);
    auto access = ReadClientAccess(file_);
    EXPECT_TRUE(access.ok()) << access.status();
    return access.ok() ? *std::move(access) : nullptr;
  }
  std::string ErrorOf(const std::string& text) {
    Write(text);
    const absl::Status status = ReadClientAccess(file_).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr(file_));
    return std::string(status.message());
  }
  std::string Log() const {
    std::string all;
    for (const std::string& line : sink_->last_formatted()) all += line;
    return all;
  }

  std::string folder_;
  std::string file_;
  const std::shared_ptr<spdlog::sinks::ringbuffer_sink_mt> sink_ =
      std::make_shared<spdlog::sinks::ringbuffer_sink_mt>(1000);
  std::shared_ptr<spdlog::logger> before_;
};

void ExpectUnknown(const absl::StatusOr<Client>& client) {
  EXPECT_EQ(client.status().code(), absl::StatusCode::kUnauthenticated) << client.status();
  EXPECT_EQ(ErrorReason(client.status()), "CREDENTIALS_UNKNOWN");
}

TEST_F(ClientAccessTest, FindsClientsByTokenAndByCertificate) {
  const auto access = Open(TwoClients());
  ASSERT_NE(access, nullptr);
  const auto by_token = access->Identify({{}, kTokenA});
  ASSERT_TRUE(by_token.ok()) << by_token.status();
  EXPECT_EQ(by_token->name, "mes-line-3");
  EXPECT_THAT(by_token->kinds, ElementsAre("plan", "evaluate"));
  EXPECT_TRUE(by_token->MayAsk("plan"));
  EXPECT_FALSE(by_token->MayAsk("render"));
  EXPECT_FALSE(by_token->is_operator);
  EXPECT_EQ(by_token->max_priority, 10);
  EXPECT_EQ(by_token->quota.max_queued_jobs, 100);
  EXPECT_EQ(by_token->quota.max_running_jobs, 2);
  EXPECT_EQ(by_token->quota.max_stored_bytes, 5000);
  EXPECT_EQ(by_token->max_upload_bytes, 4000);

  const auto by_certificate = access->Identify({{"some other name", "gateway.plant"}, ""});
  ASSERT_TRUE(by_certificate.ok()) << by_certificate.status();
  EXPECT_EQ(by_certificate->name, "gateway");
  EXPECT_TRUE(by_certificate->is_operator);
  EXPECT_TRUE(by_certificate->MayAsk("diagnose"));
  EXPECT_EQ(by_certificate->quota.max_queued_jobs, ClientQuota{}.max_queued_jobs);
  EXPECT_EQ(by_certificate->max_priority, 0);

  EXPECT_EQ(access->QuotaOf("mes-line-3").max_running_jobs, 2);
  EXPECT_EQ(access->QuotaOf("gone").max_running_jobs, ClientQuota{}.max_running_jobs);
}

TEST_F(ClientAccessTest, CertificateAndTokenMustAgree) {
  const auto access = Open(TwoClients());
  ASSERT_NE(access, nullptr);
  const auto both = access->Identify({{"10.0.0.3"}, kTokenA});
  ASSERT_TRUE(both.ok()) << both.status();
  EXPECT_EQ(both->name, "mes-line-3");
  ExpectUnknown(access->Identify({{"10.0.0.3"}, kTokenB}));
  ExpectUnknown(access->Identify({{"10.0.0.3"}, "wrong"}));
  ExpectUnknown(access->Identify({{"stranger.plant"}, kTokenA}));
  ExpectUnknown(access->Identify({{"only.plant"}, kTokenA}));
  // Two clients' names in one certificate.
  ExpectUnknown(access->Identify({{"gateway.plant", "mes.line3.plant"}, ""}));
}

TEST_F(ClientAccessTest, NobodyElseComesIn) {
  const auto access = Open(TwoClients());
  ASSERT_NE(access, nullptr);
  ExpectUnknown(access->Identify({}));
  ExpectUnknown(access->Identify({{"stranger.plant"}, ""}));
  ExpectUnknown(access->Identify({{""}, ""}));
  // The digest is no token, nor are 32 zero bytes' preimages of a client without one.
  ExpectUnknown(access->Identify({{}, Sha256Hex(kTokenA)}));
  const std::string almost = std::string(kTokenA).substr(0, sizeof(kTokenA) - 2);
  const absl::Status near = access->Identify({{}, almost}).status();
  const absl::Status far = access->Identify({{}, "x"}).status();
  EXPECT_EQ(near.code(), absl::StatusCode::kUnauthenticated);
  EXPECT_EQ(near.message(), far.message());
  EXPECT_THAT(std::string(near.message()), Not(HasSubstr(almost)));
  const auto empty = Open("{}");
  ASSERT_NE(empty, nullptr);
  ExpectUnknown(empty->Identify({{}, kTokenA}));
}

TEST_F(ClientAccessTest, WrongFilesSayWhatIsWrong) {
  EXPECT_EQ(ReadClientAccess("/nonexistent/clients.json").status().code(),
            absl::StatusCode::kNotFound);
  EXPECT_EQ(ReadClientAccess(folder_).status().code(), absl::StatusCode::kInvalidArgument);
  const std::string pipe = folder_ + "/pipe";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_EQ(ReadClientAccess(pipe).status().code(), absl::StatusCode::kInvalidArgument);

  EXPECT_THAT(ErrorOf(R"({"clients":[{"name":"a","max_queued":3}]})"),
              HasSubstr("nearest known name is \"max_queued_jobs\""));
  EXPECT_THAT(ErrorOf(R"({"clients":[{"name":"a b","certificate_names":["a"]}]})"),
              AllOf(HasSubstr("clients[0].name"), HasSubstr("a b")));
  EXPECT_THAT(ErrorOf(R"({"clients":[{"certificate_names":["a"]}]})"), HasSubstr("[0].name"));
  EXPECT_THAT(ErrorOf(R"({"clients":[{"name":"a"}]})"),
              HasSubstr("clients[0] (a): needs certificate_names, token_sha256 or both"));
  EXPECT_THAT(ErrorOf(R"({"clients":[{"name":"a","certificate_names":[""]}]})"),
              HasSubstr("certificate_names"));
  EXPECT_THAT(ErrorOf(R"({"clients":[{"name":"a","certificate_names":["c"],"kinds":["plann"]}]})"),
              AllOf(HasSubstr("plann"), HasSubstr("evaluate")));
  EXPECT_THAT(ErrorOf(R"({"clients":[{"name":"a","certificate_names":["c"],"max_priority":101}]})"),
              HasSubstr("clients[0] (a).max_priority: is 101, must be in [-100, 100]"));
  EXPECT_THAT(
      ErrorOf(R"({"clients":[{"name":"a","certificate_names":["c"],"max_upload_bytes":0}]})"),
      HasSubstr("max_upload_bytes"));
  EXPECT_THAT(ErrorOf(std::string((4 << 20) + 100, ' ')), HasSubstr("larger than"));
}

TEST_F(ClientAccessTest, DuplicatesNameTheirEntries) {
  const std::string digest = Sha256Hex(kTokenA);
  EXPECT_THAT(ErrorOf(R"({"clients":[{"name":"a","certificate_names":["x"]},
                                     {"name":"a","certificate_names":["y"]}]})"),
              HasSubstr("clients[1] (a): another client has this name"));
  EXPECT_THAT(ErrorOf(R"({"clients":[{"name":"a","certificate_names":["x"]},
                                     {"name":"b","certificate_names":["y","x"]}]})"),
              AllOf(HasSubstr("clients[1] (b).certificate_names"), HasSubstr("client a has too")));
  EXPECT_THAT(ErrorOf(R"({"clients":[{"name":"a","certificate_names":["x","x"]}]})"),
              HasSubstr("twice"));
  std::string upper = digest;
  for (char& c : upper) c = static_cast<char>(toupper(c));
  const std::string same =
      ErrorOf(absl::StrCat(R"({"clients":[{"name":"a","token_sha256":")", digest,
                           R"("},{"name":"b","token_sha256":")", upper, R"("}]})"));
  EXPECT_THAT(same, HasSubstr("clients[1] (b).token_sha256: client a has the same token"));
}

TEST_F(ClientAccessTest, ErrorsNeverShowTokens) {
  // The token itself where its digest belongs, in every way that a parser may stumble over.
  for (const std::string& text :
       {absl::StrCat(R"({"clients":[{"name":"a","token_sha256":")", kTokenA, R"("}]})"),
        absl::StrCat(R"({"clients":[{"name":"a","token_sha256":["token_sha256", ")", kTokenA,
                     R"("]}]})"),
        absl::StrCat(R"({"clients":[{"name":"a","token_sha256":")", kTokenA),
        absl::StrCat(R"({"clients":[{"name":"a","token_sha256":)", kTokenA, "}]}")}) {
    EXPECT_THAT(ErrorOf(text), Not(HasSubstr("nobody-guesses")));
  }
  EXPECT_THAT(ErrorOf(R"({"clients":[{"name":"a","token_sha256":4711081542}]})"),
              AllOf(HasSubstr("token_sha256"), Not(HasSubstr("4711081542"))));
  EXPECT_THAT(ErrorOf(absl::StrCat(R"({"clients":[{"name":"a","token_sha256":")", Sha256Hex(""),
                                   R"("}]})")),
              HasSubstr("empty token"));
}

TEST_F(ClientAccessTest, ReadsTheFileAnewWhenItChanges) {
  const auto access = Open(TwoClients());
  ASSERT_NE(access, nullptr);
  ASSERT_TRUE(access->Identify({{}, kTokenA}).ok());

  // A wrong file: what was known stays, and the log says why, once and without secrets.
  Write(absl::StrCat(R"({"clients":[{"name":"a","token_sha256":")", kTokenB, R"("}]})"));
  WaitUntil([&] {
    EXPECT_TRUE(access->Identify({{}, kTokenA}).ok());
    return Log().find("clients_kept") != std::string::npos;
  });
  EXPECT_THAT(Log(), AllOf(HasSubstr("clients[0] (a).token_sha256"), HasSubstr(file_)));
  std::this_thread::sleep_for(std::chrono::milliseconds(1100));
  EXPECT_TRUE(access->Identify({{}, kTokenA}).ok());
  EXPECT_EQ(Log().find("clients_kept"), Log().rfind("clients_kept"));

  // A file that is gone.
  std::filesystem::remove(file_);
  WaitUntil([&] {
    EXPECT_TRUE(access->Identify({{}, kTokenA}).ok());
    return Log().find("clients_kept") != Log().rfind("clients_kept");
  });

  // A right one: the old token does not count any more.
  Write(absl::StrCat(R"({"clients":[{"name":"new","max_running_jobs":7,"token_sha256":")",
                     Sha256Hex("fresh"), R"("}]})"));
  WaitUntil([&] { return access->Identify({{}, "fresh"}).ok(); });
  ExpectUnknown(access->Identify({{}, kTokenA}));
  EXPECT_EQ(access->QuotaOf("new").max_running_jobs, 7);
  EXPECT_THAT(Log(),
              AllOf(Not(HasSubstr(kTokenA)), Not(HasSubstr(kTokenB)), Not(HasSubstr("fresh"))));
}

TEST_F(ClientAccessTest, ManyThreadsAskWhileTheFileChanges) {
  const auto access = Open(TwoClients());
  ASSERT_NE(access, nullptr);
  std::atomic<bool> stop = false;
  std::atomic<int> strangers = 0;
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&] {
      while (!stop) {
        if (!access->Identify({{}, kTokenA}).ok()) ++strangers;
        access->QuotaOf("gateway");
      }
    });
  }
  const std::string padded = TwoClients() + "\n";
  Write(padded);
  WaitUntil([&] { return Log().find("clients_read") != std::string::npos; });
  stop = true;
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(strangers, 0);
}

TEST_F(ClientAccessTest, EverybodyIsTheLocalOperator) {
  const auto access = AllowEverybody();
  const auto client = access->Identify({});
  ASSERT_TRUE(client.ok());
  EXPECT_EQ(client->name, "local");
  EXPECT_TRUE(client->is_operator);
  EXPECT_EQ(client->max_priority, 100);
  EXPECT_TRUE(client->MayAsk("plan"));
}

}  // namespace
}  // namespace sightline
