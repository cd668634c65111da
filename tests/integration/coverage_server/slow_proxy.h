// SPDX-License-Identifier: Apache-2.0
// A network between a client and a server on a unix socket: slow, and cut when a test wants it.
#pragma once

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"

namespace sightline {

class SlowProxy {
 public:
  // Passes at most `bytes_per_s` in each direction of a connection.
  SlowProxy(std::string socket_path, double bytes_per_s)
      : socket_path_(std::move(socket_path)),
        bytes_per_s_(bytes_per_s),
        listener_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(bind(listener_, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
    EXPECT_EQ(listen(listener_, 16), 0);
    socklen_t size = sizeof(address);
    getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size);
    address_ = absl::StrCat("127.0.0.1:", ntohs(address.sin_port));
    thread_ = std::thread([this] { Work(); });
  }
  ~SlowProxy() {
    stopping_ = true;
    thread_.join();
    close(listener_);
  }
  SlowProxy(const SlowProxy&) = delete;
  SlowProxy& operator=(const SlowProxy&) = delete;

  const std::string& address() const { return address_; }
  int connections() const { return connections_; }
  // As if a cable were pulled and the routers noticed.
  void CutConnections() {
    cut_ = true;
    while (cut_) absl::SleepFor(absl::Milliseconds(1));
  }

 private:
  struct Pair {
    int ends[2];
  };

  // Takes turns of ten milliseconds.
  void Work() {
    std::vector<Pair> pairs;
    const auto close_all = [&pairs] {
      for (const Pair& pair : pairs) {
        close(pair.ends[0]);
        close(pair.ends[1]);
      }
      pairs.clear();
    };
    const auto turn = absl::Milliseconds(10);
    std::string buffer(static_cast<size_t>(bytes_per_s_ * absl::ToDoubleSeconds(turn)) + 1, '\0');
    while (!stopping_) {
      if (cut_) {
        close_all();
        cut_ = false;
      }
      pollfd waiting = {listener_, POLLIN, 0};
      if (poll(&waiting, 1, 0) > 0) Accept(&pairs);
      for (size_t i = 0; i < pairs.size();) {
        if (Pass(pairs[i].ends[0], pairs[i].ends[1], &buffer) &&
            Pass(pairs[i].ends[1], pairs[i].ends[0], &buffer)) {
          ++i;
          continue;
        }
        close(pairs[i].ends[0]);
        close(pairs[i].ends[1]);
        pairs.erase(pairs.begin() + static_cast<std::ptrdiff_t>(i));
      }
      absl::SleepFor(turn);
    }
    close_all();
  }

  void Accept(std::vector<Pair>* pairs) {
    const int client = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
    if (client < 0) return;
    const int server = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_un to{};
    to.sun_family = AF_UNIX;
    std::strncpy(to.sun_path, socket_path_.c_str(), sizeof(to.sun_path) - 1);
    if (connect(server, reinterpret_cast<sockaddr*>(&to), sizeof(to)) != 0) {
      close(client);
      close(server);
      return;
    }
    ++connections_;
    pairs->push_back({{client, server}});
  }

  // False: the connection has ended.
  static bool Pass(int from, int to, std::string* buffer) {
    const ssize_t got = recv(from, buffer->data(), buffer->size(), MSG_DONTWAIT);
    if (got < 0) return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR;
    if (got == 0) return false;
    return send(to, buffer->data(), static_cast<size_t>(got), MSG_NOSIGNAL) == got;
  }

  const std::string socket_path_;
  const double bytes_per_s_;
  const int listener_;
  std::string address_;
  std::atomic<bool> stopping_ = false;
  std::atomic<bool> cut_ = false;
  std::atomic<int> connections_ = 0;
  std::thread thread_;
};

}  // namespace sightline
