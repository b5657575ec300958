// SPDX-License-Identifier: BSD-3-Clause
//
// Messages of ROS 2 as bytes: CDR, little-endian.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>

#include "ves/math/frames.hpp"

namespace ves {

class Cdr {
 public:
  template <class T>
  Cdr& number(T value) {
    while ((bytes_.size() - kHead) % sizeof(T) != 0) bytes_ += '\0';
    char raw[sizeof(T)];
    std::memcpy(raw, &value, sizeof(T));
    bytes_.append(raw, sizeof(T));
    return *this;
  }
  Cdr& text(const std::string& text) {
    number(static_cast<std::uint32_t>(text.size() + 1));
    bytes_ += text;
    bytes_ += '\0';
    return *this;
  }
  Cdr& count(std::size_t n) { return number(static_cast<std::uint32_t>(n)); }
  Cdr& vector(const Vec3& p) { return number(p.x()).number(p.y()).number(p.z()); }
  Cdr& time(std::int64_t ns) {
    constexpr std::int64_t kSecond = 1'000'000'000;
    return number(static_cast<std::int32_t>(ns / kSecond))
        .number(static_cast<std::uint32_t>(ns % kSecond));
  }
  Cdr& header(std::int64_t ns, const std::string& frame) { return time(ns).text(frame); }
  Cdr& quaternion(const Mat3& R) {
    const Eigen::Quaterniond q(R);
    return number(q.x()).number(q.y()).number(q.z()).number(q.w());
  }
  const std::string& bytes() const { return bytes_; }

 private:
  static constexpr std::size_t kHead = 4;
  std::string bytes_{"\0\1\0\0", kHead};
};

}  // namespace ves
