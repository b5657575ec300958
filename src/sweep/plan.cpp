// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <boost/random/sobol.hpp>
#include <cmath>
#include <utility>

#include "number.hpp"
#include "random.hpp"
#include "ves/sweep/sweep.hpp"

namespace ves {
namespace {

constexpr std::uint32_t kPointBits = 30;  // [-] of a Sobol point

/// Where i goes among n, each somewhere else: a Feistel network over the next power of four, gone
/// through until it is one of them.
std::uint64_t shuffled(std::uint64_t i, std::uint64_t n, std::uint64_t key) {
  std::uint64_t half = 1;
  while ((std::uint64_t{1} << (2 * half)) < n) ++half;
  const std::uint64_t mask = (std::uint64_t{1} << half) - 1;
  do {
    std::uint64_t left = i >> half, right = i & mask;
    for (std::uint64_t round = 0; round < 6; ++round)
      left = std::exchange(right, left ^ (mixed(key, right, round) & mask));
    i = (left << half) | right;
  } while (i >= n);
  return i;
}

std::vector<std::string> split(const std::string& text, char at) {
  std::vector<std::string> out(1);
  int depth = 0;  // a list is one value
  for (const char c : text) {
    depth += (c == '[' || c == '{') - (c == ']' || c == '}');
    if (c == at && depth == 0)
      out.emplace_back();
    else
      out.back() += c;
  }
  return out;
}

}  // namespace

void SweepPlan::take(const std::string& key, const std::string& option) const {
  for (const std::string& other : keys())
    if (other == key) throw InputError(fmt::format("{}: '{}' is given twice", option, key));
}

void SweepPlan::vary(const std::string& option) {
  const std::size_t equals = option.find('=');
  Varied v;
  if (equals != std::string::npos && equals > 0) {
    v.key = option.substr(0, equals);
    const std::string text = option.substr(equals + 1);
    const std::vector<std::string> range = split(text, ':');
    double from = 0.0, to = 0.0, count = 0.0;
    constexpr double kMost = 1e6;
    if (range.size() == 3 && toNumber(range[0], from) && toNumber(range[1], to) &&
        toNumber(range[2], count) && count >= 2 && count <= kMost && count == std::floor(count)) {
      for (double i = 0.0; i < count; i += 1.0)
        v.values.push_back(fmt::format("{}", from + (to - from) * i / (count - 1.0)));
    } else if (range.size() == 1 || text.find('{') != std::string::npos) {
      v.values = split(text, ',');
      for (const std::string& value : v.values)
        if (value.empty()) v.values.clear();
    }
  }
  if (v.values.empty())
    throw InputError(fmt::format(
        "--vary '{}': want KEY=V1,V2,.. or KEY=FROM:TO:COUNT with a COUNT of 2 or more", option));
  take(v.key, "--vary");
  varied_.push_back(v);
}

void SweepPlan::draw(const std::string& option) {
  const std::size_t equals = option.find('='), colon = option.find(':');
  Drawn d;
  if (equals == std::string::npos || equals == 0 || colon == std::string::npos || colon < equals ||
      !toNumber(option.substr(equals + 1, colon - equals - 1), d.from) ||
      !toNumber(option.substr(colon + 1), d.to) || !(d.from <= d.to))
    throw InputError(fmt::format("--draw '{}': want KEY=FROM:TO, FROM not above TO", option));
  d.key = option.substr(0, equals);
  take(d.key, "--draw");
  drawn_.push_back(d);
}

void SweepPlan::drawWhole(const std::function<bool(const std::string& key)>& takes_only_whole) {
  for (Drawn& d : drawn_) {
    if (!takes_only_whole(d.key)) continue;
    if (d.from != std::floor(d.from) || d.to != std::floor(d.to))
      throw InputError(
          fmt::format("--draw '{}={}:{}': the key takes whole numbers only, want whole "
                      "ends",
                      d.key, d.from, d.to));
    d.whole = true;
  }
}

std::int64_t SweepPlan::size() const {
  constexpr double kMost = 1e9;
  double product = static_cast<double>(subset_ ? SubsetSimulation::most(draws_) : draws_);
  for (const Varied& v : varied_) product *= static_cast<double>(v.values.size());
  if (product > kMost)
    throw InputError(fmt::format("--vary: {:g} runs, want at most {:g}", product, kMost));
  return static_cast<std::int64_t>(product);
}

std::vector<std::string> SweepPlan::keys() const {
  std::vector<std::string> out;
  for (const Varied& v : varied_) out.push_back(v.key);
  for (const Drawn& d : drawn_) out.push_back(d.key);
  if (draws_ > 1 && std::find(out.begin(), out.end(), "seed") == out.end()) out.push_back("seed");
  return out;
}

std::string SweepPlan::text() const {
  std::string out =
      fmt::format("{} runs, {} of each combination, seed {}\n", size(), draws_, seed_);
  for (const Varied& v : varied_)
    out += fmt::format("vary {}={}\n", v.key, fmt::join(v.values, ","));
  for (const Drawn& d : drawn_)
    out += fmt::format("draw {}={}:{}{}\n", d.key, d.from, d.to, d.whole ? ", whole" : "");
  if (design_ == SweepDesign::kLatin) out += "a Latin hypercube\n";
  if (design_ == SweepDesign::kSobol) out += "Sobol's points\n";
  if (subset_) out += "subset simulation\n";
  return out;
}

void SweepPlan::lay(SweepDesign design) {
  constexpr std::size_t kMostKeys = 40, kMostNumbers = 100'000'000;  // 400 MB
  design_ = design;
  if (design != SweepDesign::kUniform && (drawn_.empty() || draws_ == 1))
    throw InputError("--design: places draws, want --draw, and --runs of more than one");
  if (design == SweepDesign::kSubset) {
    if (!varied_.empty())
      throw InputError("--design subset: one question at a time, want no --vary");
    if (draws_ < 100 || draws_ % SubsetSimulation::kSteps != 0)
      throw InputError(fmt::format(
          "--design subset: --runs {} a level, want a multiple of ten, 100 or more", draws_));
    subset_.emplace(drawn_.size(), draws_, seed_);
  }
  if (design != SweepDesign::kSobol) return;
  const std::size_t keys = drawn_.size(), runs = static_cast<std::size_t>(draws_);
  if (keys > kMostKeys || runs * keys > kMostNumbers)
    throw InputError(
        fmt::format("--design sobol: {} keys and {} runs, want at most {} keys, and {} "
                    "runs times keys",
                    keys, runs, kMostKeys, kMostNumbers));
  points_.assign(keys, 0);  // the first, which Boost leaves out
  points_.reserve(runs * keys);
  boost::random::sobol sobol(keys);
  while (points_.size() < runs * keys)
    points_.push_back(static_cast<std::uint32_t>(sobol() >> (64 - kPointBits)));
}

/// Of one combination's draws each key has its own order or digits.
double SweepPlan::share(std::int64_t run, std::size_t key) const {
  const auto number = static_cast<std::uint64_t>(run), draws = static_cast<std::uint64_t>(draws_),
             nth = number % draws;
  const double within = uniform(seed_, number, key + 1);
  if (design_ == SweepDesign::kUniform) return within;
  const std::uint64_t own = mixed(seed_, number / draws, ~static_cast<std::uint64_t>(key));
  if (design_ == SweepDesign::kLatin)
    return (static_cast<double>(shuffled(nth, draws, own)) + within) / static_cast<double>(draws_);
  const std::uint32_t digits = static_cast<std::uint32_t>(own >> (64 - kPointBits));
  return std::ldexp((points_[nth * drawn_.size() + key] ^ digits) + within, -int{kPointBits});
}

std::vector<std::string> SweepPlan::overrides(std::int64_t run) const {
  std::vector<std::string> out;
  std::int64_t left = run / draws_;
  for (const Varied& v : varied_) {
    const auto n = static_cast<std::int64_t>(v.values.size());
    out.push_back(v.key + "=" + v.values[static_cast<std::size_t>(left % n)]);
    left /= n;
  }
  const auto number = static_cast<std::uint64_t>(run);
  const std::vector<double> chained = subset_ ? subset_->numbers(run) : std::vector<double>();
  for (std::size_t i = 0; i < drawn_.size(); ++i) {
    const Drawn& d = drawn_[i];
    const double x = subset_ ? chained[i] : share(run, i);
    double value = d.from + (d.to - d.from) * x;
    // A share may be rounded to one.
    if (d.whole) value = std::min(d.to, std::floor(d.from + (d.to - d.from + 1.0) * x));
    out.push_back(fmt::format("{}={}", d.key, value));
  }
  if (keys().size() > out.size())
    out.push_back(fmt::format(
        "seed={}", static_cast<std::int64_t>(std::floor(uniform(seed_, number, 0) * INT32_MAX))));
  return out;
}

void SweepPlan::put(const std::vector<std::string>& overrides, Value& scenario) const {
  for (std::size_t i = 0; i < overrides.size(); ++i)
    applyOverride(scenario, overrides[i], i < varied_.size() ? "--vary" : "--draw");
}

}  // namespace ves
