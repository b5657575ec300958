// SPDX-License-Identifier: BSD-3-Clause
//
// The run-time switch of the mutation build, included by every file with mutants: VES_MUTANT=N turns
// the N-th deliberate error on. With VES_MUTANT_COVERAGE=FILE a process appends the numbers of the
// mutants that it passed.
#pragma once

#include <cstdio>
#include <cstdlib>

namespace ves_mutation {

inline constexpr int kMost = 20000;

struct State {
  State() {
    if (const char* number = std::getenv("VES_MUTANT")) active = std::atoi(number);
    coverage = std::getenv("VES_MUTANT_COVERAGE");
  }
  ~State() {
    if (!coverage) return;
    if (std::FILE* out = std::fopen(coverage, "a")) {
      for (int i = 0; i < kMost; ++i)
        if (seen[i]) std::fprintf(out, "%d\n", i);
      std::fclose(out);
    }
  }
  int active = 0;
  const char* coverage = nullptr;
  bool seen[kMost] = {};
};
inline State state;

}  // namespace ves_mutation

/// Whether mutant `id` is the active one.
inline bool ves_m(int id) noexcept {
  ves_mutation::state.seen[id] = true;
  return ves_mutation::state.active == id;
}
/// A factor: 1, or `other` in the mutant.
inline double ves_f(int id, double other) noexcept { return ves_m(id) ? other : 1.0; }
