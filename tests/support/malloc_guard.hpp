// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

namespace ves::test {

/// Counts this thread's calls to the heap while it lives. Not for sanitizer builds, whose heap is
/// theirs.
class MallocGuard {
 public:
  MallocGuard();
  ~MallocGuard();
  std::int64_t count() const;
};

}  // namespace ves::test
