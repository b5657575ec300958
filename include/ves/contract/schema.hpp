// SPDX-License-Identifier: BSD-3-Clause
//
// The one description of what travels: every field of sample, command, setup and state with its
// name, unit, meaning, and the member that it comes from. Out of it come the messages' definitions
// (.lcm), the conversions both ways (bus/messages.hpp), the columns of series.csv and the table of
// the documentation. Size and type follow from the member.
//
// A new field: a member of the struct, a line here, and its number below, without which nothing
// compiles.
#pragma once

#include <concepts>

#include "ves/contract/members.hpp"
#include "ves/contract/order.hpp"
#include "ves/contract/setup.hpp"
#include "ves/contract/tick_state.hpp"

namespace ves::schema {

/// What the values of a list are named after. `unit` of coordinates and wrenches is two units.
enum class Along {
  kOne,
  kCoordinates,
  kWrench,
  kChannels,
  kLegs,
  kJoints,
  kBodies,
  kBodyAxes,
  kAxes,
  kTurn,  // a rotation matrix, row by row
  kThrusters,
  kNumbers
};

template <typename T>
struct Field {
  const char* name;  // in the message
  const char* unit;
  T& value;
  const char* meaning;
  Along along = Along::kOne;
  const char* column = "";  // what a list is called in series.csv: "x_COLUMN_m"; empty: none
};
template <typename T, typename... Rest>
Field(const char*, const char*, T&, const char*, Rest...) -> Field<T>;

/// What stands above a message's fields.
struct Message {
  const char* name;
  const char* about;
};
template <typename T>
inline constexpr Message kMessage{};

template <typename S, typename T>
concept Of = std::same_as<std::remove_const_t<S>, T>;

template <>
inline constexpr Message kMessage<Sample>{
    "sample_t", "Machine -> controller: all the controller may know. Channel VES_SAMPLE."};

/// Calls f(field...) with all of them at once; header: sequence and time.
template <Of<Sample> S>
constexpr void fields(S& s, auto&& f) {
  using enum Along;
  f(Field{"answers", "-", s.answers,
          "lockstep: tick of the command that this answers, -1 before the first"},
    Field{"adc", "count", s.adc,
          "six wrench channels in {S} order Fx Fy Fz Mx My Mz, then pressure", kNumbers},
    Field{"legs", "count", s.legs, "Temposonics, 0 to 16383", kLegs},
    Field{"switches", "-", s.switches,
          "bit 0 panic button loop closed, bit 1 floor mat loop closed, bit 2 gripper closed"},
    Field{"q", "rad | m", s.q, "robot joints, base to tip; unused ones 0", kJoints},
    Field{"temperature", "C", s.temperature,
          "of the laboratory, by a thermometer beside the sensor"},
    Field{"legs_time_ns", "ns", s.legs_time,
          "when the legs were read, by the clock of header.time_ns; 0: just then"},
    Field{"wrench_time_ns", "ns", s.wrench_time, "when adc[0..5] were"},
    Field{"joints_time_ns", "ns", s.joints_time, "when q was"},
    Field{"faults", "-", s.faults,
          "who says of itself that it is at fault: bit 0 legs, 1 force sensor, 2 robot"},
    Field{"command_source", "-", s.command_source,
          "the last command that came: its header.source; 0: none yet"},
    Field{"command_sequence", "-", s.command_tick, "its header.sequence"},
    Field{"command_time_ns", "ns", s.command_time, "when it came, by the machine's clock"},
    Field{"robot_orders_taken", "-", s.robot_orders_taken,
          "orders to the simulated robot that have begun, since the machine did"},
    Field{"robot_orders_refused", "-", s.robot_orders_refused, "and those that never will"});
}

template <>
inline constexpr Message kMessage<LegCommand>{
    "leg_command_t", "Controller -> LegSlaves, once a tick. Channel VES_LEG_COMMAND."};

template <Of<LegCommand> S>
constexpr void fields(S& s, auto&& f) {
  using enum Along;
  f(Field{"machine", "-", s.machine,
          "header.source of the machine that is meant; 0: whoever hears it"},
    Field{"engaged", "-", s.engaged, "0: the legs stay where they are and ignore the counts"},
    Field{"segment", "-", s.segment,
          "where the controller's program is, -1 before it; others take their cue from it"},
    Field{"park", "-", s.park, "1: should no command follow, go home slowly; 0: stay"},
    Field{"counts", "count", s.counts,
          "reference leg length, eq. (C.13); ahead of `rest` where the servos' lag is taken out",
          kLegs},
    Field{"rest", "count", s.rest,
          "the checked lengths: where the legs rest should no command follow", kLegs},
    Field{"ahead_ns", "ns", s.ahead,
          "after its tick, for which these are meant: 0, or a period in admittance control"},
    Field{"laboratory_time_ns", "ns", s.laboratory.time,
          "by the machine's clock, for which what follows is meant; 0: the vehicle is emulated in "
          "{I}"},
    Field{"laboratory_p", "m", s.laboratory.E_H.X.p,
          "of home in {E}, the frame that the vehicle is emulated in, from {E}'s own home",
          kNumbers},
    Field{"laboratory_R", "-", s.laboratory.E_H.X.R,
          "row by row: turns coordinates of {I} into those of {E}", kNumbers},
    Field{"laboratory_v", "m/s", s.laboratory.E_H.v, "of home through {E}, in its axes", kNumbers},
    Field{"laboratory_w", "rad/s", s.laboratory.E_H.w, "the same", kNumbers},
    Field{"laboratory_a", "m/s^2", s.laboratory.E_H.a, "the same", kNumbers},
    Field{"laboratory_alpha", "rad/s^2", s.laboratory.E_H.alpha, "the same", kNumbers});
}

template <>
inline constexpr Message kMessage<Order>{
    "operator_t",
    "Operator -> controller. Channel VES_OPERATOR. Of what follows `request` only what is its own "
    "counts."};

/// header: source and sequence are `id`.
template <Of<Order> S>
constexpr void fields(S& s, auto&& f) {
  using enum Along;
  auto& segment = s.segment;
  auto& trajectory = segment.trajectory;
  f(Field{"controller", "-", s.controller,
          "header.source of its state_t: an order to another one, or an old log's, is not taken"},
    Field{"request", "-", s.request, ""}, Field{"kind", "-", segment.kind, "what to run"},
    Field{"duration", "s", segment.duration, "of a move: 0 for as long as is gentle"},
    Field{"interval", "s", segment.interval, "of a monitor segment"},
    Field{"target", "m, rad", segment.target, "of a move, from home", kCoordinates},
    Field{"motion", "-", trajectory.motion, "of a trajectory's coordinates", kCoordinates},
    Field{"final", "m, rad", trajectory.final, "of a ramp, from home", kCoordinates},
    Field{"amplitude", "m, rad", trajectory.amplitude, "of a sine", kCoordinates},
    Field{"frequency", "Hz", trajectory.frequency, "of a sine", kCoordinates},
    Field{"vehicle_mass", "-", s.vehicle.to.mass,
          "of a vehicle: times the configured one's; 0: stays"},
    Field{"vehicle_damping", "-", s.vehicle.to.damping, "the same"},
    Field{"vehicle_stiffness", "-", s.vehicle.to.stiffness, "the same"},
    Field{"vehicle_over", "s", s.vehicle.over, "that the change takes"},
    Field{"thrust", "s", s.thrust,
          "of thrust: how long each thruster of the vehicle is on from now on; 0: as it was",
          kNumbers});
}

template <>
inline constexpr Message kMessage<MachineSetup>{
    "setup_t",
    "Controller -> machine: what a driver of legs, sensor or robot has to know of the "
    "configuration. Channel VES_SETUP, behind every VES_EXPERIMENT. docs/machine.md."};

template <Of<MachineSetup> S>
constexpr void fields(S& s, auto&& f) {
  using enum Along;
  f(Field{"period_ns", "ns", s.period, "of the controller's ticks"},
    Field{"lockstep", "-", s.lockstep, "1: one sample for each command"},
    Field{"arming_samples", "-", s.arming_samples,
          "it arms after more ticks in a row than these, each with a fresh sample"},
    Field{"stale_ticks", "-", s.stale_ticks, "so many without one stop it"},
    Field{"leg_offset", "m", s.legs.offset, "length at count 0", kLegs},
    Field{"leg_scale", "m/count", s.legs.scale, "", kLegs},
    Field{"leg_min", "count", s.leg_min, "shortest that it commands", kLegs},
    Field{"leg_max", "count", s.leg_max, "longest that it commands", kLegs},
    Field{"leg_home", "count", s.leg_home, "at home", kLegs},
    Field{"leg_velocity", "m/s", s.leg_velocity, "fastest that it commands"},
    Field{"wrench_per_count", "N | N m per count", s.wrench_per_count,
          "row by row: the wrench in {S} is this times (adc - bias), (C.1)", kNumbers},
    Field{"wrench_window_ns", "ns", s.wrench_window,
          "before wrench_time_ns over which adc[0..5] is to be the mean; 0: one reading"},
    Field{"pressure_min", "count", s.pressure_min, "least that adc[6] may read"},
    Field{"pressure_max", "count", s.pressure_max, "most that adc[6] may read"},
    Field{"joints", "-", s.joints, "of the robot: so many values of q count"},
    Field{"joint_min", "rad | m", s.joint_min, "", kJoints},
    Field{"joint_max", "rad | m", s.joint_max, "", kJoints},
    Field{"hold_after_ns", "ns", s.watchdog.hold_after,
          "without a command, after which the legs go to the last one's `rest`"},
    Field{"park_after_ns", "ns", s.watchdog.park_after,
          "without a command, after which the legs go home if the last one let them"},
    Field{"park_time_ns", "ns", s.watchdog.park_time, "that they take for it"});
}

template <>
inline constexpr Message kMessage<TickState>{
    "state_t",
    "Everything one tick of the controller knew and decided; a pure function of its inputs, all of "
    "which it names. Channel VES_STATE."};

/// header: sequence is the tick.
template <Of<TickState> S>
constexpr void fields(S& s, auto&& f) {
  using enum Along;
  f(Field{"count", "-", s.count,
          "ticks of this controller before this one; header.sequence skips missed ones"},
    Field{"machine_time_ns", "ns", s.time, "when this tick began, by the machine's clock"},
    Field{"sample_sequence", "-", s.sample_sequence, "header.sequence of the sample_t used"},
    Field{"request", "-", s.request, "operator's request used in this tick"},
    Field{"request_source", "-", s.request_id.source, "header.source of its operator_t"},
    Field{"request_sequence", "-", s.request_id.sequence,
          "header.sequence of its operator_t; -1: given without one"},
    Field{"order_source", "-", s.order.source,
          "header.source of the order that is answered, this tick's or before"},
    Field{"order_sequence", "-", s.order.sequence, "its header.sequence"},
    Field{"refusal", "-", s.refusal, "why that was not taken"},
    Field{"refused_by", "-", s.refused_by, "the check that its path would fail"},
    Field{"conflicting_node", "-", s.conflicting_node,
          "another controller's engaged command, or another machine, was heard"},
    Field{"phase", "-", s.phase, "of the controller"},
    Field{"segment", "-", s.segment, "of the program, -1 outside it"},
    Field{"kind", "-", s.kind, "of the segment that runs"},
    Field{"idle", "-", s.idle, "ticks to come of which nothing is expected"},
    Field{"age", "-", s.age, "ticks since the last fresh sample"},
    Field{"total", "N, N m", s.total, "measured wrench about Po in {I}", kWrench, "total"},
    Field{"static_wrench", "N, N m", s.static_wrench, "of gravity, same point and axes", kWrench,
          "static"},
    Field{"inertial", "N, N m", s.inertial,
          "rate of the momentum of the robot with its joints locked; 0 as published", kWrench,
          "inertial"},
    Field{"reaction", "N, N m", s.reaction,
          "minus the rate of the joints' modelled momentum; 0 unless the wrench is aided", kWrench,
          "reaction"},
    Field{"withholds", "-", s.withholds,
          "1: what differs from that is withheld as noise; dynamic is reaction and, where a small "
          "force "
          "lasts, its mean"},
    Field{"learnt_mass", "kg", s.learnt.mass,
          "of the heaviest bodies and of what is in hand, in use; 0 unless masses are learnt",
          kBodies, "learnt_mass"},
    Field{"learnt_mass_deviation", "kg", s.learnt.mass_deviation, "of that, standard", kBodies,
          "learnt_mass_deviation"},
    Field{"learnt_moment", "kg m", s.learnt.moment,
          "first moment x y z of each about its link's origin, of the last about the hand",
          kBodyAxes, "learnt_moment"},
    Field{"learnt_moment_deviation", "kg m", s.learnt.moment_deviation, "of that, standard",
          kBodyAxes, "learnt_moment_deviation"},
    Field{"dynamic", "N, N m", s.dynamic,
          "total - static_wrench + inertial, behind dead band and low-pass: input of the "
          "admittance model, in the axes that it is emulated in",
          kWrench, "dynamic"},
    Field{"x", "m, rad", s.motion.x, "commanded x y z alpha beta gamma from home", kCoordinates,
          "commanded"},
    Field{"x_dot", "m/s, rad/s", s.motion.x_dot, "its rates", kCoordinates, "commanded_rate"},
    Field{"x_ddot", "m/s^2, rad/s^2", s.motion.x_ddot, "its accelerations", kCoordinates,
          "commanded_acceleration"},
    Field{"x_desired", "m, rad", s.desired, "where the platform should be at this very tick",
          kCoordinates, "desired"},
    Field{"leg", "m", s.legs.L, "commanded lengths", kLegs, "commanded"},
    Field{"leg_dot", "m/s", s.legs.L_dot, "their rates", kLegs, "commanded_rate"},
    Field{"leg_ddot", "m/s^2", s.legs.L_ddot, "their accelerations", kLegs,
          "commanded_acceleration"},
    Field{"compensation_share", "-", s.compensation_share,
          "share of the compensation that is in; 0 as published"},
    Field{"reference", "m", s.reference,
          "what the servos are told; as published: the commanded lengths", kLegs, "reference"},
    Field{"gain_extend", "1/s", s.servo.extend, "of the servo model in use, legs that extend",
          kLegs, "gain_extend"},
    Field{"gain_retract", "1/s", s.servo.retract, "and that retract", kLegs, "gain_retract"},
    Field{"servo_delay", "s", s.servo.delay, "until a command takes effect", kLegs, "servo_delay"},
    Field{"leg_measured", "m", s.L_measured, "by the transducers", kLegs, "measured"},
    Field{"x_measured", "m, rad", s.measured, "from home, by forward kinematics of leg_measured",
          kCoordinates, "measured"},
    Field{"bias", "count", s.bias, "of the sensor", kChannels, "bias"},
    Field{"calibration", "-", s.calibration, "the last one"},
    Field{"violation", "-", s.violation, "what it last saw moving"},
    Field{"violation_index", "-", s.violation_index, "which, from 0"},
    Field{"violation_amount", "count | rad | m", s.violation_amount, "by how much"},
    Field{"deviation", "count", s.deviation, "standard deviation of its samples", kChannels,
          "deviation"},
    Field{"standard_error", "count", s.standard_error, "of the bias it found", kChannels,
          "standard_error"},
    Field{"tripped", "-", s.tripped, "set of safety checks failing in this tick"},
    Field{"latched", "-", s.latched, "set of those that failed since the start, armed"},
    Field{"cause", "-", s.cause, "the check that stopped the run"},
    Field{"cause_tick", "-", s.cause_tick, "its tick, -1: none"},
    Field{"aborted", "-", s.aborted,
          "1: the program went home early, a calibration or a start was refused"},
    Field{"aborted_by", "-", s.aborted_by, "why the start was; 0: it was a calibration"},
    Field{"envelope_scale", "-", s.envelope_scale,
          "share of the admittance model's step that was taken, 1: all"},
    Field{"energy_put_in", "J", s.energy_put_in,
          "by the emulation since admittance control began (control/energy_account.hpp)"},
    Field{"energy_paid", "J", s.energy_paid, "by the model's modes, to the passivity controller"},
    Field{"passivity_damping", "1/s", s.passivity_damping, "of every mode, in the next step"},
    Field{"late_ticks", "-", s.late_ticks, "ticks that came late so far"},
    Field{"engaged", "-", s.command.engaged, "the command, as in leg_command_t"},
    Field{"park", "-", s.command.park, "the same"},
    Field{"counts", "count", s.command.counts, "the same", kLegs, "command"},
    Field{"rest", "count", s.command.rest, "the same", kLegs, "rest"},
    Field{"ahead_ns", "ns", s.command.ahead,
          "after this tick, for which x, leg and rest are meant"},
    Field{"laboratory_time_ns", "ns", s.command.laboratory.time, "as in leg_command_t"},
    Field{"laboratory_p", "m", s.command.laboratory.E_H.X.p, "the same", kAxes, "laboratory"},
    Field{"laboratory_R", "-", s.command.laboratory.E_H.X.R, "the same", kTurn, "laboratory"},
    Field{"laboratory_v", "m/s", s.command.laboratory.E_H.v, "the same", kAxes, "laboratory_rate"},
    Field{"laboratory_w", "rad/s", s.command.laboratory.E_H.w, "the same", kAxes,
          "laboratory_rate"},
    Field{"laboratory_a", "m/s^2", s.command.laboratory.E_H.a, "the same", kAxes,
          "laboratory_acceleration"},
    Field{"laboratory_alpha", "rad/s^2", s.command.laboratory.E_H.alpha, "the same", kAxes,
          "laboratory_acceleration"},
    Field{"request_stability", "-", s.request_verdict.compensated,
          "of a request for another vehicle: what the stability check says of it"},
    Field{"request_stability_uncompensated", "-", s.request_verdict.uncompensated,
          "the same with the compensation out"},
    Field{"vehicle_mass", "-", s.vehicle.mass, "of the vehicle in use, times the configured"},
    Field{"vehicle_damping", "-", s.vehicle.damping, "the same"},
    Field{"vehicle_stiffness", "-", s.vehicle.stiffness, "the same"},
    Field{"vehicle_mass_ordered", "-", s.vehicle_ordered.mass, "where that goes, as ordered last"},
    Field{"vehicle_damping_ordered", "-", s.vehicle_ordered.damping, "the same"},
    Field{"vehicle_stiffness_ordered", "-", s.vehicle_ordered.stiffness, "the same"},
    Field{"vehicle_energy", "J", s.vehicle_energy,
          "that the last change of the vehicle has put in, less what was taken for it"},
    Field{"vehicle_time", "s", s.thrust.time,
          "since it was let go, from which this tick's step goes on; of one that floats"},
    Field{"thrust_left", "s", s.thrust.left,
          "that each of its thrusters is on from then, by orders", kThrusters, "left"},
    Field{"thrusters_on", "-", s.thrust.on,
          "bit i: thruster i is on in the step; bit 16, 17, 18: couples about x, y, z are, "
          "which hold its attitude"});
}

static_assert(members<Sample>() == 17 && members<LegCommand>() == 8 &&
                  members<MachineSetup>() == 17 && members<TickState>() == 54 &&
                  members<Order>() == 7 && members<VehicleOrder>() == 2 &&
                  members<VehicleFactors>() == 3 && members<VehicleVerdict>() == 2 &&
                  members<Thrust>() == 3 && members<Segment>() == 5 && members<Trajectory>() == 4,
              "a member has come or gone: describe it above, and count it here");

/// f(field) of each.
template <typename S, typename F>
constexpr void forEach(S& s, F f) {
  fields(s, [&](const auto&... field) { (f(field), ...); });
}

// ---- values as messages have them

template <typename T>
requires(std::is_arithmetic_v<T> && !std::same_as<T, bool>) void put(T from, auto& to) noexcept {
  to = static_cast<std::remove_reference_t<decltype(to)>>(from);
}
inline void put(bool from, std::int8_t& to) noexcept { to = from ? 1 : 0; }
inline void put(Tripped from, std::int32_t& to) noexcept {
  to = static_cast<std::int32_t>(from.bits());
}
template <typename E>
requires std::is_enum_v<E>
void put(E from, std::int32_t& to) noexcept { to = static_cast<std::int32_t>(from); }
template <std::size_t N>
void put(const std::array<std::int32_t, N>& from, std::int32_t (&to)[N]) noexcept {
  std::copy(from.begin(), from.end(), to);
}
template <typename E, std::size_t N>
requires std::is_enum_v<E>
void put(const std::array<E, N>& from, std::int32_t (&to)[N]) noexcept {
  std::transform(from.begin(), from.end(), to, [](E e) { return static_cast<std::int32_t>(e); });
}
template <int R, int C>
using RowByRow = Eigen::Matrix<double, R, C, C == 1 ? Eigen::ColMajor : Eigen::RowMajor>;
template <int R, int C>
void put(const Eigen::Matrix<double, R, C>& from, double (&to)[R * C]) noexcept {
  RowByRow<R, C>::Map(to) = from;
}
inline void put(const Wrench& from, double (&to)[6]) noexcept { put(Vec6(from.stacked()), to); }
inline void put(const Pose& from, double (&to)[6]) noexcept { put(Vec6(from.stacked()), to); }

/// False where the message's number is none of these.
template <typename T>
requires(std::is_arithmetic_v<T> && !std::same_as<T, bool>) bool take(const auto& from,
                                                                      T& to) noexcept {
  to = static_cast<T>(from);
  return true;
}
inline bool take(std::int8_t from, bool& to) noexcept {
  to = from != 0;
  return from == 0 || from == 1;
}
inline bool take(std::int32_t from, Tripped& to) noexcept {
  to = Tripped(static_cast<std::uint32_t>(from));
  return to.bits() < 1u << static_cast<std::uint32_t>(Check::kCount);
}
template <typename E>
requires std::is_enum_v<E>
bool take(std::int32_t from, E& to) noexcept {
  to = static_cast<E>(from);
  return from >= 0 && from <= static_cast<std::int32_t>(E::kCount);
}
template <std::size_t N>
bool take(const std::int32_t (&from)[N], std::array<std::int32_t, N>& to) noexcept {
  std::copy(std::begin(from), std::end(from), to.begin());
  return true;
}
template <typename E, std::size_t N>
requires std::is_enum_v<E>
bool take(const std::int32_t (&from)[N], std::array<E, N>& to) noexcept {
  bool good = true;
  for (std::size_t i = 0; i < N; ++i) good = take(from[i], to[i]) && good;
  return good;
}
template <int R, int C>
bool take(const double (&from)[R * C], Eigen::Matrix<double, R, C>& to) noexcept {
  to = RowByRow<R, C>::Map(from);
  return true;
}
inline bool take(const double (&from)[6], Wrench& to) noexcept {
  to = Wrench::from(Vec6::Map(from));
  return true;
}
inline bool take(const double (&from)[6], Pose& to) noexcept {
  to = Pose::from(Vec6::Map(from));
  return true;
}

}  // namespace ves::schema
