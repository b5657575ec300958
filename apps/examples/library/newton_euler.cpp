// SPDX-License-Identifier: BSD-3-Clause
//
// Newton-Euler of a URDF on a base that moves: newton_euler ROBOT.urdf
#include <cstdio>
#include <fstream>
#include <sstream>
#include <ves/config/urdf.hpp>
#include <ves/robot/newton_euler.hpp>

int main(int argc, char** argv) {
  if (argc != 2) return std::fprintf(stderr, "newton_euler ROBOT.urdf\n"), 2;
  std::stringstream text;
  text << std::ifstream(argv[1]).rdbuf();
  try {
    const ves::RobotModel robot = ves::loadUrdf(text.str(), argv[1]).model;

    ves::JointState joints;  // all at zero; the first turns
    joints.q_dot(0) = 0.5;   // [rad/s]
    joints.q_ddot(0) = 1.0;  // [rad/s^2]
    ves::ProperMotion base;  // of the robot's foot, in its own axes
    base.w = {0.0, 0.1, 0.0};
    for (const double lift : {0.0, 1.0}) {  // [m/s^2] upwards
      base.a = {0.0, 0.0, 9.81 + lift};     // less gravity
      const ves::InverseDynamics found = ves::newtonEuler(robot, joints, base);
      std::printf("foot lifted by %.0f m/s^2: %8.2f N, %8.2f N m about y;", lift,
                  found.F_L0o_L0.f.z(), found.F_L0o_L0.n.y());
      std::printf("  first joint %8.3f N m\n", found.tau(0));
    }
  } catch (const std::exception& error) {
    return std::fprintf(stderr, "newton_euler: %s\n", error.what()), 2;
  }
}
