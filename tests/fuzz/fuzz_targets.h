// SPDX-License-Identifier: Apache-2.0
// The readers of files from outside, each as a function of bytes.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <string_view>

namespace sightline {

// By name, which is that of the folder of its seeds in corpus/. A target accepts any bytes; what
// counts is that it returns, soon and without much memory.
using FuzzTarget = std::function<void(std::string_view)>;
const std::map<std::string, FuzzTarget>& FuzzTargets();

// Targets by what they read: parts, images, devices and descriptions; commands, robots, plans and
// pages; requests and files of the servers.
std::map<std::string, FuzzTarget> FileTargets();
std::map<std::string, FuzzTarget> ClientTargets();
std::map<std::string, FuzzTarget> ServiceTargets();

}  // namespace sightline
