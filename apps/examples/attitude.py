#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A flight controller: holds the attitude of a satellite with its thrusters (docs/operator.md).

    ./ves run satellite_jets                in one terminal
    pip install lcm
    PYTHONPATH=build/release/python python3 apps/examples/attitude.py [--band 1] [--foresight 4]

Ten times a second it looks at where the vehicle is, and how it turns. About each axis on which it will be
out of the dead band, as far ahead as it foresees, it has a couple of thrusters on for a tenth of a second.
Ends with the run, or after --patience seconds without one.
"""
import argparse
import math
import random
import sys
import time

import lcm
from ves import operator_t, state_t

THRUST = 13       # operator_t.request
RUNNING = 2       # state_t.phase
ADMITTANCE = 3    # state_t.kind
CYCLE = 0.1       # [s]
# About each axis, of the vehicle of config/scenarios/satellite_jets.yaml: those that turn it, and back.
COUPLES = [((0, 1), (2, 3)), ((4, 5), (6, 7)), ((8, 9), (10, 11))]

options = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
options.add_argument("--band", type=float, default=1.0, help="[deg] dead band")
options.add_argument("--foresight", type=float, default=4.0, help="[s]")
options.add_argument("--patience", type=float, default=20.0, help="[s]")
options = options.parse_args()

state = None
heard = time.monotonic()


def on_state(_channel, data):
    global state, heard
    state, heard = state_t.decode(data), time.monotonic()


def thrust_for(angles, rates):
    """[s] of each thruster."""
    out = [0.0] * 16
    for angle, rate, (up, down) in zip(angles, rates, COUPLES):
        coming = math.degrees(angle + options.foresight * rate)
        if abs(coming) > options.band:
            for thruster in (down if coming > 0 else up):
                out[thruster] = CYCLE
    return out


bus = lcm.LCM("udpm://239.255.76.67:7667?ttl=0")
bus.subscribe("VES_STATE", on_state)
order = operator_t()
order.header.source, order.header.epoch = random.getrandbits(62), time.time_ns()
order.request = THRUST
pulses, begun = [0, 0, 0], False
while time.monotonic() - heard < options.patience:
    cycle = time.monotonic() + CYCLE
    while (left := cycle - time.monotonic()) > 0:
        bus.handle_timeout(max(1, round(1000 * left)))
    emulated = state is not None and state.phase == RUNNING and state.kind == ADMITTANCE
    if begun and not emulated:
        break
    if not emulated:
        continue
    begun = True
    # The axes of these angles are the vehicle's as long as they are small.
    order.thrust = thrust_for(state.x[3:6], state.x_dot[3:6])
    if not any(order.thrust):
        continue
    order.controller = state.header.source
    order.header.sequence += 1
    bus.publish("VES_OPERATOR", order.encode())
    for axis, couple in enumerate(COUPLES):
        pulses[axis] += any(order.thrust[t] for pair in couple for t in pair)
if not begun:
    print("attitude.py: no vehicle was emulated", file=sys.stderr)
    sys.exit(1)
print("pulses about x, y, z:", *pulses)
