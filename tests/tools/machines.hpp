// SPDX-License-Identifier: BSD-3-Clause
//
// Many machines by chance: what the tools that run them have in common.
#pragma once

#include <algorithm>
#include <atomic>
#include <random>
#include <string>
#include <thread>
#include <vector>

namespace ves::test {

using Sets = std::vector<std::string>;

inline Sets with(Sets set, const Sets& more) {
  set.insert(set.end(), more.begin(), more.end());
  return set;
}

/// Runs fn(0), .. fn(n - 1) on all cores.
template <class F>
void forEach(int n, const F& fn) {
  std::atomic<int> next{0};
  std::vector<std::thread> workers;
  for (unsigned w = 0; w < std::max(1u, std::thread::hardware_concurrency()); ++w)
    workers.emplace_back([&] {
      for (int i; (i = next++) < n;) fn(i);
    });
  for (std::thread& worker : workers) worker.join();
}

class Dice {
 public:
  explicit Dice(unsigned seed) : engine_(seed) {}
  double between(double a, double b) {
    return std::uniform_real_distribution<double>(a, b)(engine_);
  }
  int whole(int a, int b) { return std::uniform_int_distribution<int>(a, b)(engine_); }

 private:
  std::mt19937 engine_;
};

}  // namespace ves::test
