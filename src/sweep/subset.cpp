// SPDX-License-Identifier: BSD-3-Clause
#include "ves/sweep/subset.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "number.hpp"
#include "random.hpp"

namespace ves {
namespace {

/// Back into [0, 1], as from mirrors at its ends.
double mirrored(double x) { return std::fabs(std::remainder(x, 2.0)); }

}  // namespace

SubsetSimulation::SubsetSimulation(std::size_t numbers, std::int64_t runs, std::uint64_t seed)
    : count_(numbers),
      runs_(runs),
      chains_(runs / kSteps),
      seed_(seed),
      batch_(runs),
      threshold_(-HUGE_VAL) {
  if (runs < 100 || runs % kSteps != 0)
    throw std::domain_error("want a multiple of ten runs a level, 100 or more");
}

std::vector<double> SubsetSimulation::numbers(std::int64_t run) const {
  const auto at = static_cast<std::uint64_t>(run);
  std::vector<double> out(count_);
  for (std::size_t i = 0; i < count_; ++i) {
    const double u = uniform(seed_, at, i + 1);
    if (batch_ == runs_) {
      out[i] = u;
      continue;
    }
    const auto newest = level_.size() - static_cast<std::size_t>(chains_ - (run - taken_));
    out[i] = mirrored(level_[newest].numbers[i] + width_[i] * (2.0 * u - 1.0));
  }
  return out;
}

void SubsetSimulation::take(const std::vector<double>& beyond) {
  std::vector<Sample> now;
  for (std::int64_t k = 0; k < batch_; ++k) {
    Sample sample{numbers(taken_ + k), beyond[static_cast<std::size_t>(k)]};
    if (std::isnan(sample.beyond)) sample.beyond = -HUGE_VAL;
    // A step that would leave the level's region is not taken: Metropolis' rule for what is
    // uniform.
    if (!(sample.beyond >= threshold_))
      sample = level_[level_.size() - static_cast<std::size_t>(chains_ - k)];
    now.push_back(std::move(sample));
  }
  level_.insert(level_.end(), now.begin(), now.end());
  taken_ += batch_;
  if (std::ssize(level_) == runs_) finishLevel();
}

/// How much the runs of a chain repeat each other: gamma of Au and Beck.
double SubsetSimulation::correlation(double threshold, double share) const {
  const auto inside = [&](std::int64_t chain, std::int64_t step) {
    const Sample& s = level_[static_cast<std::size_t>(step * chains_ + chain)];
    return (s.beyond >= threshold ? 1.0 : 0.0) - share;
  };
  double gamma = 0.0;
  const double none = share * (1.0 - share);
  for (std::int64_t lag = 1; lag < kSteps && none > 0.0; ++lag) {
    double sum = 0.0;
    for (std::int64_t step = 0; step + lag < kSteps; ++step)
      for (std::int64_t chain = 0; chain < chains_; ++chain)
        sum += inside(chain, step) * inside(chain, step + lag);
    const auto pairs = static_cast<double>(chains_ * (kSteps - lag));
    gamma += 2.0 * (1.0 - static_cast<double>(lag) / kSteps) * sum / pairs / none;
  }
  return std::max(0.0, gamma);
}

void SubsetSimulation::finishLevel() {
  std::vector<std::size_t> order(level_.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [this](std::size_t a, std::size_t b) {
    return level_[a].beyond > level_[b].beyond;
  });
  const auto countFrom = [this](double least) {
    return std::count_if(level_.begin(), level_.end(),
                         [=](const Sample& s) { return s.beyond >= least; });
  };
  const double least = std::nextafter(0.0, 1.0);  // beyond the limit, and not at it
  const double tenth = level_[order[static_cast<std::size_t>(chains_ - 1)]].beyond;
  const bool reached = tenth >= least, last = estimate_.levels == kMostLevels;
  const double from = reached || last ? least : tenth;
  const auto inside = countFrom(from);
  const double share = static_cast<double>(inside) / static_cast<double>(runs_);
  if (!reached && !last && (share > 0.5 || from == -HUGE_VAL))
    throw std::domain_error("too many runs come equally near to the limit");

  const double before = estimate_.levels == 1 ? 1.0 : estimate_.probability;
  const double gamma = estimate_.levels == 1 ? 0.0 : correlation(from, share);
  estimate_.probability = before * share;
  if (share > 0.0)
    variance_ += (1.0 - share) / (share * static_cast<double>(runs_)) * (1.0 + gamma);
  if (reached || last) {
    const double spread = std::exp(kDeviations * std::sqrt(std::log1p(variance_)));
    estimate_.low = estimate_.probability / spread;
    // Not once in the last level: as likely as three in so many would be seen at least once.
    estimate_.high = share > 0.0 ? std::min(1.0, estimate_.probability * spread)
                                 : before * 3.0 / static_cast<double>(runs_) * spread;
    done_ = true;
    return;
  }
  ++estimate_.levels;
  threshold_ = tenth;
  std::vector<Sample> seeds;
  // Among equals at the threshold the first; they are alike in all that a level can see.
  for (std::int64_t k = 0; k < chains_; ++k)
    seeds.push_back(level_[order[static_cast<std::size_t>(k)]]);
  // A step as wide as a uniform piece of the seeds' spread, and narrower where many numbers move.
  const double narrower = std::min(1.0, 1.2 / std::sqrt(static_cast<double>(count_)));
  width_.assign(count_, 0.0);
  for (std::size_t i = 0; i < count_; ++i) {
    double mean = 0.0, squares = 0.0;
    for (const Sample& s : seeds) mean += s.numbers[i] / static_cast<double>(chains_);
    for (const Sample& s : seeds) squares += (s.numbers[i] - mean) * (s.numbers[i] - mean);
    width_[i] = narrower * std::sqrt(12.0 * squares / static_cast<double>(chains_));
  }
  level_ = std::move(seeds);
  batch_ = chains_;
}

}  // namespace ves
