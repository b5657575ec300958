// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>
#include <gsl/gsl_errno.h>
#include <gsl/gsl_odeiv2.h>
#include <gtest/gtest.h>

#include <complex>
#include <filesystem>

#include "support/poses.hpp"
#include "support/rig.hpp"
#include "support/robots.hpp"
#include "ves/config/experiment.hpp"
#include "ves/contract/leg_communication.hpp"
#include "ves/control/gravity_compensation.hpp"

namespace ves::plant {
namespace {

constexpr double kUpdate = 1.023e-3;  // [s]

using test::experiment;
// --- Force-torque sensor -------------------------------------------------------------------------

TEST(Sensor, SettledReadingIsSprocTimesWrench) {  // (2.6)
  Experiment e = experiment("free_decay");
  ForceTorqueSensor sensor(e.plant.sensor, Noise(1));
  const Wrench W{Vec3(100.0, -50.0, 300.0), Vec3(20.0, 10.0, -5.0)};
  sensor.settle(W);
  const Vec6 expected =
      e.plant.sensor.S_proc() * W.stacked() + e.plant.sensor.bias / e.plant.sensor.volts_per_count;
  const AdcCounts adc = sensor.convert(0.0);
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(adc[static_cast<std::size_t>(i)], expected(i), 0.5);
}

TEST(Sensor, TheTruthIsWhatTheConverterReadsUnroundedHoweverWarmItIs) {
  Experiment e = experiment("free_decay");
  ASSERT_GT(e.plant.sensor.drift(0), 10.0 * e.plant.sensor.volts_per_count);  // a degree
  ForceTorqueSensor sensor(e.plant.sensor, Noise(1));
  sensor.settle({Vec3(100.0, -50.0, 300.0), Vec3(20.0, 10.0, -5.0)});
  for (const double warmer : {0.0, 3.0, -2.0}) {
    const Vec6 counts = e.plant.sensor.S_proc() * sensor.reading(warmer).stacked();
    for (int i = 0; i < 6; ++i)
      EXPECT_NEAR(sensor.convert(warmer)[static_cast<std::size_t>(i)], counts(i), 0.5 + 1e-9);
  }
}

TEST(Sensor, ConverterSaturates) {
  Experiment e = experiment("free_decay");
  ForceTorqueSensor sensor(e.plant.sensor, Noise(1));
  sensor.settle({Vec3(1e6, -1e6, 0.0), Vec3::Zero()});
  EXPECT_EQ(sensor.convert(0.0)[0], 32767);
  EXPECT_EQ(sensor.convert(0.0)[1], -32768);
}

TEST(Sensor, NoiseIsAsFigure41) {
  // 1 s at 100 Hz, unloaded: X and Y under about 1 N, Z up to about 3 N, moments under 1 N m. One
  // sigma is 7 mV at gain 4000, so with gain 1000 each channel must show 1.75 mV rms.
  Experiment e = experiment("z_sine");
  const Mat6 C_proc = e.controller.sensor.C_proc;
  ForceTorqueSensor sensor(e.plant.sensor, Noise(3));
  sensor.settle({});
  const auto step = sensor.prepare(kUpdate);
  for (int i = 0; i < 2000; ++i) sensor.advance(step, {}, ForceTorqueSensor::Over::kRamp);
  const Vec6 bias = e.plant.sensor.bias / e.plant.sensor.volts_per_count;
  Vec6 sum2 = Vec6::Zero(), largest = Vec6::Zero();
  const int n = 20000;
  for (int k = 0; k < n; ++k) {
    for (int i = 0; i < 10; ++i) sensor.advance(step, {}, ForceTorqueSensor::Over::kRamp);
    const Wrench W = sensorWrench(e.controller.sensor, bias, sensor.convert(0.0));
    sum2 += W.stacked().cwiseAbs2() / n;
    if (k < 100) largest = largest.cwiseMax(W.stacked().cwiseAbs());
  }
  const Vec6 rms = sum2.cwiseSqrt();
  const double volts = 1.75e-3;
  const Mat6 per_volt = C_proc / e.plant.sensor.volts_per_count;
  for (int i = 0; i < 6; ++i)
    EXPECT_NEAR(rms(i), volts * per_volt.row(i).norm(), 0.05 * rms(i)) << i;
  EXPECT_LT(largest(0), 1.2);
  EXPECT_LT(largest(1), 1.2);
  EXPECT_LT(largest(2), 4.0);
  EXPECT_GT(largest(2), 1.5);
  EXPECT_LT(largest.tail<3>().maxCoeff(), 1.0);
}

// --- The whole -----------------------------------------------------------------------------------

TEST(Plant, RestsWhereItIs) {
  const Experiment e = experiment("puma_tilt");
  Plant plant(e.plant);
  const Sample first = plant.sample();
  plant.advance(2'000'000'000);
  const Sample later = plant.sample();
  EXPECT_EQ(later.legs, first.legs);
  EXPECT_EQ(later.adc, first.adc);
  EXPECT_LT(plant.truth().P.v.norm() + plant.truth().P.w.norm(), 1e-12);
}

TEST(Plant, FirstSampleShowsTheInitialPose) {
  Experiment e = experiment("puma_on_table_4_1");
  Plant plant(e.plant);
  const Sample s = plant.sample();
  const Vec6 L =
      legLengths(e.controller.geometry, e.controller.geometry.fromHome(e.plant.initial_pose));
  EXPECT_LE((legLengths(e.controller.legs, s.legs) - L).cwiseAbs().maxCoeff(),
            0.5 * e.plant.transducer.scale * (1 + 1e-9));
}

TEST(Plant, RestsInsideTheConvertersRangeInEveryScenario) {
  for (const auto& file : std::filesystem::directory_iterator(test::configDir() + "/scenarios")) {
    const Experiment e = loadExperiment(file.path());
    EXPECT_TRUE(e.source.warnings.empty()) << e.name << ": " << e.source.warnings[0];
    for (const int count : Plant(e.plant).sample().adc)
      EXPECT_LT(std::abs(count), 0.9 * 32767) << e.name;
  }
}

TEST(Plant, WarnsOfTheChannelThatTheWeightFills) {
  int warned = 0;
  for (const double gain : {900.0, 1000.0, 1020.0}) {
    const Experiment e = experiment("srms_unberth_doss",
                                    {fmt::format("sensor.gain=[500, 500, 500, {}, 500, 500]", gain),
                                     "sensor.noise=false", "sensor.bias_v=[0, 0, 0, 0, 0, 0]"});
    const double percent = 100.0 * std::abs(Plant(e.plant).sample().adc[3]) / 32767;
    ASSERT_EQ(e.source.warnings.size(), percent > 90 ? 1u : 0u) << percent;
    if (percent > 90) {
      EXPECT_NE(e.source.warnings[0].find(
                    fmt::format("takes {:.0f} % of the range of channel mx", percent)),
                std::string::npos)
          << e.source.warnings[0] << " where the plant reads " << percent;
      EXPECT_NE(e.source.warnings[0].find("sensor.gain[3]"), std::string::npos);
      ++warned;
    }
  }
  EXPECT_EQ(warned, 2);
}

TEST(Plant, IgnoresCommandsThatAreNotEngaged) {
  const Experiment e = experiment("z_sine");
  Plant plant(e.plant);
  const LegCounts before = plant.sample().legs;
  LegCommand command;
  command.counts = before;
  for (auto& c : command.counts) c += 500;
  command.rest = command.counts;
  plant.command(command);
  plant.advance(1'000'000'000);
  EXPECT_EQ(plant.sample().legs, before);
  command.engaged = true;
  command.rest = command.counts;
  plant.command(command);
  plant.advance(3'000'000'000);
  const LegCounts after = plant.sample().legs;
  for (std::size_t i = 0; i < kLegs; ++i) EXPECT_NEAR(after[i], before[i] + 500, 1.0);
}

TEST(Plant, TrueRatesAreTheDerivativesOfTheTruePose) {
  // Looked at every 50 us while the legs follow steps: rates by differences of the pose,
  // accelerations by their integral (they jump with every new current).
  const Experiment e = experiment("z_sine");
  Plant plant(e.plant);
  LegCommand command;
  command.engaged = true;
  command.counts = plant.sample().legs;
  for (std::size_t i = 0; i < kLegs; ++i) command.counts[i] += static_cast<int>(60 + 30 * i);
  command.rest = command.counts;
  plant.command(command);
  const double dt = 50e-6;
  Truth before = plant.truth();
  Vec3 dv = Vec3::Zero(), dw = Vec3::Zero();
  double fastest = 0.0;
  for (int k = 1; k <= 1200; ++k) {
    plant.advance(k * 50'000LL);
    plant.sample();
    const Truth& now = plant.truth();
    ASSERT_LT(((now.P.X.p - before.P.X.p) / dt - 0.5 * (now.P.v + before.P.v)).norm(), 4e-4);
    const Mat3 W = (now.P.X.R * before.P.X.R.transpose() - Mat3::Identity()) / dt;
    ASSERT_LT((Vec3(W(2, 1), W(0, 2), W(1, 0)) - 0.5 * (now.P.w + before.P.w)).norm(), 8e-4);
    dv += dt * now.P.a;  // means since the last look
    dw += dt * now.P.alpha;
    fastest = std::max(fastest, now.P.v.norm());
    ASSERT_LT((now.P.v - dv).norm() + (now.P.w - dw).norm(), 0.03 * fastest + 1e-3);
    before = now;
  }
  EXPECT_GT(fastest, 0.02);
}

TEST(Plant, PlatesCountedIntoTheRobotsBaseWeighTheSame) {
  // Once as the plant does it, once part by part.
  Experiment e = experiment("puma_on_table_4_1");
  Plant plant(e.plant);
  LegCommand command;
  command.engaged = true;
  for (int k = 0; k < 100; ++k) {
    const Geometry& g = e.controller.geometry;
    const double s = 0.03 * std::sin(0.1 * k);
    command.counts =
        legCounts(e.controller.legs, legLengths(g, g.fromHome({{s, 0.0, s}, {s, -s, 0.0}})));
    command.rest = command.counts;
    plant.command(command);
    plant.advance((k + 1) * 10'000'000LL);
    plant.sample();
    const Truth& truth = plant.truth();
    const Payload& load = e.plant.payload;
    const auto part = [&](const Transform& X_PB, const Wrench& on_body) {
      return rotate(truth.P.X.R, transfer(X_PB, Wrench{} - on_body));
    };
    const Wrench oracle =
        part(load.X_PL0(), newtonEuler(load.robot, truth.joints,
                                       properMotion(truth.P, load.X_PL0(), e.plant.gravity))
                               .F_L0o_L0) +
        part(load.X_PR,
             inertialWrench(load.adapter_R, properMotion(truth.P, load.X_PR, e.plant.gravity))) +
        part(load.X_PS,
             inertialWrench(load.top_plate_S, properMotion(truth.P, load.X_PS, e.plant.gravity)));
    ASSERT_LT((truth.F_Po_I - oracle).stacked().norm(), 1e-9);
  }
}

TEST(Plant, FiltersDelayTheOutputsOnly) {
  // Filter 1 is 47 ms late at low frequency (sqrt(2)/30 s); the Temposonics do not see it.
  const auto poseAfterRamp = [](const char* filters) {
    const Experiment e = experiment("z_sine", {std::string("legs.filters=") + filters});
    Plant plant(e.plant);
    LegCommand command;
    command.engaged = true;
    for (int k = 0; k < 150; ++k) {
      const Geometry& g = e.controller.geometry;
      command.counts = legCounts(e.controller.legs,
                                 legLengths(g, g.fromHome({{0.0, 0.0, 0.001 * k}, Vec3::Zero()})));
      command.rest = command.counts;
      plant.command(command);
      plant.advance((k + 1) * 10'000'000LL);
    }
    const Sample s = plant.sample();
    return std::pair{plant.truth().x.p.z(), s.legs};
  };
  const auto [plain, counts_plain] = poseAfterRamp("none");
  const auto [filtered, counts_filtered] = poseAfterRamp("outputs");
  EXPECT_EQ(counts_plain, counts_filtered);
  EXPECT_NEAR(plain - filtered, 0.1 * M_SQRT2 / 30.0, 2e-4);  // 0.1 m/s
}

TEST(Plant, ARobotThatHasMovedAndStandsWeighsWhatItDoesThere) {
  Experiment e = experiment("puma_tilt");
  plant::Plant plant(e.plant);
  Payload payload = e.plant.payload;
  const auto weighs = [&] {
    plant.advance(plant.time() + 2'000'000'000);  // the sensor's filter has settled
    plant.sample();
    const plant::Truth& t = plant.truth();
    const Wrench F_Po_I = gravityCompensation(
        payload, t.P.X.R, staticWrench(payload, t.joints.q, t.P.X.R, e.plant.gravity));
    return (t.F_Po_I - F_Po_I).stacked().norm() / F_Po_I.f.norm();
  };
  EXPECT_LT(weighs(), 1e-9);
  ASSERT_TRUE(plant.moveRobot(RobotMove{1, e.plant.task.initial_joints(1) - 0.6, 1.0}));
  EXPECT_LT(weighs(), 1e-9);
  RigidBody load;
  load.mass = 3.0;
  load.p_BoBcm_B = {0.1, 0.0, 0.05};
  // Each time as if it were the first: nothing of the load before stays. No joint moves.
  for (const double more : {0.0, 2.0, -1.5}) {
    load.mass = 3.0 + more;
    ASSERT_TRUE(plant.moveRobot(Grasp{5, load}));
    payload.robot = withLoad(e.plant.payload.robot, 5, load);
    EXPECT_LT(weighs(), 1e-9) << more;
    ASSERT_TRUE(plant.moveRobot(Release()));
    payload.robot = e.plant.payload.robot;
    EXPECT_LT(weighs(), 1e-9) << more;
  }
}

TEST(Plant, JointsFollowAFifthOrderPolynomial) {
  Experiment e = experiment("puma_tilt");
  Plant plant(e.plant);
  EXPECT_TRUE(plant.moveRobot(RobotMove{0, 30 * kDegree, 5.0}));
  for (int k = 1; k <= 600; ++k) {
    plant.advance(k * 10'000'000LL);
    const Sample s = plant.sample();
    const double u = std::min(1.0, k * 0.01 / 5.0);
    ASSERT_NEAR(s.q(0), 30 * kDegree * u * u * u * (10 - 15 * u + 6 * u * u), 1e-12);
  }
  EXPECT_FALSE(plant.moveRobot(RobotMove{6, 0.0, 1.0}));
  EXPECT_FALSE(plant.moveRobot(RobotMove{0, NAN, 1.0}));
  EXPECT_FALSE(plant.moveRobot(RobotMove{0, 1.0, 0.0}));
}

TEST(Plant, ItsTimeIsWhatItWasAdvancedTo) {
  for (const char* model : {"ideal", "hydraulic"}) {
    plant::Plant plant(experiment("puma_on_table_4_1", {std::string("legs.model=") + model}).plant);
    for (const std::int64_t t :
         {1L, 349'999L, 350'001L, 10'000'000L, 10'000'001L, 1'234'567'891L}) {
      plant.advance(t);
      EXPECT_EQ(plant.time(), t) << model;
      EXPECT_EQ(plant.sample().time, t) << model;
      EXPECT_EQ(plant.truth().time, t) << model;
    }
  }
}

TEST(Plant, CuesCountFromTheSegmentsFirstCommand) {
  Experiment e = experiment("puma_on_table_4_1");
  e.plant.task.robot_events = {{{2, 500'000'000}, RobotMove{0, 0.5, 1.0}}};
  e.plant.faults = {{{2, 300'000'000}, 100'000'000, plant::Fault::kFloorMat}};
  Plant plant(e.plant);
  LegCommand command;
  command.engaged = true;
  command.counts = plant.sample().legs;
  for (int k = 0; k < 400; ++k) {
    command.segment = k < 100 ? 1 : 2;  // segment 2 begins at 1 s
    command.rest = command.counts;
    plant.command(command);
    plant.advance((k + 1) * 10'000'000LL);
    const Sample s = plant.sample();
    const double t = (k + 1) * 0.01;
    ASSERT_EQ(s.q(0) != 0.0, t > 1.5) << t;
    ASSERT_EQ((s.switches & kFloorMatClosed) == 0, t > 1.295 && t < 1.395) << t;
  }
}

TEST(Plant, ALongLeapIsAsGoodAsManySteps) {  // what is still is passed over; what moves is not
  PlantConfig config = experiment("z_sine", {"sensor.noise=false"}).plant;
  const auto run = [&](std::int64_t step) {
    Plant plant(config);
    plant.advance(1'000'000'000);
    LegCommand command;
    command.counts = plant.sample().legs;
    command.engaged = true;
    command.counts[0] -= 6000;  // longer under way than the second that a leap leaves
    command.rest = command.counts;
    plant.command(command);
    const std::int64_t end = 20'000'000'000;
    for (std::int64_t t = plant.time(); t < end; t += step) {
      command.rest = command.counts;
      plant.command(command);
      plant.advance(std::min(end, t + step));
    }
    return plant.sample();
  };
  const Sample many = run(10'000'000), one = run(20'000'000'000);
  for (std::size_t i = 0; i < kLegs; ++i) EXPECT_NEAR(many.legs[i], one.legs[i], 1) << i;
  for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(many.adc[i], one.adc[i], 1) << i;
  EXPECT_LT(many.legs[0], many.legs[1] - 4000);
}

// What stands for the readings from before the start was read in the same hall.
TEST(Plant, TheFirstReadingsAreAsWarmAsTheNext) {
  const auto readings = [](const std::string& swing) {
    Experiment e = experiment(
        "puma_on_table_4_1",
        {"sensor.readings_per_tick=5", "sensor.noise=false", "sensor.temperature.swing_c=" + swing,
         "sensor.temperature.rising_h=-6"});  // warmest at the start
    plant::Plant plant(e.plant);
    std::vector<Sample> out{plant.sample()};
    plant.advance(1'000'000'000);
    out.push_back(plant.sample());
    return out;
  };
  const std::vector<Sample> warm = readings("16"), cold = readings("0");
  for (std::size_t i = 0; i < kWrenchChannels; ++i) {
    EXPECT_NEAR(warm[0].adc[i], warm[1].adc[i], 1.5) << i;
    EXPECT_GT(std::abs(warm[0].adc[i] - cold[0].adc[i]), 10.0) << i;
  }
}

TEST(Plant, AveragedReadingsAreThoseOfTheMiddlesOfTheWindowsParts) {
  // Beside a plant that is read at just those times: the same steps, the same noise.
  Experiment e = experiment("puma_on_table_4_1", {"sensor.readings_per_tick=5"});
  plant::PlantConfig single = e.plant;
  single.sensor_readings = 1;
  plant::Plant mean(e.plant), read(single);
  LegCommand command;
  command.engaged = true;
  const Vec6 home = legLengths(e.plant.geometry, e.plant.geometry.fromHome(e.plant.initial_pose));
  std::array<double, kWrenchChannels> sums{};
  for (std::int64_t n = 0; n < 50; ++n) {
    const double z = 0.01 * std::sin(0.3 * static_cast<double>(n));
    command.counts = legCounts(e.controller.legs, home.array() + z);
    mean.command(command);
    read.command(command);
    const auto tick = n * 10'000'000;
    sums.fill(0.0);
    for (int k = 0; k < 5; ++k) {
      read.advance(tick + 1'000'000 + k * 2'000'000);
      const Sample s = read.sample();
      for (std::size_t i = 0; i < kWrenchChannels; ++i) sums[i] += s.adc[i] / 5.0;
    }
    mean.advance(tick + 10'000'000);
    const Sample s = mean.sample();
    EXPECT_EQ(s.wrench_time, s.time);
    for (std::size_t i = 0; i < kWrenchChannels; ++i)
      ASSERT_NEAR(s.adc[i], sums[i], 0.5 + 1e-9) << n << " " << i;
    read.advance(tick + 10'000'000);
    read.sample();
  }
  // Between two windows' ends the newest that is over counts.
  mean.advance(50 * 10'000'000 + 3'500'000);
  EXPECT_EQ(mean.sample().wrench_time, 50 * 10'000'000 + 2'000'000);
  mean.advance(50 * 10'000'000 + 4'000'000);
  EXPECT_EQ(mean.sample().wrench_time, 50 * 10'000'000 + 4'000'000);
}

TEST(JointEncoders, RoundToCountsBehindTheirPlay) {
  plant::JointEncoderModel model;
  model.count(0) = 0.25;
  model.play(1) = 0.5;
  plant::JointEncoders encoders(model, Noise(1), JointVector::Zero());
  // Joint 2 turns up to 1, and back: its encoder follows by half of the play, then rests for all
  // of it. Joint 3 has an encoder without fault.
  for (const auto& [q, rounded, played] :
       {std::tuple{0.1, 0.0, 0.0}, std::tuple{0.2, 0.25, 0.0}, std::tuple{0.4, 0.5, 0.15},
        std::tuple{1.0, 1.0, 0.75}, std::tuple{0.8, 0.75, 0.75}, std::tuple{0.5, 0.5, 0.75},
        std::tuple{0.3, 0.25, 0.55}, std::tuple{-0.1, 0.0, 0.15}}) {
    const JointVector read = encoders.read(q * JointVector::Ones());
    EXPECT_DOUBLE_EQ(read(0), rounded) << q;
    EXPECT_NEAR(read(1), played, 1e-12) << q;
    EXPECT_EQ(read(2), q);
  }
  EXPECT_TRUE(plant::JointEncoderModel().exact());
  for (JointVector plant::JointEncoderModel::*const fault :
       {&plant::JointEncoderModel::count, &plant::JointEncoderModel::play,
        &plant::JointEncoderModel::noise}) {
    model = {};
    (model.*fault)(1) = 0.1;
    EXPECT_FALSE(model.exact());
  }
  model = {};
  model.noise(0) = 1e-3;
  plant::JointEncoders noisy(model, Noise(1), JointVector::Zero());
  double squares = 0.0;
  constexpr int kReadings = 10000;
  for (int k = 0; k < kReadings; ++k)
    squares += std::pow(noisy.read(JointVector::Zero())(0), 2) / kReadings;
  EXPECT_NEAR(std::sqrt(squares), 1e-3, 0.03e-3);
}

// A sample has the newest reading, and says when that was; the motion is that of exact encoders.
TEST(Plant, EncodersAreReadAtTheirRate) {
  const Experiment e = experiment("puma_on_table_4_1", {"robot.encoders={rate_hz: 77}"});
  EXPECT_NEAR(static_cast<double>(e.plant.joints.interval), 1e9 / 77.0, 0.5);
  Plant plant(e.plant);
  EXPECT_TRUE(plant.moveRobot(RobotMove{0, 0.5, 1.0}));
  JointVector before = e.plant.task.initial_joints;
  std::int64_t last = 0;
  for (int k = 1; k <= 90; ++k) {
    plant.advance(k * 10'000'000LL);
    const Sample s = plant.sample();
    EXPECT_EQ(s.joints_time, s.time / e.plant.joints.interval * e.plant.joints.interval) << k;
    if (s.joints_time == last) {
      EXPECT_EQ(s.q, before);
    } else if (k > 20) {
      EXPECT_NE(s.q, before);
    }
    before = s.q;
    last = s.joints_time;
  }
}

TEST(Plant, SameSeedSameBytesOtherSeedOthers) {
  const auto run = [](const char* seed) {
    const Experiment e = experiment("puma_on_table_4_1", {seed});
    Plant plant(e.plant);
    std::vector<AdcCounts> out;
    for (int k = 1; k <= 50; ++k) {
      plant.advance(k * 10'000'000LL);
      out.push_back(plant.sample().adc);
    }
    return out;
  };
  EXPECT_EQ(run("seed=5"), run("seed=5"));
  EXPECT_NE(run("seed=5"), run("seed=6"));
}

TEST(Plant, SamplingMoreOftenChangesNothingButTheSensorsSteps) {
  // Legs do not know when they are looked at.
  const Experiment e = experiment("puma_tilt");
  Plant often(e.plant), seldom(e.plant);
  LegCommand command;
  command.engaged = true;
  command.counts = often.sample().legs;
  seldom.sample();
  for (auto& c : command.counts) c += 300;
  command.rest = command.counts;
  often.command(command);
  command.rest = command.counts;
  seldom.command(command);
  for (int k = 1; k <= 1000; ++k) {
    often.advance(k * 777'777LL);
    often.sample();
  }
  seldom.advance(777'777'000);
  const Sample a = often.sample(), b = seldom.sample();
  EXPECT_EQ(a.legs, b.legs);
  for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(a.adc[i], b.adc[i], 30);
}

}  // namespace
}  // namespace ves::plant
