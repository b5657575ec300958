// SPDX-License-Identifier: BSD-3-Clause
//
// What viewers are told of a run, read by the definitions that stand in the same file, beside the
// run itself.
#include <zstd.h>

#include <cstring>
#include <sstream>

#include "support/rig.hpp"
#include "ves/bus/channels.hpp"
#include "ves/evaluation/let_go.hpp"
#include "ves/export/ros2.hpp"
#include "ves/run/run.hpp"
#include "ves/series/series.hpp"

namespace ves {
namespace {

using nlohmann::json;

/// Messages of ROS 2 by their definition: `type name` a line, [] for a sequence.
class Definition {
 public:
  explicit Definition(const std::string& text) {
    std::istringstream lines(text);
    std::vector<std::pair<std::string, std::string>>* now = &types_[""];
    for (std::string line; std::getline(lines, line);) {
      if (line.rfind("====", 0) == 0) continue;
      if (line.rfind("MSG: ", 0) == 0) {
        now = &types_[line.substr(5)];
        continue;
      }
      std::string type, name;
      if (std::istringstream(line) >> type >> name && type[0] != '#') now->emplace_back(type, name);
    }
  }

  /// Null where the bytes are more or less than the definition has.
  json read(const std::string& bytes) const {
    try {
      std::size_t at = 4;
      json out = message("", bytes, at);
      return at == bytes.size() ? out : json();
    } catch (const std::out_of_range&) {
      return {};
    }
  }

 private:
  template <class T>
  static T number(const std::string& bytes, std::size_t& at) {
    while ((at - 4) % sizeof(T) != 0) ++at;
    if (at + sizeof(T) > bytes.size()) throw std::out_of_range("bytes");
    T value;
    std::memcpy(&value, bytes.data() + at, sizeof value);
    at += sizeof value;
    return value;
  }
  json message(const std::string& type, const std::string& bytes, std::size_t& at) const {
    json out = json::object();
    for (const auto& [field, name] : types_.at(type)) out[name] = value(field, bytes, at);
    return out;
  }
  json value(const std::string& type, const std::string& bytes, std::size_t& at) const {
    if (const std::size_t open = type.find('['); open != std::string::npos) {
      const std::string size = type.substr(open + 1, type.size() - open - 2);
      const std::size_t n = size.empty() ? number<std::uint32_t>(bytes, at) : std::stoul(size);
      json out = json::array();
      for (std::size_t i = 0; i < n; ++i) out.push_back(value(type.substr(0, open), bytes, at));
      return out;
    }
    if (type == "float64") return number<double>(bytes, at);
    if (type == "float32") return number<float>(bytes, at);
    if (type == "int64") return number<std::int64_t>(bytes, at);
    if (type == "int32") return number<std::int32_t>(bytes, at);
    if (type == "uint32") return number<std::uint32_t>(bytes, at);
    if (type == "int8") return number<std::int8_t>(bytes, at);
    if (type == "uint8" || type == "bool") return number<std::uint8_t>(bytes, at);
    if (type == "string") {
      const auto n = number<std::uint32_t>(bytes, at);
      if (n == 0 || at + n > bytes.size()) throw std::out_of_range("text");
      const std::string text = bytes.substr(at, n - 1);
      at += n;
      return text;
    }
    return message(type, bytes, at);
  }

  std::map<std::string, std::vector<std::pair<std::string, std::string>>> types_;
};

/// All messages of an MCAP file by their topic, in order.
std::map<std::string, std::vector<json>> messagesOf(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(in)), {});
  std::map<std::uint16_t, Definition> schemas;
  std::map<std::uint16_t, std::pair<std::string, std::uint16_t>> channels;
  std::map<std::string, std::vector<json>> out;
  const auto number = [](const std::string& from, std::size_t at, auto value) {
    std::memcpy(&value, from.data() + at, sizeof value);
    return value;
  };
  const std::function<void(const std::string&, std::size_t, std::size_t)> records =
      [&](const std::string& of, std::size_t at, std::size_t end) {
        for (std::uint64_t size; at + 9 <= end; at += 9 + size) {
          size = number(of, at + 1, std::uint64_t{});
          const std::string r = of.substr(at + 9, size);
          const auto text = [&](std::size_t& from) {
            const auto n = number(r, from, std::uint32_t{});
            from += 4 + n;
            return r.substr(from - n, n);
          };
          std::size_t from = 2;
          if (of[at] == 3) {
            text(from), text(from);
            schemas.emplace(number(r, 0, std::uint16_t{}), text(from));
          } else if (of[at] == 4) {
            from = 4;
            channels[number(r, 0, std::uint16_t{})] = {text(from), number(r, 2, std::uint16_t{})};
          } else if (of[at] == 5) {
            const auto& [topic, schema] = channels.at(number(r, 0, std::uint16_t{}));
            json one = schemas.at(schema).read(r.substr(22));
            EXPECT_FALSE(one.is_null()) << topic << ": not as its definition has it";
            out[topic].push_back(std::move(one));
          } else if (of[at] == 6) {
            std::string plain(number(r, 16, std::uint64_t{}), '\0');
            const auto packed = number(r, 36, std::uint64_t{});
            EXPECT_EQ(ZSTD_decompress(plain.data(), plain.size(), r.data() + 44, packed),
                      plain.size());
            records(plain, 0, plain.size());
          }
        }
      };
  records(bytes, 8, bytes.size() - 8);
  return out;
}

struct Told {
  std::map<std::string, std::vector<json>> messages;
  std::vector<state_t> states;
  std::vector<truth_t> truths;
  std::map<std::int64_t, Vec6> base;
};

Told told(const Experiment& e, const Watch& watch = {}) {
  const auto folder = std::filesystem::temp_directory_path();
  const std::string log = folder / fmt::format("ves_told_{}.lcmlog", getpid()),
                    mcap = folder / fmt::format("ves_told_{}.mcap", getpid());
  {
    LogWriter writer(log);
    runLockstep(e, &writer, watch);
  }
  Told out;
  const Series series = readSeries(log);
  if (const auto both = emulation(series)) out.base = basePoses(series, both->base);
  McapExport to(e, "test", mcap, [&](const Row& row) {
    const auto at = out.base.find(row.state.header.sequence);
    return at == out.base.end() ? std::nullopt : std::optional<Vec6>(at->second);
  });
  LogReader reader(log);
  for (LogEvent event; reader.next(event);) {
    to.add(event);
    if (const auto m = event.as<state_t>()) out.states.push_back(*m);
    if (const auto m = event.as<truth_t>()) out.truths.push_back(*m);
  }
  to.finish();
  out.messages = messagesOf(mcap);
  std::filesystem::remove(log);
  std::filesystem::remove(mcap);
  return out;
}

Vec3 vectorOf(const json& v) {
  return Vec3(v["x"].get<double>(), v["y"].get<double>(), v["z"].get<double>());
}
Transform transformOf(const json& t) {
  const json &q = t["rotation"], &p = t["translation"];
  return {Eigen::Quaterniond(q["w"], q["x"], q["y"], q["z"]).toRotationMatrix(), vectorOf(p)};
}
std::optional<Transform> frame(const json& tf, const std::string& parent,
                               const std::string& child) {
  for (const json& one : tf["transforms"])
    if (one["header"]["frame_id"] == parent && one["child_frame_id"] == child)
      return transformOf(one["transform"]);
  return {};
}
double far(const Transform& a, const Transform& b) {
  return (a.p - b.p).norm() + (a.R - b.R).norm();
}

TEST(McapOfARun, TellsWhatTheRunWas) {
  const Experiment e = test::experiment(
      "puma_on_table_4_1", {"program=[{calibration: {}}, {admittance: {duration_s: 3}, robot: "
                            "[{at_s: 0.5, duration_s: 1.5, joint: joint_2, to_deg_or_m: -40}]}]"});
  Told t = told(e);
  const std::size_t n = t.states.size();
  const Geometry& g = e.plant.geometry;
  for (const char* topic : {"/tf", "/joint_states", "/wrench", "/legs", "/ves/state"})
    ASSERT_EQ(t.messages[topic].size(), n) << topic;
  ASSERT_EQ(t.truths.size(), n);
  bool ghost_seen = false;
  for (std::size_t i = 0; i < n; ++i) {
    const state_t& s = t.states[i];
    const truth_t& truth = t.truths[i];
    const Transform X_IP = g.fromHome(Pose::from(Vec6::Map(truth.x)));
    const json& tf = t.messages["/tf"][i];
    const auto platform = frame(tf, "inertial", "platform");
    ASSERT_TRUE(platform);
    EXPECT_LT(far(*platform, X_IP), 1e-12);
    EXPECT_FALSE(frame(tf, "emulated", "inertial"));
    // Beside the platform, the base in free space while admittance control runs.
    const auto ghost = frame(tf, "inertial", "ghost/platform");
    EXPECT_EQ(ghost.has_value(), inAdmittance(s)) << i;
    if (ghost) {
      ghost_seen = ghost_seen || far(*ghost, X_IP) > 1e-6;
      EXPECT_LT((ghost->p - X_IP.p).norm(), 0.02);
    }
    const json& joints = t.messages["/joint_states"][i];
    ASSERT_EQ(joints["name"].size(), 6u);
    EXPECT_TRUE(joints["effort"].empty());
    for (std::size_t k = 0; k < 6; ++k) {
      EXPECT_EQ(joints["name"][k], fmt::format("joint_{}", k + 1));
      EXPECT_EQ(joints["position"][k].get<double>(), truth.q[k]);
      EXPECT_EQ(joints["velocity"][k].get<double>(), truth.q_dot[k]);
    }
    const json& legs = t.messages["/legs"][i]["markers"];
    ASSERT_EQ(legs.size(), 1u);
    EXPECT_EQ(legs[0]["type"], 5);  // LINE_LIST
    const json& points = legs[0]["points"];
    ASSERT_EQ(points.size(), 12u);
    const Vec6 L = legLengths(g, X_IP);
    for (std::size_t k = 0; k < 6; ++k) {
      const Vec3 base = vectorOf(points[2 * k]), top = vectorOf(points[2 * k + 1]);
      EXPECT_EQ(base, g.p_IBi_I[k]);
      EXPECT_NEAR((top - base).norm(), L(static_cast<Eigen::Index>(k)), 1e-12);
    }
    // In the platform's axes; the state's is in the inertial ones.
    const json& wrench = t.messages["/wrench"][i];
    EXPECT_EQ(wrench["header"]["frame_id"], "platform");
    const Vec6 W = Vec6::Map(s.dynamic);
    EXPECT_LT((X_IP.R * vectorOf(wrench["wrench"]["force"]) - W.head<3>()).norm(), 1e-9);
    EXPECT_LT((X_IP.R * vectorOf(wrench["wrench"]["torque"]) - W.tail<3>()).norm(), 1e-9);
    const json& state = t.messages["/ves/state"][i];
    EXPECT_EQ(state["header"]["sequence"], s.header.sequence);
    for (std::size_t k = 0; k < 6; ++k)
      EXPECT_EQ(state["x_desired"][k].get<double>(), s.x_desired[k]);
  }
  EXPECT_TRUE(ghost_seen);
  std::vector<std::string> words;
  for (const json& one : t.messages["/log"]) words.push_back(one["msg"]);
  EXPECT_EQ(words,
            (std::vector<std::string>{"disarmed", "armed", "running: calibration (1 of 2)",
                                      "running: admittance (2 of 2)", "returning", "parked"}));
  ASSERT_EQ(t.messages["/robot_description"].size(), 1u);
  EXPECT_NE(t.messages["/robot_description"][0]["data"].get<std::string>().find("<robot"),
            std::string::npos);
}

// The robot's frames, from the platform to its hand, those that move and those that do not.
TEST(McapOfARun, ItsFramesLeadToTheHand) {
  const Experiment e = test::experiment(
      "puma_on_table_4_1", {"program=[{calibration: {}, robot: [{at_s: 0, duration_s: 1.5, joint: "
                            "joint_3, to_deg_or_m: 90}]}, {move: {duration_s: 1}}]"});
  Told t = told(e);
  ASSERT_EQ(t.messages["/tf_static"].size(), 1u);
  const NamedFrame& hand = e.robot.frames.back();
  std::map<std::string, std::pair<std::string, Transform>> parents;
  const auto learn = [&](const json& tf) {
    for (const json& one : tf["transforms"])
      parents[one["child_frame_id"]] = {one["header"]["frame_id"], transformOf(one["transform"])};
  };
  learn(t.messages["/tf_static"][0]);
  for (const std::size_t i : {std::size_t{0}, t.states.size() / 2, t.states.size() - 1}) {
    learn(t.messages["/tf"][i]);
    Transform X;
    std::string at = hand.name;
    for (int steps = 0; at != "platform"; ++steps) {
      ASSERT_TRUE(parents.count(at)) << at;
      ASSERT_LT(steps, 20);
      X = parents[at].second * X;
      at = parents[at].first;
    }
    const LinkPoses X_L0L = linkPoses(e.plant.payload.robot, JointVector::Map(t.truths[i].q));
    EXPECT_LT(far(X, e.plant.payload.X_PL0() * hand.pose(X_L0L)), 1e-12) << i;
  }
}

// Of a vehicle that was changed on the way nobody knows what its base does; of one whose thrusters
// are fired by orders it is known.
TEST(McapOfARun, HasTheBaseWhereItIsKnown) {
  const auto changed = [](const TickState& s) {
    Order order;
    if (s.kind != SegmentKind::kAdmittance || s.tick != 250) return order;
    order.request = Request::kVehicle;
    order.vehicle = {{2.0, 0.0, 0.0}, 0.5};
    return order;
  };
  const auto fired = [](const TickState& s) {
    Order order;
    if (s.kind != SegmentKind::kAdmittance || s.tick % 100 != 50) return order;
    order.request = Request::kThrust;
    order.thrust(1) = 0.25;
    return order;
  };
  const auto ghosts = [](Told t, const Experiment& e) {
    int out = 0;
    for (std::size_t i = 0; i < t.states.size(); ++i) {
      const auto ghost = frame(t.messages["/tf"][i], "inertial", "ghost/platform");
      if (!ghost) continue;
      ++out;
      const Vec6& x = t.base.at(t.states[i].header.sequence);
      EXPECT_LT(far(*ghost, e.plant.geometry.fromHome(Pose::from(x))), 1e-12);
    }
    return out;
  };
  const Experiment springs = test::experiment(
                       "puma_on_table_4_1",
                       {"program=[{calibration: {}}, {admittance: {duration_s: 3}}]"}),
                   floats = test::experiment(
                       "satellite_jets",
                       {"program=[{calibration: {}}, {admittance: {duration_s: 3}}]"});
  EXPECT_EQ(ghosts(told(springs, changed), springs), 0);
  EXPECT_GT(ghosts(told(floats, fired), floats), 290);
}

// A laboratory that flies: where its home is in the frame that does not.
TEST(McapOfARun, TellsWhereTheLaboratoryFlies) {
  const Experiment e =
      test::experiment("satellite_tumbling",
                       {"program=[{move: {}}, {calibration: {}}, {admittance: {duration_s: 20}}]"});
  Told t = told(e);
  const Vec3 home = e.plant.geometry.home();
  double turned = 0.0;
  for (std::size_t i = 0; i < t.states.size(); ++i) {
    const auto X_EI = frame(t.messages["/tf"][i], "emulated", "inertial");
    const Laboratory lab = laboratoryOf(t.states[i]);
    ASSERT_EQ(X_EI.has_value(), lab.flies()) << i;
    if (!X_EI) continue;
    const Transform X_EH = lab.at(t.states[i].machine_time_ns).X;
    EXPECT_LT((*X_EI * home - (home + X_EH.p)).norm(), 1e-12);
    EXPECT_LT((X_EI->R - X_EH.R).norm(), 1e-12);
    turned = std::max(turned, rotationVector(X_EI->R).norm());
  }
  EXPECT_GT(turned, 0.2);
}

}  // namespace
}  // namespace ves
