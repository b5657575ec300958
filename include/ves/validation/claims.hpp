// SPDX-License-Identifier: BSD-3-Clause
//
// The report's claims as data (config/claims.yaml), and the verdict on each.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace ves {

enum class Verdict {
  kAgrees,
  kDiffers,
  kRange,      // over substitutes that stand for what the report measured
  kCannotTell  // what decides it is a substitute, or is not in the report
};

std::string name(Verdict verdict);

/// A claim of the report, and what became of it.
struct Claim {
  std::string where;    // "4.2.1, figures 4.4 and 4.5"
  std::string says;     // the report
  std::string reached;  // numbers
  Verdict verdict = Verdict::kCannotTell;
  std::string why;
};

using Quantities = std::map<std::string, double>;

class Claims {
 public:
  /// Throws InputError where the file is wrong.
  explicit Claims(const std::filesystem::path& file);

  /// The claim with its numbers and a verdict. NaN is in no range. Throws InputError for an `id`
  /// that the file does not have, and for a quantity it names that is not given.
  Claim judge(const std::string& id, const Quantities& measured) const;

  std::vector<std::string> ids() const;

 private:
  struct Entry {
    Claim claim;  // `reached` with its braces
    std::map<std::string, std::pair<double, double>> agrees;
  };
  std::string file_;
  std::map<std::string, Entry> entries_;
};

}  // namespace ves
