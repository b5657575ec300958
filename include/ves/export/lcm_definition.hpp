// SPDX-License-Identifier: BSD-3-Clause
//
// A message of lcmtypes/ as ROS 2 would have it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace ves {

class LcmDefinition {
 public:
  /// The text of an .lcm file with one struct. A header_t in it is that of lcmtypes/.
  explicit LcmDefinition(const std::string& lcm);
  /// Of one of our messages, as "state_t".
  static LcmDefinition of(const std::string& type);

  /// The ros2msg definition, comments behind their fields.
  std::string ros2() const;
  /// The bytes of an LCM message as CDR; empty when they are not of this definition.
  std::string cdr(const std::vector<std::uint8_t>& message) const;

 private:
  struct Field {
    std::string type;  // of ROS
    std::string name, comment;
    std::size_t size = 0;  // [B]; 0: a header_t
    int count = 0;         // [-] of an array; 0: a single one
  };
  class Bytes;
  static std::vector<Field> parse(const std::string& lcm);
  static std::string text(const std::vector<Field>& fields);

  std::vector<Field> fields_, header_;
};

}  // namespace ves
