// SPDX-License-Identifier: BSD-3-Clause
#include "ves/base/memo.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <latch>
#include <stdexcept>
#include <thread>
#include <vector>

namespace ves {
namespace {

TEST(Memo, ComputesOnceWhatIsAmongTheLast) {
  Memo<int, int, 2> squares;
  int computed = 0;
  const auto square = [&](int x) {
    return *squares.of(x, [&] {
      ++computed;
      return x * x;
    });
  };
  EXPECT_EQ(square(3), 9);
  EXPECT_EQ(square(4), 16);
  EXPECT_EQ(square(3), 9);
  EXPECT_EQ(computed, 2);
  EXPECT_EQ(square(5), 25);  // in the place of 3, the oldest
  EXPECT_EQ(square(4), 16);
  EXPECT_EQ(computed, 3);
  EXPECT_EQ(square(3), 9);
  EXPECT_EQ(computed, 4);
}

TEST(Memo, WhatIsGivenOutOutlivesItsPlace) {
  Memo<int, std::vector<int>, 1> memo;
  const auto kept = memo.of(1, [] { return std::vector<int>{1, 2, 3}; });
  memo.of(2, [] { return std::vector<int>{}; });
  EXPECT_EQ(*kept, (std::vector<int>{1, 2, 3}));
}

TEST(Memo, PassesOnWhatIsThrownAndKeepsNothingOfIt) {
  Memo<int, int, 2> memo;
  EXPECT_THROW(memo.of(1, []() -> int { throw std::domain_error("none"); }), std::domain_error);
  EXPECT_EQ(*memo.of(1, [] { return 7; }), 7);
}

TEST(Memo, OneOfManyThreadsComputes) {
  constexpr int kThreads = 8;
  Memo<int, int, 2> memo;
  std::atomic<int> computed = 0, right = 0;
  std::latch all(kThreads);
  std::vector<std::thread> threads;
  for (int i = 0; i < kThreads; ++i)
    threads.emplace_back([&] {
      all.arrive_and_wait();
      right += *memo.of(1, [&] { return ++computed; }) == 1;
    });
  for (std::thread& one : threads) one.join();
  EXPECT_EQ(computed, 1);
  EXPECT_EQ(right, kThreads);
}

}  // namespace
}  // namespace ves
