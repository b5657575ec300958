// SPDX-License-Identifier: BSD-3-Clause
#include "ves/sweep/figure.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "number.hpp"
#include "ves/core/errors.hpp"
#include "ves/core/spelling.hpp"

namespace ves {
Figure::Figure(const std::string& text) : text_(text), column_(text) {
  const std::size_t at = text.find_first_of("<>");
  if (at != std::string::npos) {
    column_ = text.substr(0, at);
    beyond_ = text[at];
  }
  if (column_.empty() || (beyond_ && !toNumber(text.substr(at + 1), limit_)))
    throw InputError(fmt::format("--figure '{}': want COLUMN, COLUMN>LIMIT or COLUMN<LIMIT", text));
}

void Figure::find(const std::vector<std::string>& header) {
  const auto at = std::find(header.begin(), header.end(), column_);
  const std::string meant = at == header.end() ? nearest(column_, header) : std::string();
  if (!meant.empty())
    throw InputError(
        fmt::format("--figure '{}': no such column, did you mean '{}'?", text_, meant));
  if (at == header.end())
    throw InputError(
        fmt::format("--figure '{}': no such column; there are {}", text_, fmt::join(header, ", ")));
  at_ = static_cast<std::size_t>(at - header.begin());
}

double Figure::beyond(const std::vector<std::string>& cells) const {
  double x = NAN;
  if (at_ >= cells.size() || !toNumber(cells[at_], x)) return NAN;
  return beyond_ == '<' ? limit_ - x : x - limit_;
}

void Figure::add(const std::vector<std::string>& cells) {
  double x = 0.0;
  if (at_ >= cells.size() || !toNumber(cells[at_], x)) {
    ++without_;
    return;
  }
  if (beyond_) x = (beyond_ == '>' ? x > limit_ : x < limit_) ? 1.0 : 0.0;
  ++n_;
  const double off = x - mean_;
  mean_ += off / static_cast<double>(n_);
  squares_ += off * (x - mean_);
}

Figure::Estimate Figure::estimate() const {
  Estimate out;
  out.of = n_;
  out.without = without_;
  out.value = mean_;
  const auto n = static_cast<double>(n_);
  if (beyond_) {
    const double z2 = kDeviations * kDeviations, middle = (n * mean_ + 0.5 * z2) / (n + z2),
                 half = kDeviations / (n + z2) * std::sqrt(n * mean_ * (1.0 - mean_) + 0.25 * z2);
    out.low = std::max(0.0, middle - half);
    out.high = std::min(1.0, middle + half);
    return out;
  }
  const double half = n_ > 1 ? kDeviations * std::sqrt(squares_ / (n - 1.0) / n) : HUGE_VAL;
  out.low = mean_ - half;
  out.high = mean_ + half;
  return out;
}

}  // namespace ves
