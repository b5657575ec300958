// SPDX-License-Identifier: BSD-3-Clause
#include "malloc_guard.hpp"

#include <cstdlib>

extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
}

namespace {
thread_local bool armed = false;
thread_local std::int64_t calls = 0;
void count() {
  if (armed) ++calls;
}
}  // namespace

// glibc's own, counted.
extern "C" {
void* malloc(std::size_t size) { return count(), __libc_malloc(size); }
void* calloc(std::size_t n, std::size_t size) { return count(), __libc_calloc(n, size); }
void* realloc(void* p, std::size_t size) { return count(), __libc_realloc(p, size); }
void* aligned_alloc(std::size_t a, std::size_t size) { return count(), __libc_memalign(a, size); }
int posix_memalign(void** p, std::size_t a, std::size_t size) {
  count();
  *p = __libc_memalign(a, size);
  return *p ? 0 : 12;
}
}

namespace ves::test {

MallocGuard::MallocGuard() {
  calls = 0;
  armed = true;
}
MallocGuard::~MallocGuard() { armed = false; }
std::int64_t MallocGuard::count() const { return calls; }

}  // namespace ves::test
