// SPDX-License-Identifier: BSD-3-Clause
#include "ves/faults/table.hpp"

#include <algorithm>

#include "rows.hpp"

namespace ves {
namespace {

/// F2 before F10, F10 before F10b.
bool before(const FaultRow& a, const FaultRow& b) {
  const auto key = [](const FaultRow& row) {
    std::size_t end = 0;
    const int number = std::stoi(row.id.substr(1), &end);
    return std::pair(number, row.id.substr(1 + end));
  };
  return key(a) < key(b);
}

}  // namespace

std::vector<FaultRow> faultTable(const FaultBench& bench) {
  std::vector<FaultRow> rows;
  for (auto& part : {scenarioRows(bench), operatorRows(bench), inputRows(bench), sensorRows(bench),
                     processRows(bench)})
    rows.insert(rows.end(), part.begin(), part.end());
  std::sort(rows.begin(), rows.end(), before);
  return rows;
}

}  // namespace ves
