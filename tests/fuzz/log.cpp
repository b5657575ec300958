// SPDX-License-Identifier: BSD-3-Clause
//
// The reader of event logs: any bytes are events or one line, never more.
#include <unistd.h>

#include <cstdio>
#include <string>

#include "bytes.hpp"
#include "ves/bus/event_log.hpp"
#include "ves/core/errors.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::string file = "/dev/shm/ves_fuzz_log_" + std::to_string(getpid());
  std::FILE* out = std::fopen(file.c_str(), "wb");
  if (!out) return 0;
  if (size > 0) std::fwrite(data, 1, size, out);
  std::fclose(out);
  try {
    ves::LogReader reader(file);
    ves::LogEvent event;
    while (reader.next(event)) ves::fuzz::require(event.data.size() <= size);
  } catch (const ves::InputError&) {
  }
  std::remove(file.c_str());
  return 0;
}
