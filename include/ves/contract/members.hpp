// SPDX-License-Identifier: BSD-3-Clause
//
// How many members a struct has: a description of them that has forgotten one does not compile.
#pragma once

namespace ves {

/// Fits any member.
struct AnyMember {
  template <typename T>
  operator T() const;
};

/// [-] members of a struct without constructors.
template <typename S, typename... A>
consteval int members() {
  if constexpr (requires { S{A{}..., AnyMember{}}; })
    return members<S, A..., AnyMember>();
  else
    return sizeof...(A);
}

}  // namespace ves
