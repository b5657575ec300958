#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""`ves netft-server LOG` as other people's clients read it.

    python3 -m venv /tmp/netft && /tmp/netft/bin/pip install pynetft==2.1.3 netft==2.0.1 lcm numpy
    PYTHONPATH=build/release/python /tmp/netft/bin/python tests/tools/netft_clients.py LOG [SECONDS]

Starts the server on free ports, reads its records at 7 kHz with pynetft and with netft, and compares every
count with the log: along straight lines between its samples, at one unknown beginning.
"""
import re
import subprocess
import sys
from pathlib import Path

import lcm
import NetFT
import numpy as np
import pynetft
from ves import truth_t

RATE = 7000  # [1/s]
COUNTS = 1e5  # [1/N | 1/(N m)]


def recorded(log):
    """Times [s] and counts of a log."""
    rows = [truth_t.decode(e.data) for e in lcm.EventLog(log, "r") if e.channel == "VES_TRUTH"]
    times = np.array([m.header.time_ns for m in rows])
    return (times - times[0]) * 1e-9, COUNTS * np.array([m.sensor for m in rows])


def with_pynetft(udp, http, count):
    config = pynetft.Config(sensor_host="127.0.0.1", rdt_port=udp, http_port=http, receive_timeout=1.0,
                            recovery_policy=pynetft.RecoveryPolicy.FAIL_STOP)
    with pynetft.Client(config, queue_size=count) as client:
        samples = client.samples(timeout=3.0)
        got = [next(samples) for _ in range(count)]
        health = client.health()
    assert health.lost_count == health.duplicate_count == health.malformed_count == 0, health
    steps = np.diff([s.rdt_sequence for s in got])
    assert (steps == 1).all(), "records are missing"
    return np.array([s.raw_wrench for s in got])


def with_netft(udp, _http, count):
    sensor = NetFT.Sensor("127.0.0.1")
    sensor.sock.connect(("127.0.0.1", udp))
    sensor.sock.settimeout(3.0)
    sensor.getMeasurements(count)
    return np.array([sensor.receive() for _ in range(count)])


def compare(name, got, times, counts):
    """One unknown: when in the log the first record is."""
    ends = times[-1] - len(got) / RATE

    def off(begin, count):
        t = begin + np.arange(count) / RATE
        return np.abs(got[:count] - np.stack([np.interp(t, times, c) for c in counts.T], axis=1))

    begins = np.arange(0.0, min(5.0, ends), 1.0 / RATE)
    few = min(200, len(got))
    best = min(begins, key=lambda b: off(b, few).max())
    for width in (1e-4, 1e-6, 1e-8):
        best = min(best + np.linspace(-width, width, 401), key=lambda b: off(b, few).max())
    all_off = off(best, len(got))
    print(f"{name}: {len(got)} records from {best:.5f} s on, off by {all_off.max():.2f} counts at most, "
          f"{all_off.mean():.2f} in the mean")


def main():
    log = sys.argv[1]
    count = int(float(sys.argv[2] if len(sys.argv) > 2 else 5.0) * RATE)
    ves = Path(__file__).parents[2] / "build/release/apps/ves"
    times, counts = recorded(log)
    for name, read in (("pynetft", with_pynetft), ("netft", with_netft)):
        server = subprocess.Popen([ves, "netft-server", log, "--port", "0", "--http-port", "0"], text=True,
                                  stdout=subprocess.PIPE)
        udp, http = map(int, re.match(r".*?:(\d+) .*?:(\d+)/", server.stdout.readline()).groups())
        try:
            compare(name, read(udp, http, count), times, counts)
        finally:
            server.terminate()
            server.wait()


if __name__ == "__main__":
    main()
