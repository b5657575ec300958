// SPDX-License-Identifier: BSD-3-Clause
#include "ves/console/form.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "ves/console/command.hpp"
#include "ves/core/coordinates.hpp"
#include "ves/core/errors.hpp"

namespace ves {
namespace {

using Accept = std::function<void(const std::string&)>;  // throws InputError

/// Ends a form early; caught in fillForm.
struct Left {
  std::optional<std::string> command;
};

class Form {
 public:
  Form(const std::string& word, const Experiment& experiment, const Questioner& person)
      : experiment_(experiment), person_(person), text_(word) {}

  std::string fill() {
    switch (parseVerb(text_)) {
      case Verb::kAdmittance: add("seconds", "10", kSeconds); break;
      case Verb::kWait: add("seconds", "1", kSeconds); break;
      case Verb::kTrajectory: trajectory(); break;
      case Verb::kMove:
        for (int i = 0; i < 6; ++i) {
          text_ += fmt::format(" {}", coordinate(i).name);
          add(asItIs(i), "0", reach(i));
        }
        break;
      case Verb::kRobot: robot(); break;
      case Verb::kTool:
        add("to a place, or by a way", "by");
        for (const char* axis : {"x", "y", "z"}) add(axis, "0", between(-1e5, 1e5, "mm"));
        add("seconds", "5", kSeconds);
        add(fmt::format("axes of, one of {}", fmt::join(kToolFrameNames, " ")), "robot");
        break;
      case Verb::kVehicle:
        text_ += " in";
        add("seconds", "2", kSeconds);
        for (const char* factor : {"mass", "damping", "stiffness"}) {
          text_ += fmt::format(" {}", factor);
          add(fmt::format("{}, times the scenario's", factor), "1",
              between(kLeastVehicleFactor, kMostVehicleFactor, "times"));
        }
        break;
      case Verb::kThrust:
        add("seconds", "1", between(1e-3, kLongestThrust, "s"));
        add("thrusters, from 0", "0");
        break;
      case Verb::kGrasp: add("kg", "1", between(0.0, 1e6, "kg")); break;
      case Verb::kCollect:
        add("file", "collected.csv");
        add("seconds", "10", kSeconds);
        add("rows per second", "100", between(1e-4, 1e4, "Hz"));
        add("variables: beginnings of names, as in series.csv",
            "x_ y_ z_ fx_dynamic fy_dynamic fz_dynamic");
        break;
      default: break;
    }
    return text_;
  }

 private:
  void trajectory() {
    add("seconds", "3", kSeconds);
    for (int i = 0; i < 6; ++i) {
      const Coordinate& c = coordinate(i);
      const std::string motion =
          answer(asItIs(i) + ": stay, ramp or sine", "stay", [](const std::string& text) {
            if (text != "stay" && text != "ramp" && text != "sine")
              throw InputError(fmt::format("'{}', want stay, ramp or sine", text));
          });
      if (motion == "stay") continue;
      text_ += fmt::format(" {} {}", c.name, motion);
      if (motion == "ramp") {
        add(fmt::format("  {} at the end, {}", c.name, c.shown_unit), "0", reach(i));
      } else {
        add(fmt::format("  amplitude, {}", c.shown_unit), "0", reach(i));
        add("  frequency, Hz", "0.5", between(0.0, 50.0, "Hz"));
      }
    }
  }

  void robot() {
    const auto& names = experiment_.robot.joint_names;
    add(fmt::format("joint, one of {}", fmt::join(names, " ")), names.empty() ? "none" : names[0]);
    add("to, deg or mm", "0", between(-1e4, 1e4, "deg or mm"));
    add("seconds", "5", kSeconds);
  }

  void add(const std::string& question, const std::string& otherwise,
           const Accept& accept = nullptr) {
    text_ += " " + answer(question, otherwise, accept);
  }

  /// A word for an empty line; asked again until `accept` has nothing to say.
  std::string answer(const std::string& question, const std::string& otherwise,
                     const Accept& accept) {
    for (;;) {
      auto text = person_.line(fmt::format("  {} [{}]: ", question, otherwise));
      if (!text) throw Left{};
      text->erase(0, text->find_first_not_of(" \t\r"));
      text->erase(text->find_last_not_of(" \t\r") + 1);
      if (text->empty()) text = otherwise;
      if (*text == "hold" || *text == "stop") throw Left{*text};
      if (*text == "back" || text->find('\033') != std::string::npos) throw Left{""};
      try {
        if (accept) accept(*text);
        return *text;
      } catch (const InputError& error) {
        person_.say(std::string("    ") + error.what());
      }
    }
  }

  std::string asItIs(int i) const {
    return fmt::format("{}, now {} {}", coordinate(i).name, person_.now(i),
                       coordinate(i).shown_unit);
  }

  static Accept between(double lo, double hi, const char* unit) {
    return [=](const std::string& text) { parseNumber(text, "that", lo, hi, unit); };
  }

  Accept reach(int i) const {
    const SafetyLimits& limits = experiment_.controller.safety;
    const double most = (i < 3 ? limits.translation : limits.rotation) * coordinate(i).shown;
    return between(-most, most, i < 3 ? "mm" : "deg");
  }

  inline static const Accept kSeconds = between(0.01, 1e5, "s");

  const Experiment& experiment_;
  const Questioner& person_;
  std::string text_;
};

}  // namespace

std::optional<std::string> fillForm(const std::string& word, const Experiment& experiment,
                                    const Questioner& person) {
  try {
    return Form(word, experiment, person).fill();
  } catch (const Left& left) {
    return left.command;
  }
}

}  // namespace ves
