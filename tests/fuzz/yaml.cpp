// SPDX-License-Identifier: BSD-3-Clause
//
// Configuration: any text is an experiment or one line; what is an experiment reads back the same.
#include <string>

#include "bytes.hpp"
#include "ves/config/experiment.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  try {
    const ves::Value document = ves::parseDocument(text, "fuzz.yaml");
    const std::string emitted = ves::emit(document);
    ves::fuzz::require(ves::emit(ves::parseDocument(emitted, "again.yaml")) == emitted);
    const ves::Experiment e = ves::parseExperiment(text, "fuzz.yaml");
    ves::fuzz::require(ves::parseExperiment(e.source.resolved(), "again").source.hash() ==
                       e.source.hash());
  } catch (const ves::InputError&) {
  }
  return 0;
}
