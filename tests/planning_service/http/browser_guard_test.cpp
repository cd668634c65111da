// SPDX-License-Identifier: Apache-2.0
#include "planning_service/http/browser_guard.h"

#include <gtest/gtest.h>

#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

HttpRequest Request(const std::string& method, const std::string& host,
                    const std::string& origin = "", const std::string& site = "") {
  HttpRequest request;
  request.method = method;
  request.headers = {{"host", host}};
  if (!origin.empty()) request.headers["origin"] = origin;
  if (!site.empty()) request.headers["sec-fetch-site"] = site;
  return request;
}

TEST(BrowserGuard, ChecksTheHost) {
  const BrowserGuard guard({"localhost", "127.0.0.1", "[::1]", "Planner.Plant", "fe80::1"});
  for (const char* host : {"localhost", "LOCALHOST:8080", "127.0.0.1:1", "[::1]:8080", "[::1]",
                           "planner.plant", "planner.plant.:80", "[fe80::1]:1"}) {
    EXPECT_TRUE(guard.Check(Request("GET", host)).ok()) << host;
  }
  for (const char* host :
       {"", "evil.example", "evil.example:8080", "localhost.evil.example", "127.0.0.1.evil.example",
        "[::2]", "[", "localhost:80@evil.example", "[::1]evil.example", "[::1]:80@evil.example",
        "localhost:80:80", "localhost:x", "localhost/", "localhost evil", "user@localhost",
        "localhost:123456", "[::1", "::1"}) {
    EXPECT_EQ(ErrorReason(guard.Check(Request("GET", host))), "HOST_NOT_ALLOWED") << host;
  }
}

TEST(BrowserGuard, LetsEveryHostPassWithoutNames) {
  EXPECT_TRUE(BrowserGuard({}).Check(Request("GET", "anything.example")).ok());
}

TEST(BrowserGuard, RefusesChangesFromOtherOrigins) {
  const BrowserGuard guard({});
  const std::string host = "planner:8080";
  for (const char* method : {"POST", "PUT", "DELETE", "PATCH"}) {
    EXPECT_TRUE(guard.Check(Request(method, host)).ok());
    EXPECT_TRUE(guard.Check(Request(method, host, "http://planner:8080", "same-origin")).ok());
    for (const char* origin : {"http://evil.example", "null", "http://planner",
                               "http://planner:8081", "planner:80800"}) {
      EXPECT_EQ(ErrorReason(guard.Check(Request(method, host, origin))), "ORIGIN_NOT_ALLOWED")
          << method << origin;
    }
    EXPECT_EQ(ErrorReason(guard.Check(Request(method, host, "", "cross-site"))),
              "ORIGIN_NOT_ALLOWED");
    EXPECT_EQ(ErrorReason(guard.Check(Request(method, host, "", "same-site"))),
              "ORIGIN_NOT_ALLOWED");
  }
  // Reading is the browser's to refuse: nothing here allows other origins to.
  EXPECT_TRUE(guard.Check(Request("GET", host, "http://evil.example", "cross-site")).ok());
  EXPECT_TRUE(guard.Check(Request("POST", "planner", "https://planner:443")).ok());
  EXPECT_TRUE(guard.Check(Request("POST", "planner:80", "http://planner")).ok());
}

}  // namespace
}  // namespace sightline
