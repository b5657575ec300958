// SPDX-License-Identifier: BSD-3-Clause
//
// urdf_count FILE...: what each description comes to, all joints held at 0, as a line of JSON: for
// tests/tools/urdf_files.py.
#include <fmt/format.h>

#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "ves/config/urdf.hpp"

int main(int argc, char** argv) {
  for (int i = 1; i < argc; ++i) {
    nlohmann::json out = {{"file", argv[i]}};
    std::ifstream in(argv[i], std::ios::binary);
    std::ostringstream text;
    text << in.rdbuf();
    try {
      const ves::UrdfTree tree(text.str(), argv[i]);
      const ves::UrdfRobot robot = tree.robot({});
      const ves::RigidBody& body = robot.model.base;
      const ves::Mat6 M = ves::spatialMass(body);
      out["links"] = robot.frames.size();
      std::vector<std::string> joints;
      for (const auto& joint : tree.joints()) joints.push_back(joint.name);
      out["joints"] = joints;
      out["mass"] = body.mass;
      const ves::Vec3 first = body.mass * body.p_BoBcm_B;
      out["moment"] = {first(0), first(1), first(2)};
      std::vector<double> I;
      for (int k = 0; k < 9; ++k) I.push_back(M(3 + k / 3, 3 + k % 3));
      out["inertia"] = I;
      out["warnings"] = robot.warnings;
    } catch (const ves::InputError& error) {
      out["refused"] = error.what();
    }
    std::cout << out.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) << "\n";
  }
}
