// SPDX-License-Identifier: BSD-3-Clause
//
// The run on the bus, as it happens. It asks for the configuration (VES_QUERY), and sends what a
// page asks for: a stop and another vehicle to the controller that is shown (VES_OPERATOR), a push
// (VES_ROBOT) and a pace (VES_PACE) to its machine, where all of that is simulated.
#pragma once

#include <cmath>
#include <deque>
#include <optional>
#include <string>

#include "ves/bus/asking.hpp"
#include "ves/evaluation/let_go.hpp"
#include "ves/page/curves.hpp"
#include "ves/page/scene.hpp"
#include "ves/page/web_server.hpp"

namespace ves {

class LiveRun : public LiveSource {
 public:
  /// `results`: where the run leaves them, for the page to say; empty: nobody knows. Throws
  /// InputError when the bus cannot be opened.
  explicit LiveRun(const std::string& url, const std::string& results = "");

  int descriptor() noexcept { return bus_.descriptor(); }
  /// Takes in what has arrived; true when there is something new to show.
  bool listen();

  std::int64_t edition() const override { return edition_; }
  const std::string& scene() const override { return scene_text_; }
  std::int64_t newest() const override { return newest_; }
  /// Three doubles {number, header.time_ns of the state, real-time factor} of the last one; then of
  /// each, the oldest first, the floats of Scene::picture, those of what was asked (a stop, a
  /// vehicle), the pace of the machine, and those of Curves; little-endian. One of every state that
  /// was heard: who draws seldom misses no sample.
  std::string pictures(std::int64_t after, std::int64_t& last) const override;
  void take(const PageMessage& message) override;

 private:
  void takeState(const state_t& state);
  void takeExperiment(const experiment_t& experiment);
  void describe();
  bool follow(const state_t& state);
  void measureRate(const state_t& state);
  void keepPicture();
  void remind();

  Bus bus_;
  std::string results_;
  Identity self_ = Identity::draw();
  std::int64_t sent_ = 0;  // [-] messages

  Identity controller_;       // that is shown
  std::int64_t machine_ = 0;  // [-] header.source of what it commands; 0: not known
  std::int64_t heard_ = 0;    // [ns] its last state
  std::optional<state_t> state_;
  RowMaker rows_;
  std::optional<Row> row_;
  std::int64_t newest_ = 0;
  struct Picture {
    std::int64_t number, time;  // [-], [ns]
    double rate;                // [-]
    std::vector<float> numbers;
  };
  std::deque<Picture> pictures_;  // of this scene, the last the newest

  std::optional<experiment_t> described_;  // the last
  bool warned_ = false;                    // that it cannot be read
  std::optional<Experiment> experiment_;
  std::optional<Scene> scene_;
  std::optional<Curves> curves_;
  std::optional<FollowedBase> base_;  // in free space
  std::string scene_text_;
  std::int64_t edition_ = 0;
  std::int64_t asked_ = 0;  // [ns]

  struct Instant {
    std::int64_t tick, wall;  // [-], [ns]
  };
  std::deque<Instant> instants_;  // of the last second
  double rate_ = NAN;             // [-] real-time factor

  void ask(std::optional<Asking>& asked, Order order);
  std::optional<Asking> stop_, vehicle_;
  double pace_ = NAN;  // [-] as the machine says; NaN: it has none
};

}  // namespace ves
