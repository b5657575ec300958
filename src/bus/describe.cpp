// SPDX-License-Identifier: BSD-3-Clause
//
// ves_describe FOLDER: writes what follows from contract/schema.hpp, at build time: the definitions
// of the messages (NAME.lcm), the lists of their fields for C++ (ves/values.hpp), and a table for
// people (messages.md).
#include <fstream>
#include <iostream>
#include <string>

#include "ves/contract/schema.hpp"

namespace ves::schema {
namespace {

/// So many numbers of the LCM type that `name` says.
struct Shape {
  const char* type;
  int size;  // 0: no list
};

Shape shapeOf(std::int64_t) { return {"int64_t", 0}; }
Shape shapeOf(std::int32_t) { return {"int32_t", 0}; }
Shape shapeOf(std::uint32_t) { return {"int32_t", 0}; }
Shape shapeOf(double) { return {"double", 0}; }
Shape shapeOf(bool) { return {"int8_t", 0}; }
Shape shapeOf(Tripped) { return {"int32_t", 0}; }
Shape shapeOf(const Wrench&) { return {"double", 6}; }
Shape shapeOf(const Pose&) { return {"double", 6}; }
template <typename E>
requires std::is_enum_v<E> Shape shapeOf(E) { return {"int32_t", 0}; }
template <typename E, std::size_t N>
requires(std::is_enum_v<E> || std::same_as<E, std::int32_t>) Shape
    shapeOf(const std::array<E, N>&) {
  return {"int32_t", static_cast<int>(N)};
}
template <int R, int C>
Shape shapeOf(const Eigen::Matrix<double, R, C>&) {
  return {"double", R * C};
}

/// "; 0 disarmed, 1 armed, ...": the numbers that an enumeration or a set has.
template <typename E>
std::string numbers(const char* before, E last) {
  std::string out;
  for (int i = 0; i <= static_cast<int>(last); ++i)
    if (const std::string_view one = name(static_cast<E>(i)); one != "unknown")
      out +=
          (i == 0 ? std::string("; ") + before : ", ") + std::to_string(i) + " " + std::string(one);
  return out;
}

template <typename T>
std::string meaning(const Field<T>& field) {
  using V = std::remove_const_t<T>;
  std::string out = field.meaning;
  if constexpr (std::is_enum_v<V>) out += numbers("", V::kCount);
  if constexpr (requires { V::value_type::kCount; }) out += numbers("", V::value_type::kCount);
  if constexpr (std::same_as<V, Tripped>)
    out += numbers("bit ", static_cast<Check>(static_cast<int>(Check::kCount) - 1));
  return out;
}

/// A comment in lines of at most so many letters.
std::string wrapped(const std::string& text) {
  constexpr std::size_t kMost = 100;  // [-] letters
  std::string out, line = "//";
  const auto flush = [&] {
    out += line + "\n";
    line = "//";
  };
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find(' ', at), text.size());
    if (line.size() + 1 + end - at > kMost) flush();
    line += " " + text.substr(at, end - at);
    at = end + 1;
  }
  flush();
  return out;
}

struct Out {
  std::string folder;
  std::ofstream values, table;

  template <typename S>
  void add() {
    const S s{};
    const Message& message = kMessage<S>;
    std::ofstream lcm(folder + "/" + message.name + ".lcm");
    lcm << "package ves;\n\n"
        << wrapped(message.about) << "struct " << message.name << " {\n"
        << "  header_t header;\n";
    table << "\n## " << message.name << "\n\n"
          << message.about << "\n\n"
          << "| field | type | unit | meaning |\n|---|---|---|---|\n";
    std::string list;
    forEach(s, [&](const auto& field) {
      const Shape shape = shapeOf(field.value);
      const std::string size = shape.size > 0 ? "[" + std::to_string(shape.size) + "]" : "",
                        what = meaning(field);
      lcm << "  " << shape.type << " " << field.name << size << ";  // [" << field.unit << "]"
          << (what.empty() ? "" : " ") << what << "\n";
      table << "| `" << field.name << "` | " << shape.type << size << " | " << field.unit << " | "
            << what << " |\n";
      list += (list.empty() ? "m." : ", m.") + std::string(field.name);
    });
    lcm << "}\n";
    for (const char* qualifier : {"", "const "})
      values << "void values(" << qualifier << message.name << "& m, auto&& f) { f(" << list
             << "); }\n";
  }
};

int describe(const std::string& folder) {
  Out out{folder, std::ofstream(folder + "/ves/values.hpp"),
          std::ofstream(folder + "/messages.md")};
  out.values << "// The fields of the messages, in the order of contract/schema.hpp.\n"
                "#pragma once\n\n";
  for (const char* name :
       {kMessage<Sample>.name, kMessage<LegCommand>.name, kMessage<MachineSetup>.name,
        kMessage<Order>.name, kMessage<TickState>.name})
    out.values << "#include <ves/" << name << ".hpp>\n";
  out.values << "\nnamespace ves {\n\n";
  out.table << "# Messages\n\nEach begins with `header_t header`. Units are SI.\n";
  out.add<Sample>();
  out.add<LegCommand>();
  out.add<MachineSetup>();
  out.add<Order>();
  out.add<TickState>();
  out.values << "\n}  // namespace ves\n";
  return out.values.flush() && out.table.flush() ? 0 : 2;
}

}  // namespace
}  // namespace ves::schema

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: ves_describe FOLDER\n";
    return 2;
  }
  return ves::schema::describe(argv[1]);
}
