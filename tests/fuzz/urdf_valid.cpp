// SPDX-License-Identifier: BSD-3-Clause
//
// Robots: a description that is valid comes to what it says. Trees of links with a known mass,
// centre, inertia and order of joints are written as XML allows: elements and attributes in any
// order, blanks, comments, either quotes, entities, and what other programs put there.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <random>
#include <string>
#include <vector>

#include "bytes.hpp"
#include "ves/config/urdf.hpp"
#include "ves/core/errors.hpp"

namespace {

using ves::fuzz::require;

using V = std::array<double, 3>;
using M = std::array<V, 3>;

V operator+(const V& a, const V& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }
V times(const M& A, const V& x) {
  V y{};
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t k = 0; k < 3; ++k) y[i] += A[i][k] * x[k];
  return y;
}
M times(const M& A, const M& B) {
  M C{};
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      for (std::size_t k = 0; k < 3; ++k) C[i][j] += A[i][k] * B[k][j];
  return C;
}
M transposed(const M& A) {
  M B{};
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) B[i][j] = A[j][i];
  return B;
}
/// Rz(yaw) Ry(pitch) Rx(roll).
M turned(const V& rpy) {
  const double a = std::cos(rpy[0]), b = std::sin(rpy[0]), c = std::cos(rpy[1]),
               d = std::sin(rpy[1]), e = std::cos(rpy[2]), f = std::sin(rpy[2]);
  return {{{e * c, e * d * b - f * a, e * d * a + f * b},
           {f * c, f * d * b + e * a, f * d * a - e * b},
           {-d, c * b, c * a}}};
}
const M kNotTurned = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};

class Robot {
 public:
  explicit Robot(std::uint64_t seed) : random_(seed) {
    links_ = 1 + below(12);
    std::vector<std::pair<std::string, int>> parts;  // and the joint that it is, -1: none
    std::vector<std::pair<M, V>> poses;
    for (int i = 0; i < links_; ++i) {
      M R = kNotTurned;
      V p{};
      if (i > 0) {
        const int parent = below(i);
        const auto& [Rp, pp] = poses[static_cast<std::size_t>(parent)];
        const V xyz = vector(0.5), rpy = vector(3.0);
        R = times(Rp, turned(rpy));
        p = pp + times(Rp, xyz);
        parts.emplace_back(joint(i, parent, xyz, rpy), i);
      }
      poses.emplace_back(R, p);
      parts.emplace_back(link(i, R, p), -1);
    }
    for (int i = below(4); i > 0; --i) parts.emplace_back(foreign(), -1);
    shuffle(parts);
    std::vector<std::string> texts;
    std::vector<int> written;  // joints, as they stand in the text
    for (const auto& [part, i] : parts) {
      texts.push_back(part);
      if (i >= 0) written.push_back(i);
    }
    std::string robot = element("robot", {{"name", "r"}}, texts, false);
    if (chance(0.3)) robot = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>" + blanks() + robot;
    text = (chance(0.1) ? "\xef\xbb\xbf" : "") + robot + blanks();
    follow(0, written);
  }

  std::string text;
  double mass = 0.0;  // [kg]
  V moment{};         // [kg m] about the root
  M inertia{};        // [kg m^2]
  std::vector<std::string> joints;

  int links() const { return links_; }

 private:
  using Attributes = std::vector<std::pair<std::string, std::string>>;
  struct Below {
    std::string name;
    int parent;  // link
    bool moves;
  };

  double uniform() { return static_cast<double>(random_() >> 11) * 0x1p-53; }
  int below(int n) { return n > 0 ? static_cast<int>(random_() % static_cast<unsigned>(n)) : 0; }
  bool chance(double p) { return uniform() < p; }
  double within(double most) { return most * (2.0 * uniform() - 1.0); }
  V vector(double most) { return {within(most), within(most), within(most)}; }
  template <typename T>
  void shuffle(std::vector<T>& list) {
    for (std::size_t i = list.size(); i > 1; --i)
      std::swap(list[i - 1], list[static_cast<std::size_t>(below(static_cast<int>(i)))]);
  }

  std::string blanks() {
    static const char* const kSome[] = {
        "",          " ", "\n", "\t", "\r\n  ", "<!-- <joint name=\"j\"> -->", "<!-- > ' \" -->\n",
        "<?note a?>"};
    return kSome[below(8)];
  }
  std::string number(double x) {
    const std::string digits = fmt::format("{:.17g}", x);
    if (x >= 0.0 && chance(0.2)) return "+" + digits;
    return chance(0.2) ? fmt::format("{:.17e}", x) : digits;
  }
  std::string three(const V& v) {
    static const char* const kBetween[] = {" ", "  ", "\t", "\n", " \r\n "};
    return (chance(0.2) ? " " : "") + number(v[0]) + kBetween[below(5)] + number(v[1]) +
           kBetween[below(5)] + number(v[2]) + (chance(0.2) ? " " : "");
  }
  /// Some letters as references.
  std::string escaped(const std::string& value) {
    std::string out;
    for (const char c : value)
      out += chance(0.03) ? fmt::format("&#{};", static_cast<int>(c)) : std::string(1, c);
    return out;
  }
  std::string element(const std::string& name, Attributes attributes,
                      std::vector<std::string> children = {}, bool shuffled = true) {
    shuffle(attributes);
    if (shuffled) shuffle(children);
    std::string out = "<" + name;
    for (const auto& [key, value] : attributes) {
      const char quote = chance(0.5) ? '"' : '\'';
      out += fmt::format("{}{}{}={}{}{}{}", chance(0.2) ? "\n\t" : " ", key, chance(0.1) ? " " : "",
                         chance(0.1) ? " " : "", quote, escaped(value), quote);
    }
    if (children.empty() && chance(0.8)) return out + (chance(0.3) ? " />" : "/>");
    out += ">";
    for (const std::string& child : children) out += blanks() + child;
    return out + blanks() + "</" + name + (chance(0.1) ? " >" : ">");
  }

  std::string origin(const V& xyz, const V& rpy) {
    return element("origin", {{"xyz", three(xyz)}, {"rpy", three(rpy)}});
  }

  /// Nothing of masses and motion.
  std::string foreign() {
    switch (below(4)) {
      case 0: return element("gazebo", {{"reference", "l0"}}, {"<mass value=\"9\"/>"});
      case 1:
        return element("transmission", {{"name", "t"}},
                       {"<type>x</type>", "<joint name=\"j1\"/>", "<actuator name=\"m\"/>"});
      case 2: return element("material", {{"name", "grey"}}, {"<color rgba=\"1 1 1 1\"/>"});
      default: return element("unheard_of", {{"joint", "j1"}}, {"<link name=\"l0\"/>"});
    }
  }

  std::string link(int i, const M& R, const V& p) {
    std::vector<std::string> parts;
    if (chance(0.9)) {
      const double m = 0.1 + 3.0 * uniform();
      const V com = vector(0.3), rpy = vector(3.0);
      V I = {0.05 + uniform(), 0.05 + uniform(), 0.0};
      I[2] = std::abs(I[0] - I[1]) + (I[0] + I[1] - std::abs(I[0] - I[1])) * uniform();
      parts.push_back(element("inertial", {},
                              {origin(com, rpy), element("mass", {{"value", number(m)}}),
                               element("inertia", {{"ixx", number(I[0])},
                                                   {"iyy", number(I[1])},
                                                   {"izz", number(I[2])},
                                                   {"ixy", "0"},
                                                   {"ixz", "0.0"},
                                                   {"iyz", "-0"}})}));
      const M A = times(R, turned(rpy));
      const M D = {{{I[0], 0, 0}, {0, I[1], 0}, {0, 0, I[2]}}};
      const M about = times(times(A, D), transposed(A));
      const V c = p + times(R, com);
      const double cc = c[0] * c[0] + c[1] * c[1] + c[2] * c[2];
      mass += m;
      for (std::size_t a = 0; a < 3; ++a) {
        moment[a] += m * c[a];
        for (std::size_t b = 0; b < 3; ++b)
          inertia[a][b] += about[a][b] + m * ((a == b ? cc : 0.0) - c[a] * c[b]);
      }
    }
    for (const char* shape : {"visual", "collision"})
      if (chance(0.4))
        parts.push_back(element(
            shape, {}, {element("geometry", {}, {element("box", {{"size", "0.1 0.1 0.1"}})})}));
    if (chance(0.1)) parts.push_back(foreign());
    return element("link", {{"name", fmt::format("l{}", i)}}, parts);
  }

  std::string joint(int i, int parent, const V& xyz, const V& rpy) {
    static const char* const kTypes[] = {"fixed", "revolute", "continuous", "prismatic"};
    const std::string name = fmt::format("j{}", i), type = kTypes[below(4)];
    below_.push_back({name, parent, type != "fixed"});
    std::vector<std::string> parts = {
        origin(xyz, rpy), element("parent", {{"link", fmt::format("l{}", parent)}}),
        element("child", {{"link", fmt::format("l{}", i)}}),
        element("axis", {{"xyz", three({0.3 + uniform(), within(1.0), within(1.0)})}}),
        element("limit", {{"lower", number(-1.0 - uniform())},
                          {"upper", number(1.0 + uniform())},
                          {"effort", "1"},
                          {"velocity", "1"}})};
    if (chance(0.2)) parts.push_back(element("dynamics", {{"damping", "0.1"}}));
    return element("joint", {{"name", name}, {"type", type}}, parts);
  }

  /// Depth first, a link's joints as they stand in the text.
  void follow(int link, const std::vector<int>& written) {
    for (const int i : written) {
      const Below& b = below_[static_cast<std::size_t>(i - 1)];
      if (b.parent != link) continue;
      if (b.moves) joints.push_back(b.name);
      follow(i, written);
    }
  }

  std::mt19937_64 random_;
  int links_ = 0;
  std::vector<Below> below_;  // the joint of link i + 1
};

bool near(double a, double b) { return std::abs(a - b) <= 1e-9 * (1.0 + std::abs(a)); }

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::uint64_t seed = 1469598103934665603u;
  for (std::size_t i = 0; i < size; ++i) seed = (seed ^ data[i]) * 1099511628211u;
  const Robot robot(seed);
  try {
    const ves::UrdfTree tree(robot.text, "valid.urdf");
    const ves::UrdfRobot held = tree.robot({});
    const ves::RigidBody& body = held.model.base;
    require(static_cast<int>(held.frames.size()) == robot.links());
    require(tree.joints().size() == robot.joints.size());
    for (std::size_t i = 0; i < robot.joints.size(); ++i)
      require(tree.joints()[i].name == robot.joints[i]);
    require(near(body.mass, robot.mass));
    const ves::Mat6 spatial = ves::spatialMass(body);
    for (int i = 0; i < 3; ++i) {
      require(near(body.mass * body.p_BoBcm_B(i), robot.moment[static_cast<std::size_t>(i)]));
      for (int j = 0; j < 3; ++j)
        require(near(spatial(3 + i, 3 + j),
                     robot.inertia[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)]));
    }
  } catch (const ves::InputError& error) {
    std::fprintf(stderr, "%s\n%s\n", error.what(), robot.text.c_str());
    require(false);
  }
  return 0;
}
