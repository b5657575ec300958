// SPDX-License-Identifier: BSD-3-Clause
//
// The report's vehicle (Appendices C and D): a base of linear modes.
#pragma once

#include "ves/contract/order.hpp"
#include "ves/math/frames.hpp"
#include "ves/vehicle/ground_motion.hpp"

namespace ves {

/// [rad] that a base's fastest mode may pass in a period where a body moves with it: the work of a
/// tick grows with it (ModalDynamics::advance).
inline constexpr double kMostModalAngle = 20.0;
/// Degrees of freedom of the report's SRMS model.
inline constexpr int kMaxModes = 132;
/// Modes that may be coupled by damping.
inline constexpr int kMaxCoupledModes = 6;

/// (C.4) in mode space: eta'' + damping eta' + diag(stiffness) eta = Phi^T W, x = Phi eta.
struct ModalModel {
  Eigen::MatrixXd Phi;        // 6 x k, mass-normalised mode shapes at the platform, m or rad
  Eigen::VectorXd stiffness;  // k, [1/s^2] omega^2
  Eigen::MatrixXd damping;    // k x k, [1/s] diagonal (2 zeta omega) when it is proportional

  bool operator==(const ModalModel& other) const {
    return stiffness.size() == other.stiffness.size() && Phi == other.Phi &&
           stiffness == other.stiffness && damping == other.damping;
  }
};

/// The model of such a vehicle, mass-normalised again.
ModalModel scaled(const ModalModel& model, const VehicleFactors& factors);

/// Exact over a length of time under a held modal force u: {eta, eta'} <- Phi {eta, eta'} + Gamma
/// u.
struct ModalHold {
  Eigen::MatrixXd Phi, Gamma;  // 2k x 2k, 2k x k
};

/// Over dt [s], for damping of any form.
ModalHold modalHold(const ModalModel& model, double dt);

/// A modal model whose transitions over fixed lengths of time are computed beforehand: mode by mode
/// (D.5), or, when damping couples the modes, all of them in one state space.
class ModalDynamics {
 public:
  template <int Max>
  using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, Max, 1>;
  using Forces = Vector<kMaxModes>;  // modal: Phi^T F
  static constexpr int kCoupledStates = 2 * kMaxCoupledModes;
  using Square =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kCoupledStates, kCoupledStates>;

  struct Modes {
    Vector<kMaxModes> eta, eta_dot;
  };
  /// Exact over one length of time.
  struct Hold {
    Eigen::Array<double, 6, Eigen::Dynamic, 0, 6, kMaxModes> modes;  // a mode's Phi (4), Gamma (2)
    Square Phi, Gamma;                                               // when coupled
  };

  /// Requires at most kMaxModes modes, kMaxCoupledModes if coupled.
  explicit ModalDynamics(const ModalModel& model);

  /// Over dt [s], which may be negative.
  Hold hold(double dt) const;
  /// From `from`, `u` held.
  Modes advance(const Hold& hold, const Modes& from, const Forces& u) const noexcept;
  /// (C.7): eta'' under u.
  Vector<kMaxModes> acceleration(const Modes& modes, const Forces& u) const noexcept;

  /// A rigid body M_1 on the base: (1 + Phi^T M_1 Phi) eta'' + damping eta' + diag(stiffness) eta =
  /// u, the left-hand side of (3.11).
  struct Body {
    Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, kMaxModes> pull;  // wrench per -eta''(free)
    Mat6 mobility;  // [1/kg] acceleration per wrench at Po
  };
  Body body(const Mat6& M_1) const noexcept;
  /// eta' of base and body after a blow at Po in I [N s, N m s], of a base of mass 1.
  Vector<kMaxModes> afterBlow(const Body& body, const Vector<kMaxModes>& eta_dot,
                              const Vec6& blow) const noexcept;
  /// From `from` over dt [s], which may be negative, with the body, `u` held. To rounding: the
  /// exponential's Taylor series, in as many steps as the fastest mode takes.
  Modes advance(const Body& body, double dt, const Modes& from, const Forces& u) const noexcept;
  Vector<kMaxModes> acceleration(const Body& body, const Modes& modes,
                                 const Forces& u) const noexcept;

  /// The same without the damping of modes that have more than `most` [1/s]; all of it where
  /// damping couples them and is more than that.
  ModalDynamics withoutDampingAbove(double most) const noexcept;

  /// With the shapes as they are: under u = Phi^T F / factors.mass, the body M_1 / factors.mass.
  ModalDynamics scaled(const VehicleFactors& factors) const noexcept;
  /// [rad] that the fastest mode passes in dt [s].
  double angle(double dt) const noexcept { return (fastest_ + most_damping_) * dt; }

  Modes atRest() const;
  /// [J] the modes are mass-normalised.
  double potentialEnergy(const Modes& m) const noexcept { return 0.5 * k_.dot(m.eta.cwiseAbs2()); }
  /// [W] at such a speed.
  double dissipation(const Vector<kMaxModes>& eta_dot) const noexcept {
    return coupled_ ? eta_dot.dot(damping_ * eta_dot) : c_.dot(eta_dot.cwiseAbs2());
  }
  const auto& Phi() const noexcept { return Phi_; }              // 6 x k
  const Mat6& mobility() const noexcept { return compliance_; }  // [1/kg] without a body
  const auto& stiffness() const noexcept { return k_; }          // k, [1/s^2]
  bool coupled() const noexcept { return coupled_; }
  Eigen::Index size() const noexcept { return k_.size(); }

 private:
  Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, kMaxModes> Phi_;
  Mat6 compliance_;                            // Phi Phi^T: acceleration per wrench
  Vector<kMaxModes> k_;                        // [1/s^2]
  Vector<kMaxModes> c_;                        // [1/s] diagonal of the damping
  double fastest_ = 0.0, most_damping_ = 0.0;  // [rad/s], [1/s]
  bool coupled_ = false;
  Square damping_;  // when coupled
};

/// A rigid body on a vehicle, about Po in I, whose inertia is not in the wrench.
struct CarriedBody {
  CarriedBody(const Mat6& M_1_before, const Mat6& M_1_now) : before(M_1_before), M_1(M_1_now) {}
  CarriedBody(const Mat6& kept) : CarriedBody(kept, kept) {}

  Mat6 before;  // in the step before
  Mat6 M_1;
  // Attitudes of the platform that the two were seen at: how it lies on the vehicle.
  Mat3 R_IP_before = Mat3::Identity(), R_IP = Mat3::Identity();
  Vec6 joints = Vec6::Zero();  // [N s, N m s] momentum of the robot's joints beside it
  // What has weight: all of it, whatever of its inertia is not in the wrench.
  double mass = 0.0;             // [kg]
  Vec3 moment_P = Vec3::Zero();  // [kg m] first, about Po in P, amid the step
};

/// What weight does on the coordinates of a platform turned by `rpy` on what it stands on, in whose
/// axes gravity [m/s^2] is: the body's mass [kg], its first moment [kg m] about Po in P. [N, N m]
Vec6 workOfWeight(const Vec3& gravity, double mass, const Vec3& moment_P, const Vec3& rpy) noexcept;
/// How much stiffer that makes the vehicle near home; what stands may fall over. [N m/rad] of the
/// angles, 0 else.
Mat6 stiffnessOfWeight(const Vec3& gravity, const Vec3& moment_P) noexcept;

/// Steps a modal model by the exact zero-order hold. Coordinates are those of Pose about home.
/// Without a body they are taken as small: the wrench's moments drive the fixed angles directly, as
/// in (C.2). With one, moments do their work on them, and rates are those of the body, however far
/// it turns.
///
/// Its mass m, damping c and stiffness k may be changed, all modes alike: m eta'' + c C eta' + k K
/// eta = Phi^T W.
///
/// On a ground that moves by g, x = Phi eta + g: springs and dampers pull at what is beside it, and
/// vehicle and body have to be accelerated with it. Without modes the vehicle goes as the ground
/// does.
///
/// Under gravity that it feels, the weight of the body on it moves it: at home, with the body as it
/// is when it is let go, it is in balance. Its own weight it feels by the ground's tilt alone; what
/// else that does is in its stiffness.
class ModalVehicle {
 public:
  /// Discretises for the period [s].
  ModalVehicle(const ModalModel& model, double period, const GroundMotion& ground = {},
               const Vec3& felt_gravity = Vec3::Zero());

  /// motion() is at rest at x. What the modes cannot express of x stays as a constant offset. Where
  /// motion() is predicted `ahead` [s] of the modes, these are propagated back by `ahead` along the
  /// motion with M_1 that leads to x (without heavy damping), so that the prediction starts at
  /// rest.
  void reset(const Vec6& x, const Mat6& M_1 = Mat6::Zero(), double ahead = 0.0) noexcept;

  /// (C.6): the state one period after W began to act. `damping` [1/s] acts on every mode besides,
  /// held with W; not in a step in which the vehicle turns round, and it would push.
  void step(const Wrench& F_Po_I, double damping = 0.0) noexcept;

  /// The same `dt` [s] after, with a rigid body on the base: the left-hand side of (3.11), where
  /// the body changes as that of momenta: what it turns with is passed on. motion() is `ahead` [s]
  /// of that, F_Po_I held. dt of 0: F_Po_I has acted already.
  void step(const Wrench& F_Po_I, const CarriedBody& body, double dt, double ahead,
            double damping = 0.0) noexcept;

  /// Takes back all but `share` of the last step, and of the rate it led to: all modes alike, so
  /// the path stays and only the motion along it is slowed.
  void slow(double share) noexcept;

  /// Is elsewhere by so much, and as much faster, from the last step's end on.
  void displace(const ModalDynamics::Modes& by) noexcept;

  /// The next step's vehicle, where and as fast as this one is.
  void become(const VehicleFactors& factors) noexcept;
  const VehicleFactors& factors() const noexcept { return factors_; }
  /// [J] that becoming so puts in.
  double costOf(const VehicleFactors& factors) const noexcept;
  /// Whether a step by series, with a body or with coupled modes, is too long for a tick.
  Refusal refuses(const VehicleFactors& factors, bool with_body) const noexcept {
    const bool by_series = with_body || coupled();
    return !by_series || nominal_.scaled(factors).angle(period_) <= kMostModalAngle
               ? Refusal::kNone
               : Refusal::kTooFast;
  }
  Refusal fire(const ThrustOrder&) const noexcept { return Refusal::kNoSuchPart; }
  Thrust thrust() const noexcept { return {}; }

  void countFrom(const Vec6&) noexcept {}  // nobody flies along with what stands
  /// [J]
  double kineticEnergy() const noexcept {
    return factors_.mass * 0.5 * now_.modes.eta_dot.squaredNorm();
  }
  double energy() const noexcept {
    return kineticEnergy() + factors_.mass * dynamics_.potentialEnergy(now_.modes);
  }

  /// [J] that the last step took of F_Po_I, and that its damping took.
  double taken(const Wrench& F_Po_I) const noexcept {
    Vec6 way = dynamics_.Phi() * (now_.modes.eta - before_.modes.eta);
    if (ground_.moves()) way += now_.ground.x - before_.ground.x;
    return working(F_Po_I).dot(way);
  }
  /// [J] that ground and weight put into energy() in it.
  double shaken() const noexcept {
    return shakes_ ? factors_.mass * drag_.dot(now_.modes.eta - before_.modes.eta) : 0.0;
  }
  /// [J] that the base's own damping took in it, the speed taken as a line.
  double dissipated() const noexcept {
    const auto &from = before_.modes.eta_dot, &to = now_.modes.eta_dot;
    return factors_.mass * dt_ / 6.0 *
           (dynamics_.dissipation(from) + dynamics_.dissipation(from + to) +
            dynamics_.dissipation(to));
  }
  /// [J] that a step takes on average of noise in F_Po_I, of this covariance: of the speed that a
  /// wrench leads to in a step, the next steps have all, this one half.
  double takenOfNoise(const Mat6& covariance) const noexcept {
    return 0.5 * dt_ * dt_ / factors_.mass * covariance.cwiseProduct(mobility_).sum();
  }
  double damped() const noexcept {
    return -factors_.mass * damping_.dot(now_.modes.eta - before_.modes.eta);
  }

  /// (C.7): position, velocity, acceleration at the last step's end, or ahead of it.
  const PathPoint<6>& motion() const noexcept { return now_.motion; }
  BodyMotion bodyMotion() const noexcept;
  BodyMotion coasting() const noexcept;
  BodyMotion atWrench() const noexcept;

  const ModalDynamics& dynamics() const noexcept { return dynamics_; }
  /// Where it is, with the body M_1 on it, for motions beside this one.
  ModalDynamics::Body body(const Mat6& M_1) const noexcept {
    return dynamics_.body(M_1 / factors_.mass);
  }
  int modes() const noexcept { return static_cast<int>(dynamics_.size()); }
  Vec3 letGo() const noexcept { return Vec3::Zero(); }
  bool coupled() const noexcept { return dynamics_.coupled(); }

 private:
  using Modes = ModalDynamics::Modes;
  using Hold = ModalDynamics::Hold;
  struct State {
    Modes modes;
    PathPoint<6> motion;
    double time = 0.0;  // [s] of the ground, and where that is
    PathPoint<6> ground;
  };

  Vec6 coordinates(const Modes& modes, const PathPoint<6>& ground) const noexcept;
  Vec3 angleRates(const State& state) const noexcept;  // [rad/s]
  /// Of an acceleration of the ground, with the body M_1 per mass, on the coordinates.
  ModalDynamics::Forces dragAt(const Vec6& g_ddot, const Mat6& M_1_per_mass) const noexcept;
  /// Of weight, of a body and its own, on the coordinates, per mass.
  ModalDynamics::Forces weightAt(double mass, const Vec3& moment_P, const Vec6& x,
                                 const PathPoint<6>& ground) const noexcept;
  /// On the coordinates, stacked.
  Vec6 working(const Wrench& F_Po_I) const noexcept {
    return (Vec6() << F_Po_I.f, E_.transpose() * F_Po_I.n).finished();
  }
  Mat6 working(const Mat6& M_1) const noexcept;
  PathPoint<6> at(const Modes& modes, const ModalDynamics::Vector<kMaxModes>& acceleration,
                  const PathPoint<6>& ground) const noexcept;

  ModalDynamics nominal_;  // as configured
  ModalDynamics dynamics_;
  VehicleFactors factors_;
  Eigen::Matrix<double, Eigen::Dynamic, 6, Eigen::RowMajor, kMaxModes, 6> Phi_pinv_;
  GroundMotion ground_;
  Vec3 gravity_;                  // [m/s^2] felt, in I
  bool weighs_, shakes_;          // it is, and the ground moves or it is
  Vec6 at_home_ = Vec6::Zero();   // work of weight that the springs are in balance with
  bool balanced_ = false;         // which is known, since it was let go
  double period_ = 0.0;           // [s]
  double dt_ = 0.0;               // [s] of the last step
  Mat6 mobility_ = Mat6::Zero();  // [1/kg] in it: acceleration per wrench, per mass
  Hold step_;
  State now_, before_;             // before the last step
  ModalDynamics::Forces damping_;  // in the last step, per mass
  ModalDynamics::Forces drag_;     // of ground and weight in it, per mass
  Mat3 E_ = Mat3::Identity();      // angleRateMap amid the last step; none without a body
  Vec6 offset_ = Vec6::Zero();
};

}  // namespace ves
