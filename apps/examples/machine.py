#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A machine of one's own, in real time: what `ves plant` is to a controller (docs/machine.md).

    pip install lcm
    PYTHONPATH=build/release/python python3 apps/examples/machine.py [RATE [URL]]
    ./ves controller z_sine --start          in another terminal

Six legs that follow their reference with a lag, a force sensor that feels nothing but noise, a robot that
stands still. Put your hardware where the four functions of Mock are. Ends with Ctrl-C.
"""
import random
import sys
import time

import lcm
from ves import header_t, leg_command_t, query_t, sample_t, setup_t

SILENCE = 0.5  # [s] without a command, after which another controller may have the legs
LOOPS_CLOSED = 3  # panic button, floor mat


def message(kind, **fields):
    out = kind()
    for name, value in fields.items():
        setattr(out, name, value)
    return out


class Mock:
    """Where the hardware goes."""

    def __init__(self, setup):
        self.counts = [float(n) for n in setup.leg_home]  # Temposonics
        self.pressure = (setup.pressure_min + setup.pressure_max) // 2

    def read_legs(self):
        return [round(n) for n in self.counts]

    def write_legs(self, reference, seconds):
        lag = min(1.0, seconds / 0.05)
        self.counts = [n + lag * (r - n) for n, r in zip(self.counts, reference)]

    def read_sensor(self):
        return [random.randint(-3, 3) for _ in range(6)] + [self.pressure]

    def read_joints(self):
        return [0.0] * 12


class Machine:
    def __init__(self, rate, url):
        self.period = 1.0 / rate
        self.bus = lcm.LCM(url)
        self.setup = self.command = self.hardware = self.reference = None
        self.heard = 0.0
        self.source, self.epoch = random.getrandbits(62), time.time_ns()
        self.sequence = 0
        self.bus.subscribe("VES_SETUP", self.on_setup)
        self.bus.subscribe("VES_LEG_COMMAND", self.on_command)

    def header(self):
        self.sequence += 1
        return message(header_t, time_ns=time.monotonic_ns(), sequence=self.sequence, source=self.source, epoch=self.epoch)

    def on_setup(self, _channel, data):
        self.setup = setup_t.decode(data)
        self.hardware = self.hardware or Mock(self.setup)

    def on_command(self, _channel, data):
        new, old = leg_command_t.decode(data), self.command
        if old and (new.header.source, new.header.epoch) == (old.header.source, old.header.epoch):
            if new.header.sequence < old.header.sequence:
                return  # late on the way
        elif old and (new.header.epoch < old.header.epoch
                      or (old.engaged and time.monotonic() - self.heard < SILENCE)):
            return  # a ghost, or somebody else while the legs are taken
        self.command, self.heard = new, time.monotonic()

    def follow(self):
        """The reference of the legs: the command, or slowly home when nobody commands any more."""
        if not self.command or not self.command.engaged:
            self.reference = None  # they stay where they are
            return
        self.reference = list(self.command.counts)
        silent = time.monotonic() - self.heard - self.setup.park_after_ns * 1e-9
        if silent > 0 and self.command.park:
            share = min(1.0, silent / (self.setup.park_time_ns * 1e-9))
            self.reference = [r + share * (h - r) for r, h in zip(self.reference, self.setup.leg_home)]

    def run(self):
        print("waiting for a controller's VES_SETUP")
        while not self.setup:
            self.bus.publish("VES_QUERY", message(query_t, header=self.header()).encode())
            self.bus.handle_timeout(1000)
        due = time.monotonic()
        while True:
            while self.bus.handle_timeout(0):
                pass
            self.follow()
            if self.reference:
                self.hardware.write_legs(self.reference, self.period)
            self.bus.publish("VES_SAMPLE", message(
                sample_t, header=self.header(), answers=-1, adc=self.hardware.read_sensor(), legs=self.hardware.read_legs(),
                switches=LOOPS_CLOSED, q=self.hardware.read_joints(), temperature=20.0).encode())
            due = max(due + self.period, time.monotonic() - self.period)
            time.sleep(max(0.0, due - time.monotonic()))


if __name__ == "__main__":
    machine = Machine(float(sys.argv[1]) if len(sys.argv) > 1 else 200.0,
                      sys.argv[2] if len(sys.argv) > 2 else "udpm://239.255.76.67:7667?ttl=0")
    try:
        machine.run()
    except KeyboardInterrupt:
        pass
