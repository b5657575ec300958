// SPDX-License-Identifier: BSD-3-Clause
#include "ves/core/memo.hpp"

#include <gtest/gtest.h>

#include <array>
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

/// Lets other threads in while it is compared, and sees them come.
struct SlowKey {
  int value;
  std::atomic<int>* comparing;
  bool operator==(const SlowKey& o) const {
    EXPECT_EQ(++*comparing, 1);
    for (int i = 0; i < 3; ++i) std::this_thread::yield();
    --*comparing;
    return value == o.value;
  }
};

TEST(Memo, OneOfManyThreadsComputes) {
  constexpr int kThreads = 8, kKeys = 6;
  Memo<SlowKey, int, kKeys> memo;
  std::array<std::atomic<int>, kKeys> computed{};
  std::atomic<int> comparing = 0, right = 0;
  std::latch all(kThreads);
  std::vector<std::thread> threads;
  for (int i = 0; i < kThreads; ++i)
    threads.emplace_back([&] {
      all.arrive_and_wait();
      for (int key = 0; key < kKeys; ++key) {
        std::atomic<int>& times = computed[static_cast<std::size_t>(key)];
        right += *memo.of({key, &comparing}, [&] { return ++times; }) == 1;
      }
    });
  for (std::thread& one : threads) one.join();
  for (const std::atomic<int>& times : computed) EXPECT_EQ(times, 1);
  EXPECT_EQ(right, kThreads * kKeys);
}

}  // namespace
}  // namespace ves
