// SPDX-License-Identifier: BSD-3-Clause
//
// The functions of the Python package `ves`, as C++ has them. Arrays arrive checked: shapes, finite
// numbers, names and units are the business of ves/__init__.py, which documents them.
#include <fmt/format.h>
#include <filesystem>

#include <pybind11/complex.h>
#include <pybind11/eigen.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "ves/analysis/appendix_e.hpp"
#include "ves/analysis/gate.hpp"
#include "ves/config/base.hpp"
#include "ves/config/experiment.hpp"
#include "ves/config/platform.hpp"
#include "ves/control/gravity_compensation.hpp"
#include "ves/core/build.hpp"
#include "ves/math/second_order.hpp"
#include "ves/robot/newton_euler.hpp"
#include "ves/series/series.hpp"
#include "ves/srms/interaction.hpp"
#include "ves/srms/modes.hpp"

namespace py = pybind11;

namespace ves {
namespace {

using Joints = Eigen::Matrix<double, 6, 3, Eigen::RowMajor>;
using Strings = std::vector<std::string>;
using Path = std::filesystem::path;

Joints stacked(const std::array<Vec3, kLegs>& joints) {
  Joints out;
  for (int i = 0; i < kLegs; ++i) out.row(i) = joints[static_cast<std::size_t>(i)];
  return out;
}

Geometry geometryOf(const Joints& base, const Joints& platform, double home_height) {
  Geometry g;
  for (int i = 0; i < kLegs; ++i) {
    g.p_IBi_I[static_cast<std::size_t>(i)] = base.row(i);
    g.p_PPi_P[static_cast<std::size_t>(i)] = platform.row(i);
  }
  g.home_height = home_height;
  return g;
}

JointVector padded(const Eigen::VectorXd& q) {
  JointVector out = JointVector::Zero();
  out.head(q.size()) = q;
  return out;
}

Eigen::Matrix4d homogeneous(const Transform& X) {
  Eigen::Matrix4d out = Eigen::Matrix4d::Identity();
  out.topLeftCorner<3, 3>() = X.R;
  out.topRightCorner<3, 1>() = X.p;
  return out;
}

Vec6 forwardPoseOf(const Geometry& g, const Vec6& L, const Vec6& guess) {
  const ForwardSolution found = forwardPose(g, L, g.fromHome(Pose::from(guess)));
  if (!found.ok())
    throw InputError(
        fmt::format("lengths: no pose found near the guess ({}; {:.3g} m off after {} steps)",
                    found.status == SolveStatus::kSingular  ? "the platform is singular on the way"
                    : found.status == SolveStatus::kInvalid ? "a length is not positive"
                                                            : "it does not converge",
                    found.residual, found.iterations));
  return g.toHome(found.X_IP).stacked();
}

py::tuple legMotionOf(const Geometry& g, const Vec6& pose, const Vec6& rates,
                      const Vec6& accelerations) {
  const LegMotion legs = legMotion(g, bodyMotion(g.home(), Pose::from(pose), rates, accelerations));
  return py::make_tuple(legs.L, legs.L_dot, legs.L_ddot);
}

py::tuple forwardMotionOf(const Geometry& g, const Vec6& pose, const Vec6& L_dot,
                          const Vec6& L_ddot) {
  const Transform X_IP = g.fromHome(Pose::from(pose));
  BodyMotion P;
  if (!forwardMotion(g, X_IP, {legLengths(g, X_IP), L_dot, L_ddot}, P))
    throw InputError("pose: the platform is singular there");
  return py::make_tuple((Vec6() << P.v, P.w).finished(), (Vec6() << P.a, P.alpha).finished());
}

py::tuple packedBody(const RigidBody& b) { return py::make_tuple(b.mass, b.p_BoBcm_B, b.I_Bcm_B); }
RigidBody body(const py::handle& h) {
  const auto t = h.cast<py::tuple>();
  return {t[0].cast<double>(), t[1].cast<Vec3>(), t[2].cast<Mat3>()};
}

/// What pickle keeps of a robot.
py::tuple packed(const RobotModel& robot) {
  py::list links;
  for (int i = 0; i < robot.size; ++i) {
    const Link& l = robot.link(i);
    links.append(py::make_tuple(l.type == JointType::kRevolute, l.parent, l.joint, l.ratio,
                                l.offset, l.X_parent.R, l.X_parent.p, l.axis, l.lower, l.upper,
                                packedBody(l.body),
                                robot.own[static_cast<std::size_t>(l.joint)] != i));
  }
  return py::make_tuple(packedBody(robot.base), links);
}

RobotModel unpacked(const py::tuple& state) {
  RobotModel robot;
  robot.base = body(state[0]);
  for (const py::handle one : state[1].cast<py::list>()) {
    const auto t = one.cast<py::tuple>();
    Link l;
    l.type = t[0].cast<bool>() ? JointType::kRevolute : JointType::kPrismatic;
    l.parent = t[1].cast<int>();
    l.joint = t[2].cast<int>();
    l.ratio = t[3].cast<double>();
    l.offset = t[4].cast<double>();
    l.X_parent = {t[5].cast<Mat3>(), t[6].cast<Vec3>()};
    l.axis = t[7].cast<Vec3>();
    l.lower = t[8].cast<double>();
    l.upper = t[9].cast<double>();
    l.body = body(t[10]);
    robot.add(l, t[11].cast<bool>());
  }
  return robot;
}

Mat6 jacobianOf(const Geometry& g, const Vec6& pose) {
  Mat6 J;
  const Transform X_IP = g.fromHome(Pose::from(pose));
  for (int i = 0; i < kLegs; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const Vec3 r = X_IP.R * g.p_PPi_P[k], leg = (X_IP.p + r - g.p_IBi_I[k]).normalized();
    J.row(i) << leg.transpose(), r.cross(leg).transpose();
  }
  return J;
}

py::tuple newtonEulerOf(const RobotModel& robot, const Eigen::VectorXd& q,
                        const Eigen::VectorXd& q_dot, const Eigen::VectorXd& q_ddot, const Vec3& w,
                        const Vec3& alpha, const Vec3& a) {
  const InverseDynamics found =
      newtonEuler(robot, {padded(q), padded(q_dot), padded(q_ddot)}, {w, alpha, a});
  return py::make_tuple(found.F_L0o_L0.stacked(), Eigen::VectorXd(found.tau.head(robot.joints)));
}

py::tuple compositeBodyOf(const RobotModel& robot, const Eigen::VectorXd& q) {
  const RigidBody body = compositeBody(robot, padded(q));
  return py::make_tuple(body.mass, body.p_BoBcm_B, body.I_Bcm_B);
}

Vec6 gravityWrenchOf(const RobotModel& robot, const Eigen::VectorXd& q, const Mat3& R,
                     double gravity) {
  Payload payload;
  payload.robot = robot;
  return staticWrench(payload, padded(q), R, Vec3(0.0, 0.0, -gravity)).stacked();
}

std::vector<Eigen::Matrix4d> linkPosesOf(const RobotModel& robot, const Eigen::VectorXd& q) {
  const LinkPoses X_L0L = linkPoses(robot, padded(q));
  std::vector<Eigen::Matrix4d> out;
  for (int i = 0; i < robot.size; ++i) out.push_back(homogeneous(X_L0L[i]));
  return out;
}

py::tuple admittanceStep(const ModalModel& base, const Eigen::VectorXd& eta,
                         const Eigen::VectorXd& eta_dot, const Vec6& wrench, double dt) {
  const ModalHold hold = modalHold(base, dt);
  const Eigen::Index k = eta.size();
  Eigen::VectorXd state(2 * k);
  state << eta, eta_dot;
  const Eigen::VectorXd next = hold.Phi * state + hold.Gamma * (base.Phi.transpose() * wrench);
  return py::make_tuple(Eigen::VectorXd(next.head(k)), Eigen::VectorXd(next.tail(k)));
}

py::dict loopRoot(const Path& file, const Strings& overrides, const std::string& direction) {
  const Experiment e = loadExperiment(file, overrides);
  const DominantRoot root =
      dominantRoot(loopOf(e.controller, e.plant.task.initial_joints,
                          direction == "extending"    ? Direction::kExtending
                          : direction == "retracting" ? Direction::kRetracting
                                                      : Direction::kSwinging));
  py::dict out;
  out["radius"] = root.radius;
  out["growth"] = root.growth;
  out["frequency"] = root.frequency;
  out["shape"] = root.shape;
  return out;
}

py::dict loopMargins(const Path& file, const Strings& overrides) {
  const Experiment e = loadExperiment(file, overrides);
  const LoopVerdict verdict = assessStability(e.controller, e.plant.task);
  py::dict out;
  out["stable"] = verdict.stable;
  out["why"] = verdict.stable ? "" : explain(verdict);
  if (!verdict.stable) return out;
  Margins least{HUGE_VAL, HUGE_VAL, HUGE_VAL, HUGE_VAL, Margins::kMostDelay};
  for (const Direction direction : directionsOf(e.controller)) {
    const Margins m = margins(verdict.at(direction));
    least = {std::min(least.gain, m.gain), std::min(least.servo_gain, m.servo_gain),
             std::min(least.early, m.early), std::min(least.late, m.late),
             std::min(least.delay, m.delay)};
  }
  out["inertia"] = least.gain;
  out["servo_gain"] = least.servo_gain;
  out["early"] = least.early;
  out["late"] = least.late;
  out["delay"] = least.delay;
  return out;
}

py::tuple simulateBase(const Path& file, const Strings& overrides, const std::string& model) {
  const Experiment e = loadExperiment(file, overrides);
  InteractionOptions options;
  const Interaction interaction = interactionOf(e, options.duration);
  options.model = model == "whole" ? InteractionModel::kWhole : InteractionModel::kSplit;
  const std::vector<InteractionPoint> points = simulate(interaction, options);
  Eigen::VectorXd t(points.size());
  Eigen::MatrixXd x(points.size(), 6);
  for (std::size_t i = 0; i < points.size(); ++i) {
    t(static_cast<Eigen::Index>(i)) = points[i].t;
    x.row(static_cast<Eigen::Index>(i)) = points[i].x;
  }
  return py::make_tuple(t, x);
}

/// Column by column, and how it ended.
py::tuple runOf(const Path& file, const Strings& overrides) {
  Experiment e = loadExperiment(file, overrides);
  requireStability(e);
  RecordedRun recorded;
  {
    const py::gil_scoped_release others;
    recorded = recordLockstep(e);
  }
  const std::vector<Row>& rows = recorded.series.rows;
  py::dict out;
  for (const Column& column : columns(e)) {
    Eigen::VectorXd values(rows.size());
    for (std::size_t i = 0; i < rows.size(); ++i)
      values(static_cast<Eigen::Index>(i)) = column.value(rows[i]);
    out[column.name.c_str()] = values;
  }
  const RunResult& result = recorded.result;
  return py::make_tuple(out, std::string(name(result.phase)),
                        result.cause == Check::kCount ? "" : std::string(name(result.cause)));
}

}  // namespace
}  // namespace ves

PYBIND11_MODULE(_core, m) {
  using namespace ves;
  m.attr("version") = describeBuild();
  m.attr("takes_numpy_2") = PYBIND11_VERSION_HEX >= 0x020C0000;
  // Of the checkout that it was built in, or as it is installed.
  const bool built_here = std::filesystem::exists(VES_PYTHON_CONFIG "/ves.yaml");
  m.attr("config") = built_here ? VES_PYTHON_CONFIG : "/usr/share/ves/config";
  py::register_exception<InputError>(m, "InputError", PyExc_ValueError);

  py::class_<Geometry>(m, "Geometry")
      .def(py::init(&geometryOf))
      .def(py::pickle(
          [](const Geometry& g) {
            return py::make_tuple(stacked(g.p_IBi_I), stacked(g.p_PPi_P), g.home_height);
          },
          [](const py::tuple& t) {
            return geometryOf(t[0].cast<Joints>(), t[1].cast<Joints>(), t[2].cast<double>());
          }))
      .def_property_readonly("base_joints", [](const Geometry& g) { return stacked(g.p_IBi_I); })
      .def_property_readonly("platform_joints",
                             [](const Geometry& g) { return stacked(g.p_PPi_P); })
      .def_readonly("home_height", &Geometry::home_height);
  py::class_<RobotModel>(m, "RobotModel")
      .def(py::pickle(&packed, &unpacked))
      .def_readonly("joints", &RobotModel::joints)
      .def_readonly("links", &RobotModel::size);
  py::class_<ModalModel>(m, "ModalModel")
      .def(py::pickle(
          [](const ModalModel& b) { return py::make_tuple(b.Phi, b.stiffness, b.damping); },
          [](const py::tuple& t) {
            ModalModel b;
            b.Phi = t[0].cast<Eigen::MatrixXd>();
            b.stiffness = t[1].cast<Eigen::VectorXd>();
            b.damping = t[2].cast<Eigen::MatrixXd>();
            return b;
          }))
      .def_readonly("shapes", &ModalModel::Phi)
      .def_readonly("stiffness", &ModalModel::stiffness)
      .def_readonly("damping", &ModalModel::damping);

  m.def("rotation", [](const Vec3& angles) { return rotation(angles); });
  m.def("fixed_angles", [](const Mat3& R) { return fixedAngles(R); });
  m.def("angle_rate_map", [](const Vec3& angles) { return angleRateMap(angles); });
  m.def("load_platform", [](const std::string& name, const Path& config, const Strings& set) {
    return loadPlatform(findPlatform(name, config), set).geometry;
  });
  m.def("leg_lengths", [](const Geometry& g, const Vec6& pose) {
    return legLengths(g, g.fromHome(Pose::from(pose)));
  });
  m.def("leg_motion", &legMotionOf);
  m.def("forward_pose", &forwardPoseOf);
  m.def("forward_motion", &forwardMotionOf);
  m.def("jacobian", &jacobianOf);
  m.def("condition_number", [](const Geometry& g, const Vec6& pose) {
    return conditionNumber(g, g.fromHome(Pose::from(pose)));
  });
  m.def("load_robot", [](const std::string& name, const Path& config, const Strings& set) {
    const bool file = Path(name).has_extension() || std::filesystem::is_regular_file(name);
    const LoadedRobot loaded =
        loadRobot(file ? name : findFile("robot", name, config / "robots").string(), set);
    return py::make_tuple(loaded.robot.model, loaded.robot.joint_names,
                          Eigen::VectorXd(loaded.q.head(loaded.robot.model.joints)));
  });
  m.def("link_poses", &linkPosesOf);
  m.def("newton_euler", &newtonEulerOf);
  m.def("composite_body", &compositeBodyOf);
  m.def("gravity_wrench", &gravityWrenchOf);
  m.def("load_base", [](const std::string& name, const Path& config, const Strings& set) {
    return linearised(loadBase(findBase(name, config), set).vehicle);
  });
  m.def("modes", &modesOf);
  m.def("admittance_step", &admittanceStep);
  m.def("second_order_hold", [](double k, double c, double dt) {
    const SecondOrderHold hold = discretise(k, c, dt);
    return py::make_tuple(hold.Phi, hold.Gamma);
  });
  m.def("appendix_e_roots", [](double mass_ratio, double frequency_ratio, double damping_ratio) {
    const auto z = roots({mass_ratio, frequency_ratio, damping_ratio});
    return Eigen::Vector3cd(z[0], z[1], z[2]);
  });
  m.def("find_scenario",
        [](const std::string& name, const Path& config) { return findScenario(name, config); });
  m.def("loop_root", &loopRoot);
  m.def("loop_margins", &loopMargins);
  m.def("simulate_base", &simulateBase);
  m.def("run", &runOf);
}
