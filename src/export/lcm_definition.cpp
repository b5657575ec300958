// SPDX-License-Identifier: BSD-3-Clause
#include "ves/export/lcm_definition.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <sstream>

#include "cdr.hpp"
#include "ves/export/definitions.hpp"

namespace ves {
namespace {

struct Type {
  const char* ros;
  std::size_t size;  // [B]
};
const std::map<std::string, Type> kTypes = {
    {"int8_t", {"int8", 1}},   {"int16_t", {"int16", 2}},           {"int32_t", {"int32", 4}},
    {"int64_t", {"int64", 8}}, {"float", {"float32", 4}},           {"double", {"float64", 8}},
    {"boolean", {"bool", 1}},  {"header_t", {"ves_msgs/Header", 0}}};

}  // namespace

/// Big-endian fields behind each other, as LCM has them.
class LcmDefinition::Bytes {
 public:
  Bytes(const std::vector<std::uint8_t>& bytes, std::size_t at) : bytes_(bytes), at_(at) {}

  bool copy(const std::vector<Field>& fields, const std::vector<Field>& header, Cdr& to) {
    for (const Field& f : fields)
      for (int i = 0; i < std::max(1, f.count); ++i)
        if (f.size == 0 ? !copy(header, header, to) : !copy(f.size, to)) return false;
    return true;
  }
  bool done() const { return at_ == bytes_.size(); }

 private:
  bool copy(std::size_t size, Cdr& to) {
    if (size > bytes_.size() - at_) return false;
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < size; ++i) value = value << 8 | bytes_[at_++];
    if (size == 1) to.number(static_cast<std::uint8_t>(value));
    if (size == 2) to.number(static_cast<std::uint16_t>(value));
    if (size == 4) to.number(static_cast<std::uint32_t>(value));
    if (size == 8) to.number(value);
    return true;
  }
  const std::vector<std::uint8_t>& bytes_;
  std::size_t at_;
};

LcmDefinition::LcmDefinition(const std::string& lcm)
    : fields_(parse(lcm)), header_(parse(kLcmDefinitions.at("header_t"))) {}

LcmDefinition LcmDefinition::of(const std::string& type) {
  return LcmDefinition(kLcmDefinitions.at(type));
}

std::vector<LcmDefinition::Field> LcmDefinition::parse(const std::string& lcm) {
  std::vector<Field> out;
  std::istringstream in(lcm);
  std::string line;
  bool inside = false;
  while (std::getline(in, line)) {
    const std::size_t slashes = line.find("//");
    const std::string code = line.substr(0, slashes);
    inside = inside || code.find("struct ") != std::string::npos;
    const std::size_t end = code.find(';');
    if (!inside || end == std::string::npos) continue;
    std::istringstream words(code.substr(0, end));
    std::string type;
    Field field;
    words >> type >> field.name;
    field.type = kTypes.at(type).ros;
    field.size = kTypes.at(type).size;
    if (slashes != std::string::npos) field.comment = line.substr(slashes + 2);
    if (const std::size_t open = field.name.find('['); open != std::string::npos) {
      field.count = std::stoi(field.name.substr(open + 1));
      field.name.erase(open);
    }
    out.push_back(field);
  }
  return out;
}

std::string LcmDefinition::text(const std::vector<Field>& fields) {
  std::string out;
  for (const Field& f : fields)
    out += fmt::format("{}{} {}{}\n", f.type, f.count ? fmt::format("[{}]", f.count) : "", f.name,
                       f.comment.empty() ? "" : "  #" + f.comment);
  return out;
}

std::string LcmDefinition::ros2() const {
  return text(fields_) + std::string(80, '=') + "\nMSG: ves_msgs/Header\n" + text(header_);
}

std::string LcmDefinition::cdr(const std::vector<std::uint8_t>& message) const {
  constexpr std::size_t kFingerprint = 8;  // [B]
  if (message.size() < kFingerprint) return {};
  Bytes from(message, kFingerprint);
  Cdr out;
  if (!from.copy(fields_, header_, out) || !from.done()) return {};
  return out.bytes();
}

}  // namespace ves
