// SPDX-License-Identifier: BSD-3-Clause
#include "ves/run/session.hpp"

namespace ves {

RunResult runProcesses(const Experiment& experiment, const LaunchOptions& options,
                       const std::function<void(const state_t&)>& watch,
                       const std::function<bool()>& stop) {
  Session session(experiment, options);
  session.onState(watch);
  while (session.running()) {
    session.listen(50);
    if (stop()) session.interrupt();
  }
  return session.result();
}

}  // namespace ves
