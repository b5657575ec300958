// SPDX-License-Identifier: BSD-3-Clause
//
// What a person types: lines of the menu, and --set.
#include <string>

#include "bytes.hpp"
#include "ves/bus/messages.hpp"
#include "ves/console/command.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const ves::Experiment experiment =
      ves::loadExperiment(VES_TEST_CONFIG_DIR "/scenarios/puma_on_table_4_1.yaml");
  const std::string line(reinterpret_cast<const char*>(data), size);
  try {
    const ves::Command command = ves::parseCommand(line, experiment);
    // What the menu lets through, the gate does too.
    if (command.order.request != ves::Request::kNone)
      ves::fuzz::require(
          ves::fromMessage(ves::toMessage(command.order, ves::header({1, 1}, 0, 0))).has_value());
  } catch (const ves::InputError&) {
  }
  try {
    ves::Value document = ves::parseDocument("a: {b: 1, c: [1, 2]}", "base.yaml");
    ves::applyOverride(document, line);
    ves::emit(document);
  } catch (const ves::InputError&) {
  }
  return 0;
}
