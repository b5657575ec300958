// SPDX-License-Identifier: BSD-3-Clause
//
// The run on the bus, as it happens. Only listens, but for two messages: it asks for the
// configuration (VES_QUERY), and asks the controller that is shown to stop (VES_OPERATOR).
#pragma once

#include <cmath>
#include <deque>
#include <future>
#include <optional>
#include <string>

#include "ves/bus/bus.hpp"
#include "ves/page/scene.hpp"
#include "ves/page/web_server.hpp"

namespace ves {

class LiveRun : public LiveSource {
 public:
  /// Throws InputError when the bus cannot be opened.
  explicit LiveRun(const std::string& url);

  int descriptor() noexcept { return bus_.descriptor(); }
  /// Takes in what has arrived; true when there is something new to show.
  bool listen();

  std::int64_t edition() const override { return edition_; }
  const std::string& scene() const override { return scene_text_; }
  std::int64_t newest() const override { return newest_; }
  /// Three doubles {number, header.time_ns of the state, real-time factor} of the last one; then of
  /// each, the oldest first, the floats of Scene::picture, the real-time factor, and 1 when a stop
  /// was requested, 2 when the controller has taken it; little-endian. One of every state that was
  /// heard: who draws seldom misses no sample.
  std::string pictures(std::int64_t after, std::int64_t& last) const override;
  void requestStop(std::int64_t edition) override;

 private:
  void takeState(const state_t& state);
  void takeExperiment(const experiment_t& experiment);
  void describe();
  bool follow(const state_t& state);
  void followBase(const state_t& state);
  void measureRate(const state_t& state);
  void keepPicture();
  void remind();

  Bus bus_;
  Identity self_ = Identity::draw();
  std::int64_t sent_ = 0;  // [-] messages

  Identity controller_;     // that is shown
  std::int64_t heard_ = 0;  // [ns] its last state
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
  std::string scene_text_;
  std::int64_t edition_ = 0;
  std::int64_t asked_ = 0;  // [ns]

  std::future<std::optional<Motion>> computing_;
  std::optional<Motion> base_;
  struct LetGo {
    std::int64_t tick;
    Vec6 x;  // [m, rad] from home
    bool computed;
  };
  std::optional<LetGo> let_go_;

  struct Instant {
    std::int64_t tick, wall;  // [-], [ns]
  };
  std::deque<Instant> instants_;  // of the last second
  double rate_ = NAN;             // [-] real-time factor

  struct Stop {
    std::int64_t sequence, sent;  // [-], [ns]
    int times;                    // [-] to send it still
    bool taken = false;
  };
  std::optional<Stop> stop_;
};

}  // namespace ves
