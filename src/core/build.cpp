// SPDX-License-Identifier: BSD-3-Clause
#include "ves/core/build.hpp"

#include "ves/core/revision.hpp"

namespace ves {
namespace {

#if defined(__x86_64__)
#define VES_PROCESSOR "x86-64"
#elif defined(__aarch64__)
#define VES_PROCESSOR "aarch64"
#else
#define VES_PROCESSOR "another processor"
#endif

#if defined(__AVX512F__)
#define VES_VECTORS "AVX-512"
#elif defined(__AVX__)
#define VES_VECTORS "AVX"
#elif defined(__SSE2__)
#define VES_VECTORS "SSE2"
#else
#define VES_VECTORS "its own vectors"
#endif

#if defined(__FAST_MATH__)
#define VES_ROUNDING "fast math"
#else
#define VES_ROUNDING "no contraction"
#endif

constexpr std::string_view kSeparator = "; ";

}  // namespace

const Build& build() {
  static constexpr Build kBuild = {VES_VERSION, kRevision, VES_COMPILER, VES_FLAGS,
                                   VES_PROCESSOR ", " VES_VECTORS ", " VES_ROUNDING};
  return kBuild;
}

std::string describeBuild() {
  const Build& b = build();
  std::string out(b.version);
  out.append(kSeparator).append("source ").append(b.revision);
  out.append(kSeparator).append(b.compiler).append(kSeparator).append(b.flags);
  return out.append(kSeparator).append(b.arithmetic);
}

std::string_view arithmeticOf(std::string_view description) {
  const std::size_t at = description.rfind(kSeparator);
  return at == std::string_view::npos ? std::string_view{}
                                      : description.substr(at + kSeparator.size());
}

namespace {

std::filesystem::path programFolder() {
  std::error_code error;
  return std::filesystem::read_symlink("/proc/self/exe", error).parent_path();
}

}  // namespace

std::string_view frontDoor() { return programFolder().filename() == "bin" ? "ves" : "./ves"; }

std::filesystem::path installedData() { return programFolder().parent_path() / "share/ves"; }

}  // namespace ves
