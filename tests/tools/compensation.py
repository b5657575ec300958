#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""What the compensation reaches: the tables of docs/compensation.md.

  tests/tools/compensation.py

Runs `./ves run --lockstep` for every cell and prints the emulation error in position / rotation, rms
[%] of the base's amplitude from rest. The gate does not keep anything from running. An identification
of the servos is made first.
"""
import concurrent.futures
import json
import math
import pathlib
import re
import subprocess
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
ARMS = ["unberth", "low_hover", "deploy", "capture"]
KEY = "controller.compensation."
ALL = [KEY + part + "=true" for part in ("feed_forward", "observer", "inertia")]
MEAN = ["sensor.readings_per_tick=4"]
QUIET = ["sensor.noise=false"]
LEARNS = [KEY + "adaptation=true"]
AIDED = [KEY + "wrench=aided"]
SIX = ["base.keep_modes=6"]


def run(folder, scenario, sets, servo=None, name="run"):
    out = pathlib.Path(folder) / name
    command = [ROOT / "ves", "run", scenario, "--lockstep", "--no-plots", "--quiet", "--out", out]
    for one in sets + ["controller.stability=forced", "controller.stability_uncompensated=forced"]:
        command += ["--set", one]
    if servo:
        command += ["--servo", servo]
    ended = subprocess.run(command, capture_output=True, text=True)
    if ended.returncode:
        return ended.stderr.strip().splitlines()[-1] if ended.stderr else "stopped"
    found = json.loads((out / "summary.json").read_text())
    if "emulation_error_position_share" not in found:
        return "-"
    shares = [100 * found[f"emulation_error_{what}_share"] for what in ("position", "attitude")]
    return " / ".join(f"{s:.{2 if s < 1 else 1 if s < 10 else 0}f}" for s in shares)


def mismatch(text):
    return ["plant_mismatch={" + text + "}"]


def identified(folder):
    """The servos as `identify servo` finds them, and the same 1 ms later and earlier."""
    run(folder, "servo_identification", MEAN, name="shake")
    found = pathlib.Path(folder) / "servo.yaml"
    subprocess.run([ROOT / "ves", "identify", "servo", pathlib.Path(folder) / "shake" / "run.lcmlog",
                    "--out", found], check=True, capture_output=True)
    files = {0: found}
    for ms in (1, -1):
        def shift(line):
            values = [float(v) + 1e-3 * ms for v in line.group(1).split(",")]
            return f"delay_s: {values}"
        files[ms] = found.with_name(f"servo{ms}.yaml")
        files[ms].write_text(re.sub(r"delay_s: \[([^]]*)\]", shift, found.read_text(), count=1))
    return files


def light_base(ratio, hertz):
    """A base in space with one frequency, a `ratio`-th of the PUMA's inertia, let go."""
    w = 2 * math.pi * hertz
    mass = [73.45 / ratio] * 3 + [40.0 / ratio] * 3
    diagonal = {"mass": mass, "damping": [0.04 * w * m for m in mass],
                "stiffness": [w * w * m for m in mass]}
    lists = ", ".join(f"{k}_diagonal: {v}" for k, v in diagonal.items())
    amplitude = min(0.03, 1.25 / w ** 2)
    return ["gravity_m_per_s2=0", "base={" + lists + "}",
            "program=[{move: {}}, {calibration: {}}, {move: {to: {x_m: %g, z_m: %g}}}, "
            "{admittance: {duration_s: 6}}]" % (amplitude, 0.75 * amplitude)]


def print_row(title, cells):
    print(f"| {title} | " + " | ".join(cell.result() for cell in cells) + " |", flush=True)


def main():
    with tempfile.TemporaryDirectory() as folder, \
            concurrent.futures.ThreadPoolExecutor(2) as pool:
        servo = identified(folder)
        count = 0

        def cell(scenario, sets, file=None):
            nonlocal count
            count += 1
            return pool.submit(run, folder, scenario, sets, file, str(count))

        best = SIX + MEAN + ALL
        rows = [
            ("as it is believed", QUIET, None),
            ("after `identify servo`", QUIET, servo[0]),
            ("the servos believed 1 ms later than that", QUIET, servo[1]),
            ("1 ms earlier", QUIET, servo[-1]),
            ("servos 5 % quicker", QUIET + mismatch("gain_extend: 1.05, gain_retract: 1.05"), None),
            ("5 % slower", QUIET + mismatch("gain_extend: 0.95, gain_retract: 0.95"), None),
            ("lag tau 30 % longer", QUIET + mismatch("tau: 1.3"), None),
            ("sensor's cut-off 5 % lower", QUIET + mismatch("sensor_cutoff: 0.95"), None),
            ("5 % higher", QUIET + mismatch("sensor_cutoff: 1.05"), None),
            ("robot 5 % heavier, in space", QUIET + mismatch("mass: 1.05") + ["gravity_m_per_s2=0"],
             None),
            ("converter read once a tick", QUIET + ["sensor.readings_per_tick=1"], None),
            ("and 1 ms later", QUIET + ["sensor.readings_per_tick=1"], servo[1]),
            ("with the sensor's noise", [], None),
            ("with noise, `wrench=aided`", AIDED, None),
        ]
        for title, extra in (("DOSS", []), ("DOSS, `adaptation=true`", LEARNS)):
            print(f"\n| {title} | " + " | ".join(ARMS) + " |\n|---|---|---|---|---|")
            cells = [(name, [cell(f"srms_{arm}_doss", best + extra + sets, file) for arm in ARMS])
                     for name, sets, file in rows]
            for name, row in cells:
                print_row(name, row)
        print("\n| PUMA, with noise | " + " | ".join(ARMS) + " |\n|---|---|---|---|---|")
        for name, sets in [("as published", SIX), ("compensated", best),
                           ("`wrench=aided`", best + AIDED),
                           ("`wrench=aided`, `adaptation=true`", best + AIDED + LEARNS)]:
            print_row(name, [cell(f"srms_{arm}_puma", sets) for arm in ARMS])
        light = [(5, 1), (5, 3), (5, 5), (5, 8), (5, 12), (10, 0.7)]
        print("\n| mass ratio, base alone [Hz] | " + " | ".join(f"{r}, {f}" for r, f in light) +
              " |\n|---|" + "---|" * len(light))
        print_row("percent", [cell("puma_on_table_4_1", QUIET + MEAN + ALL + light_base(r, f))
                              for r, f in light])


if __name__ == "__main__":
    main()
