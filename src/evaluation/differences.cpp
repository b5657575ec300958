// SPDX-License-Identifier: BSD-3-Clause
#include "ves/evaluation/differences.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>

namespace ves {
namespace {

using Leaves = std::vector<std::pair<std::string, std::string>>;  // in their order

constexpr std::size_t kShown = 60;  // [-] letters of a value

std::string shown(const std::string& text) {
  if (text.size() <= kShown && text.find('\n') == std::string::npos) return text;
  return fmt::format("{} bytes, {}", text.size(), fingerprint(text));
}

void collect(const Value& value, const std::string& path, Leaves& out) {
  switch (value.kind) {
    case Value::Kind::kScalar: out.emplace_back(path, shown(value.text)); break;
    case Value::Kind::kMap:
      for (std::size_t i = 0; i < value.keys.size(); ++i)
        collect(value.children[i], path.empty() ? value.keys[i] : path + "." + value.keys[i], out);
      break;
    case Value::Kind::kNull: out.emplace_back(path, "nothing"); break;
    case Value::Kind::kList:
      for (std::size_t i = 0; i < value.children.size(); ++i)
        collect(value.children[i], fmt::format("{}[{}]", path, i), out);
  }
}

void collect(const nlohmann::ordered_json& value, const std::string& path, Leaves& out) {
  if (value.is_object() || value.is_array()) {
    for (const auto& [key, child] : value.items())
      collect(child,
              value.is_array() ? fmt::format("{}[{}]", path, key)
                               : (path.empty() ? key : path + "." + key),
              out);
  } else if (value.is_number_float()) {
    out.emplace_back(path, fmt::format("{:.6g}", value.get<double>()));
  } else {
    out.emplace_back(path, shown(value.is_string() ? value.get<std::string>() : value.dump()));
  }
}

std::vector<KeyDifference> differences(const std::vector<Leaves>& runs) {
  std::vector<std::string> keys;
  std::vector<std::map<std::string, std::string>> values;
  for (const Leaves& leaves : runs) {
    for (const auto& [key, text] : leaves)
      if (std::find(keys.begin(), keys.end(), key) == keys.end()) keys.push_back(key);
    values.emplace_back(leaves.begin(), leaves.end());
  }
  std::vector<KeyDifference> out;
  for (const std::string& key : keys) {
    KeyDifference one{key, {}};
    for (const auto& run : values) {
      const auto at = run.find(key);
      one.values.push_back(at == run.end() ? "-" : at->second);
    }
    if (std::any_of(one.values.begin(), one.values.end(),
                    [&](const std::string& value) { return value != one.values.front(); }))
      out.push_back(one);
  }
  return out;
}

}  // namespace

std::vector<KeyDifference> configurationDifferences(const std::vector<const Experiment*>& runs) {
  std::vector<Leaves> all;
  for (const Experiment* run : runs) collect(run->source.document, "", all.emplace_back());
  return differences(all);
}

std::vector<KeyDifference> summaryDifferences(const std::vector<nlohmann::ordered_json>& runs) {
  constexpr std::string_view kMachines[] = {"wall_s",   "real_time_factor",   "version",
                                            "wake_up_", "tick_compute_",      "stage_",
                                            "sample_",  "configuration_hash", "description"};
  std::vector<Leaves> all;
  for (const nlohmann::ordered_json& run : runs) {
    Leaves leaves;
    collect(run, "", leaves);
    leaves.erase(std::remove_if(leaves.begin(), leaves.end(),
                                [&](const auto& leaf) {
                                  return std::any_of(std::begin(kMachines), std::end(kMachines),
                                                     [&](std::string_view begin) {
                                                       return leaf.first.rfind(begin, 0) == 0;
                                                     });
                                }),
                 leaves.end());
    all.push_back(leaves);
  }
  return differences(all);
}

RunResult resultOf(const Series& series) {
  RunResult out;
  out.ticks = static_cast<std::int64_t>(series.rows.size());
  if (series.rows.empty()) return out;
  const state_t& last = series.rows.back().state;
  out.phase = static_cast<Phase>(last.phase);
  out.aborted = last.aborted != 0;
  if (out.phase == Phase::kStopped) {
    out.cause = static_cast<Check>(last.cause);
    out.cause_tick = last.cause_tick;
  } else if (out.phase == Phase::kDisarmed) {
    out.cause = Tripped(static_cast<std::uint32_t>(last.tripped)).first();
    out.cause_tick = last.header.sequence;
  }
  out.simulated =
      static_cast<double>((last.header.sequence + 1) * series.experiment.controller.period) *
      kSecondPerNanosecond;
  return out;
}

}  // namespace ves
