// SPDX-License-Identifier: BSD-3-Clause
//
// The robots that a program's admittance control meets, for the gate to look at.
#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "ves/analysis/gate.hpp"
#include "ves/planning/moving_robot.hpp"

namespace ves {
namespace {

/// The robot of a program as its time goes on.
class ProgramTime {
 public:
  ProgramTime(const ControllerConfig& controller, const RobotTask& task)
      : controller_(controller),
        task_(task),
        robot_(carried(controller.payload), task.initial_joints),
        known_(robot_.model()) {
    const Compensation& c = controller.compensation;
    if (!c.learns_masses || controller.hand.link < -1) return;
    RobotModel weightless = known_;
    for (int i = -1; i < weightless.size; ++i) weightless.bodyOf(i) = {};
    hand_ =
        withLoad(weightless, controller.hand.link,
                 {Compensation::kMostInHand * c.hand_mass, controller.hand.p_LT_L, Mat3::Zero()});
  }

  /// Everything of a segment, one instant after the other; see(robot) at each.
  template <class See>
  void pass(int segment, const See& see) {
    constexpr int kInstants = 12;     // [-] along each motion
    std::set<std::int64_t> instants;  // [ns]
    std::vector<RobotEvent> events;
    for (const RobotEvent& event : task_.robot_events) {
      if (event.cue.segment != segment) continue;
      events.push_back(event);
      const double duration = durationOf(event.action);
      for (int k = 0; k <= kInstants; ++k)
        instants.insert(event.cue.after + std::llround(duration * 1e9 * k / kInstants));
    }
    std::vector<ToldLoad> told;
    for (int i = 0; i < controller_.told_loads.size; ++i) {
      const ToldLoad& load = controller_.told_loads.loads[static_cast<std::size_t>(i)];
      if (load.cue.segment != segment) continue;
      told.push_back(load);
      instants.insert(load.cue.after);
    }
    std::stable_sort(events.begin(), events.end(),
                     [](const auto& a, const auto& b) { return a.cue.after < b.cue.after; });
    auto next = events.begin();
    auto next_told = told.begin();
    for (const std::int64_t now : instants) {
      for (; next != events.end() && next->cue.after <= now; ++next)
        robot_.begin(next->action, origin_ + next->cue.after);
      for (; next_told != told.end() && next_told->cue.after <= now; ++next_told)
        known_ = withLoad(carried(controller_.payload), next_told->link, next_told->body);
      see(look(now));
    }
    if (!instants.empty()) origin_ += *instants.rbegin();  // all has come to rest
  }

  /// `now` [ns] of the segment.
  ProgramRobot look(std::int64_t now = 0) const {
    const JointVector q = robot_.at(origin_ + now).q;
    const auto locked = [&](const RobotModel& robot) {
      return combine(RigidBody{}, controller_.payload.X_PL0(), compositeBody(robot, q));
    };
    return {q, {locked(robot_.model()), locked(known_)}, hand_ ? locked(*hand_) : RigidBody()};
  }

 private:
  const ControllerConfig& controller_;
  const RobotTask& task_;
  MovingRobot robot_;
  RobotModel known_;
  std::optional<RobotModel> hand_;  // its load and nothing else
  std::int64_t origin_ = 0;         // [ns] start of the segment
};

bool near(const RigidBody& a, const RigidBody& b) {
  constexpr double kSame = 1e-9;  // [kg, kg m^2] and [m]: no loop differs by it
  return std::abs(a.mass - b.mass) < kSame && (a.p_BoBcm_B - b.p_BoBcm_B).norm() < kSame &&
         (a.I_Bcm_B - b.I_Bcm_B).norm() < kSame;
}

bool near(const ProgramRobot& a, const ProgramRobot& b) {
  return (a.q - b.q).norm() < 1e-9 && near(a.body.robot_P, b.body.robot_P) &&
         near(a.body.known_P, b.body.known_P) && near(a.in_hand, b.in_hand);
}

}  // namespace

std::vector<ProgramRobot> programRobots(const ControllerConfig& controller, const RobotTask& task) {
  const Program& program = controller.program;
  const auto felt = [&](int i) {
    return i < program.size &&
           program.segments[static_cast<std::size_t>(i)].kind == SegmentKind::kAdmittance;
  };
  ProgramTime time(controller, task);
  std::vector<ProgramRobot> out = {time.look()};
  // A motion that is made again is looked at once.
  const auto add = [&](const ProgramRobot& robot) {
    const auto known = [&](const ProgramRobot& one) { return near(one, robot); };
    if (std::none_of(out.begin(), out.end(), known)) out.push_back(robot);
  };
  for (int i = 0; i < program.size; ++i) {
    if (felt(i)) add(time.look());
    time.pass(i, [&](const ProgramRobot& robot) {
      if (felt(i) || felt(i + 1)) add(robot);  // a motion may outlast its segment
    });
  }
  return out;
}

}  // namespace ves
