// SPDX-License-Identifier: BSD-3-Clause
//
// The run-time switch of the mutation build, included by every file with mutants: VES_MUTANT=N turns
// the N-th deliberate error on. With VES_MUTANT_COVERAGE=FILE processes mark in it, a byte a mutant,
// which they passed; however they end.
#pragma once

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstdlib>

namespace ves_mutation {

inline constexpr int kMost = 20000;

struct State {
  State() {
    if (const char* number = std::getenv("VES_MUTANT")) active = std::atoi(number);
    const char* coverage = std::getenv("VES_MUTANT_COVERAGE");
    const int file = coverage ? open(coverage, O_RDWR | O_CREAT | O_CLOEXEC, 0666) : -1;
    if (file < 0 || ftruncate(file, kMost) != 0) return;
    void* map = mmap(nullptr, kMost, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    close(file);
    if (map != MAP_FAILED) seen = static_cast<char*>(map);
  }
  int active = 0;
  char nowhere[kMost] = {};
  char* seen = nowhere;
};
inline State state;

}  // namespace ves_mutation

/// Whether mutant `id` is the active one.
inline bool ves_m(int id) noexcept {
  if (char* const seen = ves_mutation::state.seen) seen[id] = 1;  // else it begins before all else
  return ves_mutation::state.active == id;
}
/// A factor: 1, or `other` in the mutant.
inline double ves_f(int id, double other) noexcept { return ves_m(id) ? other : 1.0; }
