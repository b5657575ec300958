// SPDX-License-Identifier: BSD-3-Clause
//
// One experiment from its scenario file: what the controller is told, what the plant is, and the
// text both came from.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "ves/config/calibration.hpp"
#include "ves/config/document.hpp"
#include "ves/config/urdf.hpp"
#include "ves/control/test_platform.hpp"
#include "ves/plant/plant.hpp"
#include "ves/srms/arm.hpp"
#include "ves/srms/interaction.hpp"

namespace ves {

/// Where a piece of the machine is.
struct Simulated {};
struct External {};  // a driver on the bus

/// A force sensor that speaks ATI's RDT.
struct NetFtAddress {
  std::string host;
  int port = 0;       // [-] UDP, of its records
  int http_port = 0;  // [-] of its configuration
};

/// A force sensor that sends frames or lines by itself, described in a scenario.
struct StreamSource {
  enum class From { kSerial, kUdp, kPipe };
  enum class Value { kText, kInt16, kInt32, kFloat32 };  // text: numbers in lines
  enum class Checksum { kNone, kSum8, kXor8, kCrc16Modbus, kCrc16X25, kCrc32 };

  From from = From::kSerial;
  std::string path;  // of the device or pipe
  int port = 0;      // [-] UDP
  int baud = 0;      // [bit/s] of a serial line
  Value value = Value::kText;
  std::string separators;  // of text, beside blanks
  int first = 0;           // [-] of a line's numbers; [B] in a frame
  bool big_endian = false;
  std::vector<std::uint8_t> sync;  // that a frame begins with
  int length = 0;                  // [B] of a frame
  Checksum checksum = Checksum::kNone;
  int checksum_from = 0, checksum_to = 0,
      checksum_at = 0;            // [B] in a frame; `to` is behind the last
  std::array<int, 6> channels{};  // the component of {S} that each of the six values is
  Vec6 scale = Vec6::Ones();      // [N | N m] of one unit of each value
};

/// A driver of force sensors has its own kind; config/machine.cpp reads it, devices/machine.cpp
/// makes it.
using ForceSensorSource = std::variant<Simulated, External, NetFtAddress, StreamSource>;

/// Which pieces of the machine are real, and how they are reached. The simulated ones are the
/// plant's.
struct MachinePieces {
  bool external_legs = false;  // else simulated
  bool external_robot = false;
  bool external_switches = false;
  ForceSensorSource force_sensor;
  std::int64_t period = 0;  // [ns] between samples, in real time
  double follow = 0.0;      // [1/s] bandwidth at which simulated pieces follow real legs and joints

  bool simulated() const {
    return !external_legs && !external_robot && !external_switches &&
           std::holds_alternative<Simulated>(force_sensor);
  }
};

/// Where the numbers of an experiment came from.
struct Provenance {
  Value document;                                // what it was built from, URDF inside
  int substitutes = 0;                           // [-] numbers that stand in for unknown ones
  std::optional<CalibrationRecord> calibration;  // that the bias comes from
  std::vector<std::string> warnings;
  std::vector<std::string> notes;  // known oddities of a robot's file

  /// The document as YAML; parseExperiment() reads it back.
  std::string resolved() const;
  /// Of resolved().
  std::string hash() const;
  /// Of what a calibration depends on: sensor, robot, gravity, masses.
  std::string calibrated() const;
};

/// One experiment, complete. What judges or decides for the controller takes the controller's part
/// and the task, and cannot see the rest.
struct Experiment {
  std::string name;
  std::string description;
  ControllerConfig controller;  // what it believes, and what is asked of it
  plant::PlantConfig plant;     // what the simulated machine is; `task`: what is asked of the robot
  MachinePieces machine;        // which pieces are real
  std::string key_file;         // of the bus; empty: none
  UrdfRobot robot;              // as configured, with its looks; without frames: none
  std::optional<ArmShape> arm;  // that the vehicle is the tip of
  Provenance source;
};

/// What a machine has been found to be: the sections of a scenario that a belief file holds.
inline constexpr std::array<const char*, 3> kBeliefKeys{"calibration", "masses", "servo"};

/// Files that calibrations, identifications and commissionings have left; empty: none.
struct BeliefFiles {
  std::filesystem::path calibration = {}, masses = {}, servo = {};  // one section each
  std::filesystem::path belief = {};  // any of them; a file of one alone goes before
};

/// Reads a scenario file; `overrides` are "key.path=value". Throws InputError.
Experiment loadExperiment(const std::filesystem::path& file,
                          const std::vector<std::string>& overrides = {},
                          const BeliefFiles& files = {});

/// The same from a document that is in memory.
Experiment buildExperiment(Value document, const std::vector<std::string>& overrides = {});

/// Builds it for what its readers ask on the way.
void askKeys(const Value& document, AskedKey& asked);

/// Reads back what Provenance::resolved() wrote; `name` stands for a file name in messages.
Experiment parseExperiment(const std::string& resolved, const std::string& name);

/// Looks whether the experiment's admittance control decays, and writes the verdict into its
/// controller and its document. Without it admittance control is refused. Returns the
/// explanation where the loop would diverge; empty when all is well.
std::string applyStabilityCheck(Experiment& experiment);

/// The same; throws InputError where the program wants admittance control that would diverge, and
/// nobody forces it.
std::string requireStability(Experiment& experiment);

/// Why the machine is not pushed so; empty: it is.
std::string whyNotPushed(const Experiment& experiment, const PushOrder& order);

/// Robot and base of the program's first admittance segment, from its start, for the simulation of
/// chapter 3; `duration` [ns] of the segment. Throws InputError when there is none.
Interaction interactionOf(const Experiment& experiment, std::int64_t& duration);

/// The file of a scenario given by path or by its name in `config`/scenarios. Throws InputError,
/// listing what there is.
std::filesystem::path findScenario(const std::string& scenario,
                                   const std::filesystem::path& config);

}  // namespace ves
