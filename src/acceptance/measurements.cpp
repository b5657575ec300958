// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "ves/acceptance/acceptance.hpp"
#include "ves/core/coordinates.hpp"
#include "ves/math/dense.hpp"
#include "ves/robot/newton_euler.hpp"

namespace ves {
namespace {

constexpr std::size_t kFewest = 20;  // [-] readings of whatever is looked at

/// A row of the run, with what is looked at.
struct Moment {
  bool usable = false;                                 // there was a sample
  double told_at = 0.0, read_at = 0.0, felt_at = 0.0;  // [s] by the machine's clock
  Vec6 told, done;                                     // [m, rad] from home
  Vec6 legs, lengths;                                  // [m] told, done
  Vec6 felt =
      Vec6::Zero();  // [m/s^2, rad/s^2] acceleration of P in I, by what the load weighs more
  JointVector q = JointVector::Zero();  // [rad | m]
};

/// [m/s^2, rad/s^2] at which the load on the sensor moves, if it is what the controller believes.
class Accelerometer {
 public:
  /// The joints at q, as the machine says.
  Accelerometer(const ControllerConfig& c, const JointVector& q)
      : geometry_(c.geometry),
        load_P_(combine(RigidBody{}, c.payload.X_PL0(), compositeBody(carried(c.payload), q))) {}

  Vec6 at(const state_t& s) const {
    const Vec6 x = Vec6::Map(s.x_measured);
    const Mat3 R_IP = geometry_.fromHome({x.head<3>(), x.tail<3>()}).R;
    return inverse(spatialMass(rotated(R_IP, load_P_))) *
           (Vec6::Map(s.static_wrench) - Vec6::Map(s.total));
  }

 private:
  Geometry geometry_;
  RigidBody load_P_;
};

std::vector<Moment> momentsOf(const Series& series) {
  const ControllerConfig& c = series.experiment.controller;
  std::optional<Accelerometer> accelerometer;     // from the first sample on
  const double late = wrenchDelay(c.servo, 0.0);  // each reading has its own time: none is held
  const auto seconds = [](std::int64_t time) {
    return static_cast<double>(time) * kSecondPerNanosecond;
  };
  std::vector<Moment> out(series.rows.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    const Row& row = series.rows[i];
    Moment& m = out[i];
    m.told_at = m.read_at = m.felt_at = seconds(row.state.machine_time_ns);
    if (row.has_sample)
      if (const auto sample = fromMessage(row.sample)) {
        m.usable = true;
        m.q = sample->q;
        if (!accelerometer) accelerometer.emplace(c, m.q);
        m.read_at = seconds(sample->legs_time);
        m.felt_at = seconds(sample->wrench_time) - late;
      }
    m.told = Vec6::Map(row.state.x_desired);
    m.done = Vec6::Map(row.state.x_measured);
    m.legs = legLengths(c.geometry, c.geometry.fromHome({m.told.head<3>(), m.told.tail<3>()}));
    m.lengths = Vec6::Map(row.state.leg_measured);
    if (accelerometer) m.felt = accelerometer->at(row.state);
  }
  return out;
}

/// One test of a run.
class Test {
 public:
  Test(const Series& series, const AcceptanceTest& test)
      : series_(series), test_(test), moments_(momentsOf(series)), i_(test.coordinate) {
    out_.coordinate = test.coordinate;
  }

  CoordinateResult run() {
    for (const std::string& one : test_.skipped) missing(one);
    standing();
    rest();
    for (const AcceptanceTest::Sine& one : test_.sines) sine(one);
    if (!test_.sines.empty()) corner();
    if (!test_.ramps.empty()) triangles();
    if (test_.step_segment >= 0) steps();
    return std::move(out_);
  }

 private:
  bool loaded() const { return stands_ && test_.hardest > 0.0; }

  /// Rows of a segment from `skip` to `until` seconds after it began; empty where it was not
  /// reached.
  std::vector<const Moment*> of(int segment, double skip = 0.0, double until = HUGE_VAL) const {
    std::vector<const Moment*> all;
    for (std::size_t i = 0; i < moments_.size(); ++i)
      if (series_.rows[i].state.segment == segment && moments_[i].usable &&
          series_.rows[i].state.phase == static_cast<int>(Phase::kRunning))
        all.push_back(&moments_[i]);
    if (all.empty()) return all;
    const double begins = all.front()->told_at;
    std::erase_if(all, [&](const Moment* m) {
      return m->told_at < begins + skip - 1e-9 || m->told_at > begins + until - 1e-9;
    });
    return all;
  }

  template <typename F>
  static Track track(const std::vector<const Moment*>& rows, double Moment::*when, F value) {
    Track out;
    for (const Moment* m : rows) {
      if (!out.t.empty() && !(m->*when > out.t.back())) continue;  // the same reading again
      out.t.push_back(m->*when);
      out.y.push_back(value(*m));
    }
    return out;
  }
  Track told(const std::vector<const Moment*>& rows, int i) const {
    return track(rows, &Moment::told_at, [i](const Moment& m) { return m.told(i); });
  }
  Track done(const std::vector<const Moment*>& rows, int i) const {
    return track(rows, &Moment::read_at, [i](const Moment& m) { return m.done(i); });
  }
  Track felt(const std::vector<const Moment*>& rows, int i) const {
    return track(rows, &Moment::felt_at, [i](const Moment& m) { return m.felt(i); });
  }

  Measurement& put(Quantity quantity, const Estimate& estimate, std::string of = {}) {
    Measurement f;
    f.of = of.empty() ? std::string(coordinate(i_).name) : std::move(of);
    f.quantity = quantity;
    f.estimate = estimate;
    out_.all.push_back(std::move(f));
    return out_.all.back();
  }
  void missing(const std::string& what) {
    out_.missing.push_back(fmt::format("{}: {}", coordinate(i_).name, what));
  }

  /// Accelerations are of a load that does not change.
  void standing() {
    const double most = series_.experiment.controller.stillness.joint;  // as for a calibration
    const Moment* first = nullptr;
    for (const Moment& m : moments_) {
      if (!m.usable) continue;
      if (!first) first = &m;
      stands_ = stands_ && (m.q - first->q).cwiseAbs().maxCoeff() <= most;
    }
    if (!stands_) missing("accelerations: the robot moved, want it to stand still");
  }

  void rest() {
    constexpr double kSettles = 1.0;
    const auto rows = of(test_.rest_segment, kSettles);
    if (done(rows, i_).t.size() < kFewest || felt(rows, i_).t.size() < kFewest)
      return missing("it never stood");
    put(Quantity::kRestPosition, scatter(done(rows, i_)));
    if (loaded())
      put(Quantity::kRestAcceleration, scatter(felt(rows, i_)));
    else if (stands_)
      missing("accelerations: nothing heavy is on the force sensor");
    if (i_ == 2)
      for (int leg = 0; leg < kLegs; ++leg)
        put(Quantity::kRestPosition,
            scatter(track(rows, &Moment::read_at, [&](const Moment& m) { return m.lengths(leg); })),
            legName(leg));
  }

  void sine(const AcceptanceTest::Sine& s) {
    const auto rows = of(s.segment, s.settles, s.ends);
    if (static_cast<double>(rows.size()) * series_.experiment.controller.periodSeconds() <
        0.9 * (1.0 / s.frequency))
      return missing(fmt::format("the sine of {:g} Hz was not reached", s.frequency));
    const auto at = [&](Measurement& f) {
      f.frequency = s.frequency;
      f.amplitude = s.amplitude;
      f.level = s.level;
    };
    const Track answer = done(rows, i_);
    if (answer.t.size() < kFewest)
      return missing(
          fmt::format("the sine of {:g} Hz: fewer than {} readings", s.frequency, kFewest));
    const Sinusoid in = sinusoid(told(rows, i_), s.frequency), out = sinusoid(answer, s.frequency);
    const Response r = response(in, out);
    at(put(Quantity::kGain, r.gain));
    at(put(Quantity::kPhase, r.phase));

    const auto way = [&](int i) { return i < 3 ? 1.0 : test_.radius; };
    Estimate worst;
    int which = 0;
    for (int i = 0; i < 6; ++i) {
      if (i == i_) continue;
      const Sinusoid other = sinusoid(done(rows, i), s.frequency);
      const double per = way(i) / way(i_) / std::abs(in.of.front());
      if (const double share = std::abs(other.of.front()) * per; share >= worst.value) {
        worst = {share, other.within * per};
        which = i;
      }
    }
    Measurement& crosstalk = put(Quantity::kCrosstalk, worst);
    at(crosstalk);
    crosstalk.note = coordinate(which).name;
    if (!loaded()) return;

    const Track acceleration = felt(rows, i_);
    if (acceleration.t.size() < kFewest) return;
    const Sinusoid a = sinusoid(acceleration, s.frequency);
    const double first = std::abs(a.of[0]);
    at(put(Quantity::kHarmonics,
           {std::hypot(std::abs(a.of[1]), std::abs(a.of[2])) / first, M_SQRT2 * a.within / first}));
    at(put(Quantity::kRoughness, {M_SQRT2 * a.rest / first, a.within / first}));
    at(put(Quantity::kPeak, {a.peak / first, a.within / first}));
    // The speed leads the way by a quarter.
    if (s.frequency <= 1.0 && s.level == 1.0)
      at(put(Quantity::kTurnAround,
             turnAround(acceleration, a, out.of.front() * std::complex<double>(0.0, 1.0),
                        s.frequency)));
  }

  void corner() {
    std::vector<double> frequencies;
    std::vector<Estimate> phases;
    double turns = 0.0;
    for (const Measurement& f : out_.all) {
      if (f.quantity != Quantity::kPhase || f.level != test_.sines.front().level) continue;
      // Phase goes on falling where its angle comes round.
      Estimate phase = f.estimate;
      if (!phases.empty())
        while (phase.value + turns - phases.back().value > M_PI) turns -= 2.0 * M_PI;
      phase.value += turns;
      frequencies.push_back(f.frequency);
      phases.push_back(phase);
    }
    const Estimate at = crossing(frequencies, phases, -M_PI_2);
    if (std::isnan(at.value))
      missing("no corner: the phase does not come to -90 deg within the frequencies looked at");
    else
      put(Quantity::kCorner, at);
  }

  /// Mean of done less told within a ramp's middle, at the times of the readings. Where passes
  /// repeat each other to the count, as many values are independent as readings differ from the one
  /// before.
  template <typename Told, typename Done>
  Estimate off(int segment, Told told_value, Done done_value) const {
    constexpr double kEnds = 0.1;  // [-] of it at either end
    const auto rows = of(segment);
    const Track in = track(rows, &Moment::told_at, told_value),
                out = track(rows, &Moment::read_at, done_value);
    const double span = in.t.back() - in.t.front(), from = in.t.front() + kEnds * span,
                 to = in.t.back() - kEnds * span;
    std::vector<double> all;
    std::size_t different = 0;
    for (std::size_t i = 1; i < out.t.size(); ++i) {
      if (out.t[i] < from || out.t[i] > to) continue;
      all.push_back(out.y[i] - valueAt(in, out.t[i]));
      if (out.y[i] != out.y[i - 1]) ++different;
    }
    Estimate one = meanOf(all);
    one.within *= std::sqrt(static_cast<double>(all.size()) /
                            static_cast<double>(std::max<std::size_t>(1, different)));
    return one;
  }

  void triangles() {
    for (const AcceptanceTest::Ramp& ramp : test_.ramps)
      if (done(of(ramp.segment), i_).t.size() < kFewest)
        return missing("hysteresis: the slow passes were not reached");
    const auto measure = [&](const std::string& name, auto told_value, auto done_value) {
      Passes passes[2];
      double speed = 0.0;  // [m/s | rad/s] of what is measured, in the slow ones
      for (const AcceptanceTest::Ramp& ramp : test_.ramps) {
        const Track in = track(of(ramp.segment), &Moment::told_at, told_value);
        if (!ramp.fast) speed = std::abs(in.y.back() - in.y.front()) / (in.t.back() - in.t.front());
        Passes& p = passes[ramp.fast ? 1 : 0];
        (ramp.up ? p.up : p.down).push_back(off(ramp.segment, told_value, done_value));
      }
      const Hysteresis h = hysteresis(passes[0], passes[1], speed);
      put(Quantity::kHysteresis, h.width, name);
      put(Quantity::kOffset, h.offset, name);
      put(Quantity::kLag, h.lag, name);
    };
    const int i = i_;
    measure(
        {}, [i](const Moment& m) { return m.told(i); }, [i](const Moment& m) { return m.done(i); });
    if (i_ == 2)
      for (int leg = 0; leg < kLegs; ++leg)
        measure(
            legName(leg), [leg](const Moment& m) { return m.legs(leg); },
            [leg](const Moment& m) { return m.lengths(leg); });
    for (const AcceptanceTest::Ramp& ramp : test_.ramps) {
      if (ramp.fast) continue;
      const auto rows = of(ramp.segment);
      const Track in = told(rows, i_), out = done(rows, i_);
      Track loop;
      for (std::size_t k = 0; k < out.t.size(); ++k) {
        loop.t.push_back(valueAt(in, out.t[k]));
        loop.y.push_back(out.y[k] - loop.t.back());
      }
      (ramp.up ? out_.loop_up : out_.loop_down) = loop;
    }
  }

  void steps() {
    constexpr double kBefore = 0.3, kAfter = 0.4;  // [s]
    const auto rows = of(test_.step_segment);
    if (!loaded()) return;  // said
    if (felt(rows, i_).t.size() < kFewest)
      return missing("threshold: the steps of acceleration were not reached");
    const Track acceleration = felt(rows, i_);
    std::vector<Track> repetitions;
    double rested = 0.0;  // [s] since when it is told to stand
    for (std::size_t k = 0; k + 1 < rows.size(); ++k) {
      const double now = rows[k]->told(i_), next = rows[k + 1]->told(i_);
      if (now != 0.0 || (k > 0 && rows[k - 1]->told(i_) != 0.0)) rested = rows[k]->told_at;
      if (now != 0.0 || next == 0.0) continue;
      const double begins = rows[k]->told_at, way = next > 0.0 ? 1.0 : -1.0;
      if (begins - rested < kBefore || begins + kAfter > rows.back()->told_at) continue;
      double before = 0.0, count = 0.0;
      for (std::size_t n = 0; n < acceleration.t.size(); ++n)
        if (const double t = acceleration.t[n] - begins; t > -kBefore && t < 0.0) {
          before += acceleration.y[n];
          ++count;
        }
      Track one;
      for (std::size_t n = 0; n < acceleration.t.size(); ++n)
        if (const double t = acceleration.t[n] - begins; t > -kBefore && t < kAfter) {
          one.t.push_back(t);
          one.y.push_back(way * (acceleration.y[n] - before / count));
        }
      if (one.t.size() >= kFewest) repetitions.push_back(std::move(one));
    }
    if (repetitions.size() < 3) return missing("threshold: fewer than three steps of acceleration");
    const Estimate after = threshold(repetitions, test_.step);
    if (std::isnan(after.value))
      missing(fmt::format("threshold: 63 % of a step are not felt within {} s", kAfter));
    else
      put(Quantity::kThreshold, after);
    for (const double t : repetitions.front().t) {
      double sum = 0.0;
      for (const Track& one : repetitions) sum += valueAt(one, t);
      out_.step_felt.t.push_back(t);
      out_.step_felt.y.push_back(sum / static_cast<double>(repetitions.size()));
    }
    out_.step_told = {{-kBefore, 0.0, 0.0, kAfter}, {0.0, 0.0, test_.step, test_.step}};
  }

  static std::string legName(int leg) { return fmt::format("leg_{}", leg + 1); }

  const Series& series_;
  const AcceptanceTest& test_;
  std::vector<Moment> moments_;
  int i_;
  bool stands_ = true;  // the robot, all through the run
  CoordinateResult out_;
};

}  // namespace

bool turns(std::string_view of) {
  for (const Coordinate& c : kCoordinates)
    if (c.name == of) return c.unit == "rad";
  return false;
}

Unit unitOf(Quantity quantity, bool turns) {
  constexpr double kShown = 1.0 / kDegree;
  switch (kQuantities[static_cast<std::size_t>(quantity)].unit) {
    case Per::kOne: return {"", 1.0, "1", "", 1.0};
    case Per::kAngle: return {"deg", kShown, "rad", "_deg", kDegree};
    case Per::kSecond: return {"ms", 1e3, "s", "_s", 1.0};
    case Per::kHertz: return {"Hz", 1.0, "Hz", "_hz", 1.0};
    case Per::kWay:
      return turns ? Unit{"deg", kShown, "rad", "_deg", kDegree} : Unit{"mm", 1e3, "m", "_m", 1.0};
    case Per::kAcceleration:
      return turns ? Unit{"deg/s^2", kShown, "rad/s^2", "_deg_per_s2", kDegree}
                   : Unit{"m/s^2", 1.0, "m/s^2", "_m_per_s2", 1.0};
  }
  return {};
}

CoordinateResult measurementsOf(const Series& series, const AcceptanceTest& test) {
  return Test(series, test).run();
}

}  // namespace ves
