// SPDX-License-Identifier: Apache-2.0
// TLS: who a client is by its certificate, and certificates that change while the server runs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openssl/x509.h>

#include "tests/integration/test_certificates.h"
#include "tests/planning_service/http_api/http_api_fixture.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;

class HttpApiTls : public HttpApiTest {
 protected:
  void SetUp() override {
    HttpApiTest::SetUp();
    UsePair(authority_.Issue("first"));
    options_.tls_certificate_file = (folder_ / "server.pem").string();
    options_.tls_key_file = (folder_ / "server.key").string();
    options_.tls_check_interval = absl::ZeroDuration();
  }
  void UsePair(const PemPair& pair) {
    Write("server.pem", pair.certificate);
    Write("server.key", pair.key);
  }
  // A client that trusts the authority; with a certificate if a pair is given.
  std::unique_ptr<httplib::SSLClient> NewTlsClient(const PemPair& pair = {}) {
    std::string certificate;
    std::string key;
    if (!pair.key.empty()) {
      certificate = Write("client.pem", pair.certificate);
      key = Write("client.key", pair.key);
    }
    auto client = std::make_unique<httplib::SSLClient>("localhost", port(), certificate, key);
    client->set_address_family(AF_INET);
    client->set_ca_cert_path(Write("ca.pem", authority_.certificate()));
    client->enable_server_certificate_verification(true);
    return client;
  }
  // Common name of the certificate that a new connection shows; empty if there is none.
  std::string ServerName() {
    std::string name;
    const std::unique_ptr<SSL_CTX, void (*)(SSL_CTX*)> context(SSL_CTX_new(TLS_client_method()),
                                                               SSL_CTX_free);
    const std::unique_ptr<BIO, void (*)(BIO*)> connection(BIO_new_ssl_connect(context.get()),
                                                          BIO_free_all);
    BIO_set_conn_hostname(connection.get(), server_->address().c_str());
    if (BIO_do_handshake(connection.get()) != 1) return name;
    SSL* ssl = nullptr;
    BIO_get_ssl(connection.get(), &ssl);
    X509* certificate = SSL_get1_peer_certificate(ssl);
    char text[100] = "";
    X509_NAME_get_text_by_NID(X509_get_subject_name(certificate), NID_commonName, text,
                              sizeof(text));
    X509_free(certificate);
    return text;
  }

  const TestAuthority authority_{"plant"};
};

TEST_F(HttpApiTls, ServesAndTakesFiles) {
  StartServer();
  const auto client = NewTlsClient();
  const auto answer = client->Put("/v1/files", std::string(5 << 20, 'x'), "text/plain");
  ASSERT_TRUE(answer) << httplib::to_string(answer.error());
  EXPECT_EQ(Json(answer)["digest"], Sha256Hex(std::string(5 << 20, 'x')));
  const auto job = client->Post("/v1/jobs", PlanForm());
  ASSERT_TRUE(job) << httplib::to_string(job.error());
  EXPECT_EQ(job->status, 201) << job->body;
  // An early answer reaches a client that is still sending.
  auto form = PlanForm("not JSON");
  form[1].content = std::string(4 << 20, 'x');
  Error(NewTlsClient()->Post("/v1/jobs", form), 400, "INVALID_FIELD");
  // A plain client gets nothing.
  EXPECT_FALSE(NewClient()->Get("/healthz"));
}

TEST_F(HttpApiTls, KnowsClientsByTheirCertificates) {
  const std::string clients = Write("clients.json", R"({"clients":[
      {"name":"line","certificate_names":["mes.line3.plant"]},
      {"name":"gateway","certificate_names":["gateway"],"operator":true},
      {"name":"cell","certificate_names":["10.0.0.3"]}]})");
  auto access = ReadClientAccess(clients);
  ASSERT_TRUE(access.ok()) << access.status();
  access_ = *std::move(access);
  options_.tls_client_ca_file = Write("client_ca.pem", authority_.certificate());
  StartServer();
  const auto name_of = [this](const PemPair& pair) {
    const auto answer = NewTlsClient(pair)->Post("/v1/jobs", PlanForm());
    return answer && answer->status == 201 ? Json(answer).value("client", "") : "";
  };
  EXPECT_EQ(name_of(authority_.Issue("gateway", "")), "gateway");
  // RFC 6125 6.4.4: beside an alternative name the common name does not count.
  EXPECT_EQ(name_of(authority_.Issue("gateway", "DNS:localhost")), "");
  EXPECT_EQ(name_of(authority_.Issue("x", "DNS:mes.line3.plant,DNS:other")), "line");
  EXPECT_EQ(name_of(authority_.Issue("x", "IP:10.0.0.3")), "cell");
  Error(NewTlsClient(authority_.Issue("stranger"))->Get("/v1/jobs"), 401, "CREDENTIALS_UNKNOWN");
  // Without a certificate, or with one of another authority, there is no connection.
  EXPECT_FALSE(NewTlsClient()->Get("/healthz"));
  EXPECT_FALSE(NewTlsClient(TestAuthority("elsewhere").Issue("gateway"))->Get("/v1/jobs"));
}

TEST_F(HttpApiTls, UsesNewCertificates) {
  StartServer();
  const auto open = NewTlsClient();
  open->set_keep_alive(true);
  ASSERT_TRUE(open->Get("/healthz"));
  EXPECT_EQ(ServerName(), "first");
  UsePair(authority_.Issue("second"));
  EXPECT_EQ(ServerName(), "second");
  // A connection that is open goes on.
  EXPECT_TRUE(open->Get("/healthz"));
  Write("server.pem", authority_.Issue("third").certificate);  // not the key's
  EXPECT_EQ(ServerName(), "second");
  Write("server.key", "nonsense");
  EXPECT_EQ(ServerName(), "second");
  std::filesystem::remove(options_.tls_certificate_file);
  EXPECT_EQ(ServerName(), "second");
  UsePair(authority_.Issue("fourth"));
  EXPECT_EQ(ServerName(), "fourth");
}

TEST_F(HttpApiTls, NamesFilesThatCannotBeUsed) {
  const auto message = [this] {
    const auto server = HttpApi::Start(options_, jobs_.get(), access_.get());
    EXPECT_TRUE(absl::IsInvalidArgument(server.status())) << server.status();
    return std::string(server.status().message());
  };
  Write("server.key", authority_.Issue("other").key);
  EXPECT_THAT(message(), HasSubstr("--tls-key: " + options_.tls_key_file));
  Write("server.pem", "nonsense");
  EXPECT_THAT(message(), HasSubstr("--tls-cert: " + options_.tls_certificate_file));
  UsePair(authority_.Issue("first"));
  options_.tls_client_ca_file = "/no/such/file";
  EXPECT_THAT(message(), HasSubstr("--tls-client-ca: /no/such/file"));
  options_.tls_key_file.clear();
  EXPECT_THAT(message(), HasSubstr("belong together"));
  options_.tls_certificate_file.clear();
  EXPECT_THAT(message(), HasSubstr("--tls-client-ca needs"));
}

}  // namespace
}  // namespace sightline
