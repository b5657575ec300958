// SPDX-License-Identifier: BSD-3-Clause
//
// Whatever a setting may be: it is refused in one line, or what runs with it commands numbers.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <set>

#include "support/rig.hpp"
#include "support/robots.hpp"
#include "ves/config/keys.hpp"
#include "ves/plant/lockstep.hpp"

namespace ves {
namespace {

#ifdef VES_SANITIZE
constexpr int kOneOf = 6;  // settings
#else
constexpr int kOneOf = 1;
#endif
constexpr int kTicksOfEach = 250;

/// The least and the most that its reader takes of a number, and every other word.
std::vector<std::string> extremes(const std::string& now, const AskedKey& asked) {
  std::vector<std::string> out;
  if (asked.kinds & AskedKey::kFlag) out = {"true", "false"};
  if (asked.kinds & AskedKey::kChoice) out = asked.choices;
  constexpr unsigned kNumbers =
      AskedKey::kNumber | AskedKey::kInteger | AskedKey::kVector | AskedKey::kMatrix;
  if (asked.kinds & kNumbers)
    for (const auto& bound : {asked.lo.known(), asked.hi.known()})
      if (bound)
        out.push_back(std::isfinite(*bound)  ? fmt::format("{:.15g}", *bound)
                      : std::signbit(*bound) ? "-1e300"
                                             : "1e300");
  std::erase(out, now);
  return out;
}

/// Every scalar of a document that has extremes; of a vector the first number.
void walk(Value& value, const AskedKey& asked, const std::string& path,
          const std::function<void(Value&, const AskedKey&, const std::string&)>& visit) {
  if (value.kind == Value::Kind::kScalar) return visit(value, asked, path);
  if (value.kind == Value::Kind::kList && (asked.kinds & (AskedKey::kVector | AskedKey::kMatrix))) {
    if (!value.children.empty()) walk(value.children.front(), asked, path + "[]", visit);
    return;
  }
  for (std::size_t i = 0; i < value.children.size(); ++i) {
    const std::string key = value.kind == Value::Kind::kList ? "[]" : value.keys[i];
    auto below = asked.keys.find(key);
    if (below == asked.keys.end()) below = asked.keys.find("*");
    if (below != asked.keys.end())
      walk(value.children[i], below->second, path.empty() ? key : path + "." + key, visit);
  }
}

/// What its commands are, tick by tick, until something of them is no number.
std::string run(const Experiment& e) {
  Lockstep machine(e.controller, e.plant);
  machine.gate = false;  // whatever the machine says reaches the controller
  for (int tick = 0; tick < kTicksOfEach; ++tick) {
    const TickState& state = machine.step({Request::kStart, {}, {}});
    const Laboratory& lab = state.command.laboratory;
    if (!state.motion.x.allFinite() || !state.reference.allFinite() || !state.legs.L.allFinite() ||
        !lab.E_H.v.allFinite())
      return fmt::format("no number in tick {}", tick);
    for (const std::int32_t count : state.command.counts)
      if (count < 0 || count > 16383) return fmt::format("{} counts in tick {}", count, tick);
  }
  return {};
}

TEST(Settings, AreRefusedInOneLineOrRun) {
  std::set<std::string> seen;
  int refused = 0, ran = 0, number = 0;
  const auto lookAt = [&](Value document) {
    applyOverride(document, "controller.stability=forced");
    applyOverride(document, "controller.stability_uncompensated=forced");
    AskedKey asked;
    askKeys(document, asked);
    walk(document, asked, "", [&](Value& value, const AskedKey& key, const std::string& path) {
      if (!seen.insert(path).second) return;
      const std::string before = value.text;
      for (const std::string& text : extremes(before, key)) {
        if (number++ % kOneOf != 0) continue;
        value.text = text;
        try {
          const Experiment e = buildExperiment(document);
          const std::string wrong = run(e);
          EXPECT_EQ(wrong, "") << path << ": " << text;
          ++ran;
        } catch (const InputError& error) {
          const std::string said = error.what();
          EXPECT_FALSE(said.empty() || said.find('\n') != std::string::npos)
              << path << ": " << said;
          ++refused;
        }
      }
      value.text = before;
    });
  };
  const std::filesystem::path scenarios = test::configDir() + "/scenarios";
  Value all = loadDocument(scenarios / "puma_on_table_4_1.yaml");  // with everything on
  for (const char* set : {"feed_forward=true", "observer=true", "inertia=true", "adaptation=true",
                          "wrench=aided", "learns_masses=true"})
    applyOverride(all, std::string("controller.compensation.") + set);
  applyOverride(all, "controller.passivity.enabled=true");
  applyOverride(all, "sensor.readings_per_tick=4");
  applyOverride(all, "program=[{calibration: {}}, {admittance: {duration_s: 5}}]");
  lookAt(std::move(all));
  const Value keys = parseDocument(test::readText(test::configDir() + "/keys.yaml"), "keys.yaml");
  for (const Value& example : keys.find("examples")->children) {
    Value document = loadDocument(scenarios / (example.find("scenario")->text + ".yaml"));
    for (const Value& set : example.find("set")->children) applyOverride(document, set.text);
    lookAt(std::move(document));
  }
  for (const char* name : {"servicer_capture", "satellite_tumbling", "ship_arm", "deck_puma",
                           "contact_capture_puma", "arm_on_desk", "puma_on_hall"})
    lookAt(loadDocument(scenarios / fmt::format("{}.yaml", name)));
  EXPECT_GT(ran, 400 / kOneOf);
  EXPECT_GT(refused, 50 / kOneOf);
  std::printf("%d ran, %d refused\n", ran, refused);
}

}  // namespace
}  // namespace ves
