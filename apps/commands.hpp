// SPDX-License-Identifier: BSD-3-Clause
//
// The commands of `ves`, each in the file of its name. argv[0] is the command's word; the result is
// the exit status.
#pragma once

namespace ves::app {

int collectCommand(int argc, char** argv);
int acceptCommand(int argc, char** argv);
int commissionCommand(int argc, char** argv);
int compareCommand(int argc, char** argv);
int controllerCommand(int argc, char** argv);
int demoCommand(int argc, char** argv);
int conformCommand(int argc, char** argv);
int doctorCommand(int argc, char** argv);
int faultsCommand(int argc, char** argv);
int identifyCommand(int argc, char** argv);
int netftServerCommand(int argc, char** argv);
int onBusCommand(int argc, char** argv);
int plantCommand(int argc, char** argv);
int platformCommand(int argc, char** argv);
int plotCommand(int argc, char** argv);
int replayCommand(int argc, char** argv);
int keysCommand(int argc, char** argv);
int reportCommand(int argc, char** argv);
int robotCommand(int argc, char** argv);
int runCommand(int argc, char** argv);
int srmsCommand(int argc, char** argv);
int stabilityCommand(int argc, char** argv);
int sweepCommand(int argc, char** argv);
int viewCommand(int argc, char** argv);

}  // namespace ves::app
