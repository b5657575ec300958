// SPDX-License-Identifier: BSD-3-Clause
#include "ves/page/live_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "ves/bus/channels.hpp"
#include "ves/realtime/realtime.hpp"

namespace ves {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;  // [ns]

}  // namespace

LiveRun::LiveRun(const std::string& url, const std::string& results)
    : bus_(url), results_(results) {
  bus_.subscribe({channel::kSample, channel::kState, channel::kTruth, channel::kTiming,
                  channel::kExperiment, channel::kLegCommand, channel::kPace},
                 [this](const std::string& channel, const void* data, std::uint32_t size) {
                   if (channel == channel::kState) {
                     if (const auto m = decode<state_t>(data, size)) takeState(*m);
                   } else if (channel == channel::kExperiment) {
                     if (const auto m = decode<experiment_t>(data, size)) takeExperiment(*m);
                   } else if (channel == channel::kLegCommand) {
                     const auto m = decode<leg_command_t>(data, size);
                     if (m && m->header.source == controller_.source) machine_ = m->machine;
                   } else if (channel == channel::kPace) {
                     const auto m = decode<pace_t>(data, size);
                     if (m && machine_ != 0 && m->header.source == machine_) pace_ = m->rate;
                   } else if (channel == channel::kTruth) {
                     if (const auto m = decode<truth_t>(data, size)) rows_.add(*m);
                   } else if (channel == channel::kSample) {
                     if (const auto m = decode<sample_t>(data, size)) {
                       rows_.add(*m);
                       machine_ = m->header.source;
                     }
                   } else if (const auto m = decode<timing_t>(data, size)) {
                     if (m->header.source == controller_.source) rows_.add(*m);
                   }
                 });
}

bool LiveRun::listen() {
  const std::int64_t newest = newest_, edition = edition_;
  bus_.drain();
  remind();
  return newest_ != newest || edition_ != edition;
}

/// Whether to show this controller's states. The one with the legs goes before one without, then
/// the one that began last; one that is silent goes behind all.
bool LiveRun::follow(const state_t& state) {
  const Identity from{state.header.source, state.header.epoch};
  if (from.source == controller_.source && from.epoch == controller_.epoch) return true;
  const bool shown = state_ && monotonicNow() - heard_ < kSecond;
  const bool engaged = state.engaged != 0, other = shown && state_->engaged != 0;
  if (shown && (engaged == other ? from.epoch < controller_.epoch : other)) return false;
  controller_ = from;
  machine_ = 0;
  state_.reset();
  rows_ = {};
  row_.reset();
  pictures_.clear();
  experiment_.reset();
  scene_.reset();
  curves_.reset();
  base_.reset();
  stop_.reset();
  vehicle_.reset();
  instants_.clear();
  rate_ = pace_ = NAN;
  asked_ = 0;
  return true;
}

void LiveRun::takeState(const state_t& state) {
  if (!follow(state)) return;
  state_ = state;
  heard_ = monotonicNow();
  describe();
  measureRate(state);
  for (std::optional<Asking>* asked : {&stop_, &vehicle_})
    if (*asked) (*asked)->hear(state);
  const auto row = rows_.add(state);
  if (!row || !scene_) return;
  row_ = *row;
  base_->add(*row);
  // Who joins late has the same time.
  row_->t = static_cast<double>(row_->state.header.sequence * experiment_->controller.period) *
            kSecondPerNanosecond;
  ++newest_;
  keepPicture();
}

void LiveRun::takeExperiment(const experiment_t& experiment) {
  if (!described_ || experiment.header.epoch >= described_->header.epoch) described_ = experiment;
  describe();
}

/// The scene, once configuration and controller are known.
void LiveRun::describe() {
  if (scene_ || !described_ || described_->header.source != controller_.source) return;
  try {
    experiment_ = parseExperiment(described_->resolved, channel::kExperiment);
    scene_.emplace(*experiment_);
    curves_.emplace(*experiment_);
    base_.emplace(*experiment_);
  } catch (const InputError& error) {
    if (!std::exchange(warned_, true)) fmt::print(stderr, "ves view: {}\n", error.what());
    experiment_.reset();
    described_.reset();
    return;
  }
  for (const std::string& warning : scene_->warnings())
    fmt::print(stderr, "warning: {}\n", warning);
  ++edition_;
  nlohmann::ordered_json text;
  text["edition"] = edition_;
  text["scene"] = scene_->description();
  text["scene"]["results"] = results_;
  auto& scalars = text["scene"]["scalars"];
  for (const char* name :
       {"stop_asked", "stop_refusal", "vehicle_asked", "vehicle_refusal", "pace"})
    scalars.push_back(name);
  auto refusals = nlohmann::ordered_json::array();
  for (int i = 0; i < static_cast<int>(Refusal::kCount); ++i)
    refusals.push_back(name(static_cast<Refusal>(i)));
  text["scene"]["refusals"] = refusals;
  text["columns"] = curves_->description();
  text["columns"].push_back({{"name", "real_time_factor"}, {"meaning", "of the last second"}});
  text["width"] = scene_->width() + 5 + curves_->size() + 1;
  scene_text_ = text.dump();
}

void LiveRun::measureRate(const state_t& state) {
  instants_.push_back({state.header.sequence, heard_});
  while (instants_.size() > 2 && heard_ - instants_[1].wall > kSecond) instants_.pop_front();
  const std::int64_t wall = heard_ - instants_.front().wall;
  rate_ = wall < kSecond / 2 || !experiment_
              ? NAN
              : static_cast<double>((state.header.sequence - instants_.front().tick) *
                                    experiment_->controller.period) /
                    static_cast<double>(wall);
}

/// Asks again for what has not come.
void LiveRun::remind() {
  const std::int64_t now = monotonicNow();
  if (state_ && !scene_ && now - heard_ < kSecond && now - asked_ > kSecond) {
    asked_ = now;
    query_t query;
    query.header = header(self_, sent_++, now);
    bus_.publish(channel::kQuery, query);
  }
  for (std::optional<Asking>* asked : {&stop_, &vehicle_})
    if (*asked) (*asked)->say(bus_, now);
}

void LiveRun::ask(std::optional<Asking>& asked, Order order) {
  order.controller = controller_.source;
  asked.emplace(order, self_, sent_++).say(bus_, monotonicNow());
}

void LiveRun::take(const PageMessage& message) {
  if (message.edition != edition_ || !scene_) return;
  const auto* push = std::get_if<PushOrder>(&message.what);
  const auto* vehicle = std::get_if<VehicleOrder>(&message.what);
  const auto* pace = std::get_if<PageMessage::Pace>(&message.what);
  if (push || pace || vehicle) {  // of a machine with real pieces only a stop
    if (!experiment_->machine.simulated()) return;
    if (push && !whyNotPushed(*experiment_, *push).empty()) return;
    if ((push || pace) && machine_ == 0) return;
  }
  const std::int64_t now = monotonicNow();
  if (push) {
    robot_command_t order = toMessage(*push, header(self_, sent_++, now));
    order.machine = machine_;
    bus_.publish(channel::kRobot, order);
  } else if (vehicle) {
    Order order{Request::kVehicle, {}, {}};
    order.vehicle = *vehicle;
    ask(vehicle_, order);  // the newest counts
  } else if (pace) {
    bus_.publish(channel::kPace, pace_t{header(self_, sent_++, now), machine_, pace->rate});
  } else if (!stop_ || !stop_->underWay()) {
    ask(stop_, Order{Request::kStop, {}, {}});
  }
}

void LiveRun::keepPicture() {
  constexpr std::size_t kKept = 6000;  // [-] a minute at 100 Hz
  const std::optional<Vec6> base = base_->at(row_->state);
  Picture one{newest_, row_->state.header.time_ns, rate_, scene_->picture(*row_, base)};
  // 0: nothing asked, 1: not answered yet, 2: answered, and how, 3: no answer came
  const auto tell = [&](const std::optional<Asking>& asked) {
    one.numbers.push_back(!asked ? 0.0f : asked->answer() ? 2.0f : asked->underWay() ? 1.0f : 3.0f);
    one.numbers.push_back(
        asked && asked->answer() ? static_cast<float>(static_cast<int>(*asked->answer())) : NAN);
  };
  tell(stop_);
  tell(vehicle_);
  one.numbers.push_back(static_cast<float>(pace_));
  const std::vector<float> curves = curves_->of(*row_, base);
  one.numbers.insert(one.numbers.end(), curves.begin(), curves.end());
  one.numbers.push_back(static_cast<float>(rate_));
  pictures_.push_back(std::move(one));
  if (pictures_.size() > kKept) pictures_.pop_front();
}

std::string LiveRun::pictures(std::int64_t after, std::int64_t& last) const {
  constexpr std::int64_t kMost = 500;  // [-] in a message
  if (pictures_.empty()) return {};
  const std::int64_t oldest = pictures_.front().number, newest = pictures_.back().number;
  if (after >= newest) return {};
  const std::int64_t first = std::max(after + 1, oldest);
  last = std::min(newest, first + kMost - 1);
  const auto at = [&](std::int64_t number) -> const Picture& {
    return pictures_[static_cast<std::size_t>(number - oldest)];
  };
  const double head[] = {static_cast<double>(last), static_cast<double>(at(last).time),
                         at(last).rate};
  std::string out(reinterpret_cast<const char*>(head), sizeof head);
  for (std::int64_t number = first; number <= last; ++number) {
    const std::vector<float>& numbers = at(number).numbers;
    out.append(reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(float));
  }
  return out;
}

}  // namespace ves
