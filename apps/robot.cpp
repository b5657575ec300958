// SPDX-License-Identifier: BSD-3-Clause
//
// ves robot: what a robot description holds, and what of it moves.
#include <fmt/format.h>

#include "app.hpp"
#include "commands.hpp"
#include "ves/config/urdf.hpp"
#include "ves/math/dense.hpp"

namespace ves::app {
namespace {

void printJoints(const UrdfRobot& robot, const JointVector& q) {
  const RobotModel& model = robot.model;
  for (int i = 0; i < model.joints; ++i) {
    const Link& link = model.jointLink(i);
    const double unit = jointUnit(link.type);
    const std::string range =
        std::isfinite(link.lower) || std::isfinite(link.upper)
            ? fmt::format("{:.6g} to {:.6g}", link.lower / unit, link.upper / unit)
            : "no limits";
    const std::string rate =
        std::isfinite(robot.fastest(i))
            ? fmt::format(", up to {:.4g} {}/s", robot.fastest(i) / unit, jointUnitName(link.type))
            : "";
    fmt::print("  {:>2}  {:<32} {:<24} {:<4} at {:.6g}{}\n", i + 1,
               robot.joint_names[static_cast<std::size_t>(i)], range, jointUnitName(link.type),
               q(i) / unit, rate);
  }
  for (const NamedFrame& frame : robot.frames) {
    if (frame.joint.empty()) continue;
    const Link& link = model.link(frame.link);
    const std::string& master = robot.joint_names[static_cast<std::size_t>(link.joint)];
    if (master != frame.joint)
      fmt::print("      {:<32} follows {}: {:.6g} of it, {:+.6g}\n", frame.joint, master,
                 link.ratio, link.offset);
  }
  for (const std::string& held : robot.held) fmt::print("      held: {}\n", held);
}

void printTree(const UrdfRobot& robot, const JointVector& q) {
  const LinkPoses X_L0L = linkPoses(robot.model, q);
  std::vector<int> depth;
  fmt::print("\n  {:<44}{:>10}{:>10}{:>10}   {}\n", "frame, and where it stands [m] in the first",
             "x", "y", "z", "moved by");
  for (const NamedFrame& f : robot.frames) {
    depth.push_back(f.parent < 0 ? 0 : depth[static_cast<std::size_t>(f.parent)] + 1);
    const Vec3 p = f.pose(X_L0L).p;
    fmt::print("  {:<44}{:>10.4f}{:>10.4f}{:>10.4f}   {}\n",
               std::string(static_cast<std::size_t>(std::min(depth.back(), 20)), ' ') + f.name,
               p.x(), p.y(), p.z(), f.joint);
  }
}

}  // namespace

int robotCommand(int argc, char** argv) {
  CLI::App cli(
      "A robot description as it is understood: which joints move, which are held or follow, mass, "
      "centre, moments, and every frame.",
      "ves robot");
  std::string file;
  std::vector<std::string> sets;
  cli.add_option("file", file, "a URDF, a robot's .yaml, or the name of one in config/robots")
      ->required();
  cli.add_option("--set", sets, "tip=LINK, joints=[..], lock.JOINT=VALUE (deg or m)")
      ->allow_extra_args(false);
  return run(cli, argc, argv, [&] {
    // A name alone is one of config/robots, as elsewhere.
    std::error_code error;
    const bool named =
        file.find_first_of("./") == std::string::npos && !std::filesystem::exists(file, error);
    const std::string found =
        named ? findFile("robot", file, configFolder() / "robots").string() : file;
    if (std::filesystem::path(found).extension() == ".yaml" && loadDocument(found).find("program"))
      throw InputError(fmt::format("{}: is a scenario, want its robot's file", found));
    const auto [described, robot, q] = loadRobot(found, sets);
    const RigidBody all = compositeBody(robot.model, q);
    const Vec3 moments = symmetricEigenvalues(all.I_Bcm_B);
    const Vec3& c = all.p_BoBcm_B;
    fmt::print("{}: {} of {} links move by {} joints\n\n", described, robot.model.size,
               robot.frames.size(), robot.model.joints);
    printJoints(robot, q);
    fmt::print(
        "\n  {:.6g} kg, centre at {:.4f}, {:.4f}, {:.4f} m in '{}', there {:.6g}, {:.6g}, {:.6g} "
        "kg m^2\n",
        all.mass, c.x(), c.y(), c.z(), robot.frames.front().name, moments(0), moments(1),
        moments(2));
    if (const NamedFrame* tool = robot.tool()) {
      const Transform X_L0T = tool->pose(linkPoses(robot.model, q));
      const Vec3 rpy = fixedAngles(X_L0T.R) / kDegree;
      fmt::print("  tool '{}' at {:.4f}, {:.4f}, {:.4f} m, turned by {:.3f}, {:.3f}, {:.3f} deg\n",
                 tool->name, X_L0T.p.x(), X_L0T.p.y(), X_L0T.p.z(), rpy.x(), rpy.y(), rpy.z());
    } else {
      fmt::print("  several ends, none of them the tool (tip: LINK would say which)\n");
    }
    printTree(robot, q);
    if (!robot.choice.empty()) fmt::print("\n  {}\n", robot.choice);
    for (const std::string& warning : robot.warnings) fmt::print("\n  warning: {}\n", warning);
    return kDone;
  });
}

}  // namespace ves::app
