// SPDX-License-Identifier: BSD-3-Clause
//
// Subset simulation against probabilities that are known exactly.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "support/programs.hpp"
#include "ves/sweep/subset.hpp"

namespace ves {
namespace {

using Numbers = std::vector<double>;
using Beyond = std::function<double(const Numbers&)>;

SubsetSimulation simulated(std::size_t numbers, std::int64_t runs, std::uint64_t seed,
                           const Beyond& beyond) {
  SubsetSimulation s(numbers, runs, seed);
  for (auto batch = s.next(); batch.size > 0; batch = s.next()) {
    std::vector<double> values;
    for (std::int64_t k = 0; k < batch.size; ++k)
      values.push_back(beyond(s.numbers(batch.first + k)));
    s.take(values);
  }
  return s;
}

/// The mean of many simulations, and how often their intervals have the truth in them.
void expectProbability(double truth, std::size_t numbers, std::int64_t runs, const Beyond& beyond) {
  constexpr int kTimes = 60;
  double mean = 0.0, square = 0.0;
  int inside = 0;
  for (int k = 0; k < kTimes; ++k) {
    const auto e = simulated(numbers, runs, static_cast<std::uint64_t>(k), beyond).estimate();
    mean += e.probability / truth / kTimes;
    square += e.probability * e.probability / (truth * truth) / kTimes;
    inside += e.low <= truth && truth <= e.high;
  }
  const double deviation = std::sqrt((square - mean * mean) / kTimes);
  EXPECT_NEAR(mean, 1.0, 4.0 * deviation) << truth;
  EXPECT_LT(deviation, 0.1) << truth;  // a band of any width would have it
  EXPECT_GE(inside, 51) << truth;      // of 60; 19 of 20 would be 57
}

TEST(SubsetSimulation, FindsHowOftenARatioOfDrawnMassesPassesALimit) {
  // Two masses from 1 to 2 kg: x / y > r with probability (2 - r)^2 / (2 r).
  for (const double p : {1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6}) {
    const double r = 2.0 + p - std::sqrt((2.0 + p) * (2.0 + p) - 4.0);
    expectProbability(p, 2, 1000, [=](const Numbers& u) { return (1 + u[0]) / (1 + u[1]) - r; });
  }
}

TEST(SubsetSimulation, FindsACornerOfManyNumbers) {
  // The sum of six beyond s > 5: (6 - s)^6 / 720. A seventh number does not matter.
  for (const double p : {1e-3, 1e-5}) {
    const double s = 6.0 - std::pow(720.0 * p, 1.0 / 6.0);
    expectProbability(
        p, 7, 2000, [=](const Numbers& u) { return u[0] + u[1] + u[2] + u[3] + u[4] + u[5] - s; });
  }
}

TEST(SubsetSimulation, StepsStayInTheUnitInterval) {
  SubsetSimulation s(1, 1000, 1);
  for (auto batch = s.next(); batch.size > 0; batch = s.next()) {
    std::vector<double> values;
    for (std::int64_t k = 0; k < batch.size; ++k) {
      const double u = s.numbers(batch.first + k)[0];
      ASSERT_TRUE(u >= 0.0 && u <= 1.0);
      values.push_back(u - (1.0 - 1e-4));
    }
    s.take(values);
  }
}

TEST(SubsetSimulation, KnowsNoMoreOfWhatNeverHappensThanThatItIsRare) {
  const auto s = simulated(1, 1000, 1, [](const Numbers& u) { return u[0] - 2.0; });
  EXPECT_EQ(s.estimate().levels, SubsetSimulation::kMostLevels);
  EXPECT_EQ(s.estimate().probability, 0.0);
  EXPECT_GT(s.estimate().high, 1e-11);
  EXPECT_LT(s.estimate().high, 1e-9);
  EXPECT_EQ(s.next().first, SubsetSimulation::most(1000));
}

TEST(SubsetSimulation, ARunWithoutAValueHasNotHappened) {
  const auto s =
      simulated(1, 1000, 3, [](const Numbers& u) { return u[0] < 0.5 ? NAN : u[0] - 0.8; });
  EXPECT_NEAR(s.estimate().probability, 0.2, 0.05);
  EXPECT_EQ(s.estimate().levels, 1);
  EXPECT_THROW(simulated(1, 1000, 1, [](const Numbers&) { return NAN; }), std::domain_error);
}

TEST(SubsetSimulation, RefusesWhatItCannotTellApart) {
  EXPECT_THROW(simulated(1, 1000, 1, [](const Numbers& u) { return u[0] < 0.7 ? -1.0 : -2.0; }),
               std::domain_error);
  for (const std::int64_t runs : {0, 90, 1001})
    EXPECT_THROW(SubsetSimulation(1, runs, 1), std::domain_error);
}

}  // namespace
}  // namespace ves
