#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Plots the platform's pose as it moves, from the bus: a client in another language.

    pip install lcm matplotlib
    PYTHONPATH=build/release/python python3 apps/examples/live_pose.py [SECONDS [PICTURE]]

The message types are generated from lcmtypes/ by the build.
"""
import collections
import math
import sys
import time

import lcm
import matplotlib.pyplot as plt
from ves import state_t

seconds = float(sys.argv[1]) if len(sys.argv) > 1 else math.inf
picture = sys.argv[2] if len(sys.argv) > 2 else None
history = collections.deque(maxlen=2000)  # 20 s


def remember(_channel, data):
    state = state_t.decode(data)
    history.append((state.header.time_ns * 1e-9, *state.x, *state.x_measured))


bus = lcm.LCM("udpm://239.255.76.67:7667?ttl=0")
bus.subscribe("VES_STATE", remember).set_queue_capacity(1000)
figure, axes = plt.subplots(2, 3, figsize=(12, 6), sharex=True, layout="constrained")
end = time.monotonic() + seconds
while time.monotonic() < end and plt.fignum_exists(figure.number):
    while bus.handle_timeout(20) and time.monotonic() < end:  # [ms]; a pause lets the picture in
        pass
    for i, (axis, name) in enumerate(zip(axes.flat, ["x", "y", "z", "alpha", "beta", "gamma"])):
        scale, unit = (1e3, "mm") if i < 3 else (180 / math.pi, "deg")
        axis.clear()
        axis.set_title(f"{name} [{unit}]")
        axis.set_xlabel("time [s]" if i > 2 else "")
        for column, label in ((1 + i, "commanded"), (7 + i, "measured")):
            axis.plot([row[0] - history[0][0] for row in history],
                      [row[column] * scale for row in history], label=label)
    axes.flat[0].legend()
    plt.pause(0.05)
if picture:
    figure.savefig(picture)
