#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""What `./ves bench` measured beside others, as a page and as a CSV file.

  page.py BENCH.json FOLDER     writes FOLDER/bench.html and FOLDER/bench.csv

Run by the Python of the environment that the others were installed in: it knows their versions.
"""
import csv
import datetime
import html
import importlib.metadata
import json
import pathlib
import subprocess
import sys

STEWART = "10 ms of a simulated Stewart platform under a PUMA 560"
# What is done, ours, the others, and what is not quite the same.
WORK = [
    ("Forward kinematics of a Stewart platform to 1e-9 m, from 2 % off", "ForwardPoseWarm", {"GenhexkinsForwardPose": "genhexkins"},
     "The algorithm of LinuxCNC's genhexkins, written anew: Newton's step taken from the fixed angles."),
    ("Inverse dynamics of a PUMA 560 whose base moves, with the wrench at its foot", "NewtonEulerMovingBasePuma",
     {"PinocchioMovingBasePuma": "Pinocchio"}, "Pinocchio with a free flyer. Equal to 1e-9."),
    ("Inverse dynamics of a PUMA 560 whose base stands", "NewtonEulerMovingBasePuma",
     {"KdlFixedBasePuma": "KDL", "PinocchioFixedBasePuma": "Pinocchio", "MujocoFixedBasePuma": "MuJoCo"},
     "Ours with the moving base all the same. Equal to 1e-9 (KDL: tests/robot_test.cpp)."),
    (STEWART + ", with cylinders", "PlantPeriodHydraulic", {"MujocoPlantPeriod": "MuJoCo"},
     "Ours: valves, oil, friction and the platform on six forces, its transducers and force sensor. MuJoCo: legs of two hinges "
     "and a slide with stiff servos, tied to the platform, steps of 1 ms."),
    (STEWART + ", with cylinders, one on every core at once: time for each", "PlantPeriodsOnAllCores",
     {"MujocoPlantPeriodsOnAllCores": "MuJoCo"}, "As a rollout has them: a thread a core, one model, data of its own each."),
    (STEWART + ", ideal legs", "PlantPeriod", {"MujocoPlantPeriod": "MuJoCo"},
     "Ours: legs that follow as velocity servos, transducers and force sensor; the platform does not push back."),
]
STYLE = """body { font: 15px/1.5 sans-serif; max-width: 60em; margin: 2em auto; padding: 0 1em; color: #1d2733 }
table { border-collapse: collapse; width: 100%; margin: 0.5em 0 } td { padding: 0.15em 0.8em 0.15em 0; white-space: nowrap }
td.bar { width: 100% } .bar div { height: 0.9em; background: #9aa7b4 } .ours .bar div { background: #c14e00 } .ours { font-weight: bold }
h2 { font-size: 1.05em; margin: 1.6em 0 0 } p { margin: 0.3em 0; color: #4a5765 }"""


def spelt(ns):
    return f"{ns:.0f} ns" if ns < 1e3 else f"{ns / 1e3:.3g} us" if ns < 1e6 else f"{ns / 1e6:.3g} ms"


def versions():
    kdl = subprocess.run(["dpkg-query", "-W", "-f=${Version}", "liborocos-kdl-dev"], capture_output=True, text=True)
    found = {"KDL": kdl.stdout or "?"}
    for name, wheel in (("MuJoCo", "mujoco"), ("Pinocchio", "pin")):
        found[name] = importlib.metadata.version(wheel)
    return found


def section(results, work, ours, others, note):
    rows = [("ours", results[ours])] + [(name, results[key]) for key, name in others.items() if key in results]
    if len(rows) == 1:
        return ""
    most = max(r["median_ns"] for _, r in rows)
    out = f"<h2>{html.escape(work)}</h2><table>"
    for name, r in rows:
        ratio = "" if name == "ours" else f"{r['median_ns'] / results[ours]['median_ns']:.1f} x"
        out += (f"<tr{' class=ours' if name == 'ours' else ''}><td>{name}</td><td>{spelt(r['median_ns'])}</td>"
                f"<td>{spelt(r['first_quartile_ns'])} .. {spelt(r['third_quartile_ns'])}</td><td>{ratio}</td>"
                f"<td class=bar><div style='width:{100 * r['median_ns'] / most:.1f}%'></div></td></tr>")
    return out + f"</table><p>{html.escape(note)}</p>"


def alone(results):
    told = {key for _, ours, others, _ in WORK for key in (ours, *others)}
    rows = "".join(f"<tr><td>{name}</td><td>{spelt(r['median_ns'])}</td><td>{spelt(r['first_quartile_ns'])} .. "
                   f"{spelt(r['third_quartile_ns'])}</td></tr>" for name, r in results.items() if name not in told)
    return f"<h2>Ours alone</h2><table>{rows}</table><p>As tests/benchmarks/bench.cpp has them.</p>" if rows else ""


def main():
    if len(sys.argv) != 3:
        sys.exit("page.py: want BENCH.json and FOLDER")
    bench = json.loads(pathlib.Path(sys.argv[1]).read_text())
    folder = pathlib.Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    machine, results = bench["machine"], bench["results"]
    others = ", ".join(f"{name} {version}" for name, version in versions().items())
    said = (f"{machine.get('processor', 'unknown processor')}, {machine['cores']} cores; {machine['compiler']}, {machine['flags']}; "
            f"{others}; {datetime.date.today()}. One run, interleaved: medians of {max(r['repetitions'] for r in results.values())}, "
            "and the middle half; x: as many times ours.")
    body = "".join(section(results, *row) for row in WORK if row[1] in results) + alone(results)
    (folder / "bench.html").write_text(
        f"<!doctype html><html lang=en><meta charset=utf-8><title>VES beside others</title><style>{STYLE}</style>"
        f"<h1>The same work, beside others</h1><p>{html.escape(said)}</p>{body}</html>\n")
    with open(folder / "bench.csv", "w", newline="") as file:
        file.write(f"# {said}\n")
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["name", "median_ns", "first_quartile_ns", "third_quartile_ns", "repetitions"])
        for name, r in results.items():
            table.writerow([name, *(f"{r[key]:.1f}" for key in ("median_ns", "first_quartile_ns", "third_quartile_ns")), r["repetitions"]])
    print(folder / "bench.html")


if __name__ == "__main__":
    main()
