// SPDX-License-Identifier: BSD-3-Clause
//
// What this library and whoever includes its headers have to agree on: otherwise their structs lie
// differently in memory, and numbers would be wrong without a word. find_package(ves) sets it;
// other settings do not compile.
#pragma once

#include <Eigen/Core>

#if defined(__AVX__) != defined(VES_BUILT_WITH_AVX)
#error \
    "ves: -mavx, -mavx2 or -march=native here and not in the library, or there and not here: Eigen's inline functions would be mixed"
#endif
#if defined(_GLIBCXX_DEBUG)
#error \
    "ves: -D_GLIBCXX_DEBUG changes the standard containers: build the library with it too, or do without"
#endif

static_assert(EIGEN_MAX_ALIGN_BYTES == 16 && EIGEN_MAX_STATIC_ALIGN_BYTES == 16,
              "ves: Eigen aligns otherwise than in the library: do without EIGEN_MAX_ALIGN_BYTES, "
              "EIGEN_DONT_ALIGN and EIGEN_DONT_VECTORIZE; find_package(ves) sets what is needed");
static_assert(EIGEN_VERSION_AT_LEAST(3, 4, 0), "ves: want Eigen 3.4");
