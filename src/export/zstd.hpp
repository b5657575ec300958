// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fmt/format.h>
#include <zstd.h>

#include <string>

#include "ves/core/errors.hpp"

namespace ves {

/// A frame of zstd. Throws InputError, naming the file that it is for.
inline std::string compressed(const std::string& data, const std::string& file) {
  constexpr int kLevel = 3;
  std::string out(ZSTD_compressBound(data.size()), '\0');
  const std::size_t size = ZSTD_compress(out.data(), out.size(), data.data(), data.size(), kLevel);
  if (ZSTD_isError(size))
    throw InputError(fmt::format("{}: zstd: {}", file, ZSTD_getErrorName(size)));
  out.resize(size);
  return out;
}

}  // namespace ves
