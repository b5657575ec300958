// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include "ves/evaluation/let_go.hpp"

namespace ves::test {

/// Live, the base goes as it does in what was recorded.
inline void expectFollowed(const Series& series, const Motion& base) {
  FollowedBase live(series.experiment);
  const Row *first = nullptr, *last = nullptr;
  for (const Row& row : series.rows) {
    live.add(row);
    EXPECT_TRUE(inAdmittance(row.state) || !live.at(row.state)) << row.t;
    if (!inAdmittance(row.state)) continue;
    last = &row;
    if (!first) first = last;
    while (first == last && !live.at(row.state)) live.add(row);  // a motion is known already
  }
  ASSERT_TRUE(last);
  const std::int64_t after = last->state.header.sequence - first->state.header.sequence;
  const Vec6 due = *base.point(after);
  const Vec6 nowhere = Vec6::Constant(1e9);
  // As soon as it is computed.
  while ((live.at(last->state).value_or(nowhere) - due).norm() > 1e-12) live.add(*last);
  EXPECT_EQ(*live.at(first->state), *base.point(0));
}

}  // namespace ves::test
