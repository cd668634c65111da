// SPDX-License-Identifier: Apache-2.0
// Times, CPU times, statistics and result files of benchmarks.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace sightline::bench {

using Json = nlohmann::ordered_json;

class Stopwatch {
 public:
  double Seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

// User and system time of this process with all its threads.
double OwnCpuSeconds();
// The same of ended children.
double ChildCpuSeconds();
// The same of another process; 0 if there is none.
double ProcessCpuSeconds(pid_t pid);
// Largest resident set of this process so far, and of the largest of its ended children.
double PeakRssMiB();
double PeakChildRssMiB();

// Quantile in [0, 1] with linear interpolation; NaN for no values.
double Quantile(std::vector<double> values, double quantile);
double Median(std::vector<double> values);
double Mean(const std::vector<double>& values);
// Spearman's rank correlation, equal values get their mean rank; NaN if one side is constant.
double Spearman(const std::vector<double>& a, const std::vector<double>& b);

// Calls work(i) for i in [0, count) from `threads` threads.
void ParallelFor(int threads, size_t count, const std::function<void(size_t)>& work);

// CPU, cores, 1-minute load average, date.
Json MachineToJson();
// Prints the machine in one line.
void PrintMachine();
// Writes the results next to the machine's description; says where. Empty path: nothing.
void WriteResults(const std::string& path, const std::string& benchmark, Json results);

// Prints "NAME: MESSAGE" and ends the process with exit code 1.
[[noreturn]] void Fail(const std::string& name, const std::string& message);

}  // namespace sightline::bench
