#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A machine of one's own, or one piece of it, in real time (docs/machine.md).

    pip install lcm
    PYTHONPATH=build/release/python python3 apps/examples/machine.py [--rate 200] [--piece legs]
    ./ves controller z_sine --start          in another terminal

Legs that follow their reference with a lag, a force sensor that feels noise, a robot that stands still: put your
hardware where the four functions of Mock are. Ends with Ctrl-C.
"""
import argparse
import random
import signal
import time

import lcm
from ves import header_t, leg_command_t, query_t, sample_t, setup_t

SILENCE = 500_000_000  # [ns] without a command, after which another controller may have the legs
LOOPS_CLOSED = 3  # panic button, floor mat
CHANNELS = {"machine": "SAMPLE", "legs": "LEGS", "wrench": "WRENCH", "joints": "JOINTS", "switches": "SWITCHES"}


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

    def write_legs(self, reference, seconds):  # None: stay
        lag = min(1.0, seconds / 0.05)
        self.counts = [n + lag * (r - n) for n, r in zip(self.counts, reference or self.counts)]

    def read_sensor(self):
        return [random.randint(-3, 3) for _ in range(6)] + [self.pressure]

    def read_joints(self):
        return [0.0] * 12


class Machine:
    def __init__(self, rate, url, piece):
        self.period, self.channel = 1.0 / rate, "VES_" + CHANNELS[piece]
        self.bus = lcm.LCM(url)
        self.setup = self.command = self.engaged = self.rest = self.hardware = None
        self.heard = self.sequence = 0  # [ns] when the command came; [-] of our messages
        self.source, self.epoch = random.getrandbits(62), time.time_ns()
        self.bus.subscribe("VES_SETUP", self.on_setup)
        self.bus.subscribe("VES_LEG_COMMAND", self.on_command)

    def header(self):
        now, self.sequence = time.monotonic_ns(), self.sequence + 1
        return message(header_t, time_ns=now, sequence=self.sequence, source=self.source, epoch=self.epoch)

    def on_setup(self, _channel, data):
        self.setup = setup_t.decode(data)
        self.hardware = self.hardware or Mock(self.setup)

    def on_command(self, _channel, data):
        new, old = leg_command_t.decode(data), self.command
        same = old and (new.header.source, new.header.epoch) == (old.header.source, old.header.epoch)
        if new.machine not in (0, self.source) and self.channel == "VES_SAMPLE":
            return  # for another machine
        if same and new.header.sequence < old.header.sequence:
            return  # late on the way
        taken = old and old.engaged and time.monotonic_ns() - self.heard < SILENCE
        if old and not same and (taken or new.header.epoch < old.header.epoch):
            return  # somebody else while the legs are taken, or a ghost
        if new.engaged:
            self.engaged, self.rest = new, new.rest
        elif self.engaged:  # somebody is there, and asks for nothing: they stay where they were led
            self.rest = self.reference() if time.monotonic_ns() - self.heard > self.setup.park_after_ns else self.rest
        self.command, self.heard = new, time.monotonic_ns()

    def reference(self):
        """What the legs follow (docs/machine.md, States); None: they stay."""
        engaged, home, setup = self.engaged, self.setup.leg_home, self.setup
        if not engaged:
            return None
        silent = time.monotonic_ns() - self.heard
        if self.command.engaged and silent < setup.hold_after_ns:
            return engaged.counts
        share = max(0, silent - setup.park_after_ns) / setup.park_time_ns if engaged.park else 0.0
        return [r + min(1.0, share) * (h - r) for r, h in zip(self.rest, home)]

    def sample(self):
        last = self.command.header if self.command else header_t()
        return message(
            sample_t, header=self.header(), answers=-1, adc=self.hardware.read_sensor(), temperature=20.0,
            legs=self.hardware.read_legs(), q=self.hardware.read_joints(), switches=LOOPS_CLOSED,
            command_source=last.source, command_sequence=last.sequence, command_time_ns=self.heard)

    def run(self):
        print("waiting for a controller's VES_SETUP", flush=True)
        while not self.setup:
            self.bus.publish("VES_QUERY", message(query_t, header=self.header()).encode())
            self.bus.handle_timeout(1000)
        due = time.monotonic()
        while True:
            while self.bus.handle_timeout(0):
                pass
            self.hardware.write_legs(self.reference(), self.period)
            self.bus.publish(self.channel, self.sample().encode())
            due = max(due + self.period, time.monotonic() - self.period)
            time.sleep(max(0.0, due - time.monotonic()))


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--rate", type=float, default=200.0, help="[1/s] samples")
    parser.add_argument("--url", default="udpm://239.255.76.67:7667?ttl=0")
    parser.add_argument("--piece", choices=CHANNELS, default="machine", help="the whole, or one piece")
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    Machine(**vars(parser.parse_args())).run()
