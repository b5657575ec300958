// SPDX-License-Identifier: BSD-3-Clause
//
// check_tree URDF [TIP]: how far Newton-Euler is from KDL's tree solver, and from the rate of
// momentum, on that robot; joints that do not lead to the tip are held. Both relative;
// tests/tools/robots.py asks.
#include <fmt/format.h>

#include "support/trees.hpp"

int main(int argc, char** argv) {
  using namespace ves;
  if (argc < 2 || argc > 3) {
    fmt::print(stderr, "check_tree: want a URDF and, if need be, a tip\n");
    return 2;
  }
  try {
    const std::string text = test::readText(argv[1]);
    const UrdfTree tree(text, argv[1]);
    std::set<std::string> moving;
    std::map<std::string, double> held;
    if (argc == 3) moving = tree.jointsTo(argv[2]);
    for (const UrdfTree::Joint& joint : tree.joints()) {
      if (argc == 2) moving.insert(joint.name);
      if (!moving.count(joint.name)) held[joint.name] = std::clamp(0.0, joint.lower, joint.upper);
    }
    const UrdfRobot robot = tree.robot(moving);
    fmt::print("{:.1e} {:.1e}\n", test::offFromKdl(tree, text, robot, 1, held),
               test::offFromMomentum(robot.model, 1));
  } catch (const InputError& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 2;
  }
}
