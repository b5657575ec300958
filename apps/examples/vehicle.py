#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Changes the vehicle while it is emulated, by an order over the bus (docs/operator.md).

    PYTHONPATH=build/release/python python3 apps/examples/vehicle.py stiffness=2 mass=0.5 over=1

mass, damping, stiffness: times the scenario's, 0.01 to 100; what is not named stays. over: [s] that
the change takes. Needs the module lcm (docs/machine.md). Exit status 0: taken, 1: refused or not
answered, 2: bad input.
"""
import random
import sys
import time

import lcm
from ves import operator_t, state_t

VEHICLE = 11                 # operator_t.request
NONE, CHECKING = 0, 11       # state_t.refusal; messages.md beside the build names the others
PATIENCE = 20.0              # [s] the stability check takes its time

numbers = {"mass": 0.0, "damping": 0.0, "stiffness": 0.0, "over": 0.0}
for argument in sys.argv[1:]:
    name, _, value = argument.partition("=")
    try:
        if name not in numbers:
            raise ValueError
        numbers[name] = float(value)
    except ValueError:
        print(f"vehicle.py: {argument}: want mass, damping, stiffness or over, = and a number", file=sys.stderr)
        sys.exit(2)

state = None


def heard(_channel, data):
    global state
    state = state_t.decode(data)


bus = lcm.LCM("udpm://239.255.76.67:7667?ttl=0")
bus.subscribe("VES_STATE", heard)
end = time.monotonic() + PATIENCE
while state is None and time.monotonic() < end:
    bus.handle_timeout(100)
if state is None:
    print("vehicle.py: no controller is to be heard", file=sys.stderr)
    sys.exit(1)

order = operator_t()
order.header.source = random.getrandbits(62)
order.header.epoch = time.time_ns()
order.controller = state.header.source
order.request = VEHICLE
order.vehicle_mass, order.vehicle_damping = numbers["mass"], numbers["damping"]
order.vehicle_stiffness, order.vehicle_over = numbers["stiffness"], numbers["over"]
while time.monotonic() < end:
    bus.publish("VES_OPERATOR", order.encode())  # the same again is one order
    again = time.monotonic() + 0.2
    while time.monotonic() < again:
        bus.handle_timeout(20)
        if state.order_source == order.header.source and state.refusal != CHECKING:
            print("taken" if state.refusal == NONE else f"refused: {state.refusal} (messages.md)")
            sys.exit(0 if state.refusal == NONE else 1)
print("vehicle.py: not answered", file=sys.stderr)
sys.exit(1)
