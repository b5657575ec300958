#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""What is kept of a force that no model knows, behind an aided wrench: the table of docs/compensation.md.

  ./ves python tests/tools/pushes.py [SEEDS [KEY=VALUE ...]]

A step of one channel of the sensor two seconds into admittance control, six modes, noise on. Of the
base's motion that it makes without noise and aid, the share that is left, position / rotation: the mean
over SEEDS (16), and the least and the most of position. The keys are set besides.
"""
import concurrent.futures
import sys

import numpy
import ves

COMPENSATION = "controller.compensation."
SETTINGS = {COMPENSATION + part: "true" for part in ("feed_forward", "observer", "inertia")} | {
    "sensor.readings_per_tick": 4, "base.keep_modes": 6,
    "controller.stability": "forced", "controller.stability_uncompensated": "forced"}
SENSITIVITY = {"x": (1, 0.66719), "z": (3, 0.17115)}  # channel, [uV/V per N], config/ves.yaml
COUNTS = 1e-6 * 10 * 1000 * 32768 / 10  # excitation, gain and converter


def motion(scenario, settings, axis, force, duration, seed):
    channel, sensitivity = SENSITIVITY[axis]
    fault = (f", faults: [{{at_s: 2, duration_s: {duration}, fault: wrench_step, which: {channel}, "
             f"counts: {force * sensitivity * COUNTS}}}]") if force else ""
    program = f"[{{move: {{}}}}, {{calibration: {{}}}}, {{admittance: {{duration_s: 12}}{fault}}}]"
    run = ves.run(scenario, SETTINGS | settings | {"program": program}, seed=seed)
    admitted = run["segment"] == 2
    return run.pose("commanded")[admitted]


def kept(case):
    scenario, axis, force, duration, seeds, more = case

    def effect(settings, seed):
        return (motion(scenario, settings, axis, force, duration, seed)
                - motion(scenario, settings, axis, 0, duration, seed))

    should = effect({"sensor.noise": "false"}, 1)
    found = [effect({COMPENSATION + "wrench": "aided"} | more, seed) for seed in range(1, seeds + 1)]
    shares = [[100 * numpy.sum(x[:, part] * should[:, part]) / numpy.sum(should[:, part] ** 2) for x in found]
              for part in (slice(0, 3), slice(3, 6))]
    return (f"{numpy.mean(shares[0]):.0f} / {numpy.mean(shares[1]):.0f} % "
            f"({min(shares[0]):.0f} to {max(shares[0]):.0f})")


def main():
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 16
    more = dict(setting.split("=", 1) for setting in sys.argv[2:])
    columns = [(scenario, axis) for scenario in ("srms_low_hover_puma", "srms_capture_doss") for axis in "xz"]
    rows = [(20, 0.1), (5, 0.1), (5, 1), (2, 2), (1, 5)]
    print("| |" + "".join(f" {scenario}, {axis} |" for scenario, axis in columns))
    print("|---|" + "---|" * len(columns))
    cases = [(*column, *row, seeds, more) for row in rows for column in columns]
    with concurrent.futures.ProcessPoolExecutor() as pool:
        cells = list(pool.map(kept, cases))
    for i, (force, duration) in enumerate(rows):
        print(f"| {force} N for {duration} s | " + " | ".join(cells[i * len(columns):][:len(columns)]) + " |")


if __name__ == "__main__":
    main()
