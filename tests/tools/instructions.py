#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Instructions of a controller's tick, which no other load on the machine changes.

  instructions.py --build DIR              against tests/benchmarks/instructions.csv; more than
                                           5 % above a count there is an error
  instructions.py --build DIR --worst      also the median and the largest of all ticks, one by one
  instructions.py --build DIR --write      counts anew, into that file

Counted by callgrind, of the ticks of tests/support/under_way.hpp on x86-64.
"""

import argparse
import csv
import pathlib
import re
import statistics
import subprocess
import sys
import tempfile

KEPT = pathlib.Path(__file__).resolve().parent.parent / "benchmarks/instructions.csv"
MORE = 1.05  # of what is kept


def callgrind(program, case, folder, *more):
    """What the program and callgrind print."""
    ran = subprocess.run(
        ["valgrind", "--tool=callgrind", f"--callgrind-out-file={folder}/out",
         "--toggle-collect=ves::countedTick*", *more, program, case],
        capture_output=True, text=True)
    if ran.returncode != 0:
        sys.exit(f"{program} {case}: {ran.stderr}")
    return ran.stdout, ran.stderr


def count(program, case):
    """Mean of all ticks."""
    with tempfile.TemporaryDirectory() as folder:
        ticks, said = callgrind(program, case, folder)
        return round(int(re.search(r"Collected : (\d+)", said)[1]) / int(ticks))


def one_by_one(program, case):
    """Of every tick, in order."""
    tick = "ves::countedTick(ves::TestPlatform&, ves::TickInput const&)"
    with tempfile.TemporaryDirectory() as folder:
        ticks, _ = callgrind(program, case, folder, f"--dump-before={tick}")
        dumps = [int(re.search(r"^totals: (\d+)", path.read_text(), re.M)[1])
                 for path in pathlib.Path(folder).iterdir()]
        counts = [n for n in dumps if n > 0]  # the first is of what came before
        if len(counts) != int(ticks):
            sys.exit(f"{case}: {len(counts)} of {ticks} ticks were counted")
        return counts


def main():
    options = argparse.ArgumentParser(description=__doc__,
                                      formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--build", required=True)
    options.add_argument("--worst", action="store_true")
    options.add_argument("--write", action="store_true")
    given = options.parse_args()
    program = f"{given.build}/tests/ticks"
    cases = subprocess.run([program], check=True, capture_output=True, text=True).stdout.split()
    counts = {case: count(program, case) for case in cases}
    worst = {}
    if given.worst or given.write:
        print(f"{'instructions of a tick':<24}{'median':>8}{'worst':>8}{'worst / median':>16}")
        for case in cases:
            ticks = one_by_one(program, case)
            worst[case] = max(ticks)
            median = statistics.median_low(ticks)
            print(f"{case:<24}{median:>8}{worst[case]:>8}{worst[case] / median:>16.2f}")
        print()
    if given.write:
        with open(KEPT, "w") as out:
            writer = csv.writer(out, lineterminator="\n")
            writer.writerow(["case", "instructions_per_tick", "worst"])
            writer.writerows((case, counts[case], worst[case]) for case in cases)
    with open(KEPT) as rows:
        rows = {row["case"]: row for row in csv.DictReader(rows)}
    if rows.keys() != counts.keys():
        sys.exit(f"{KEPT.name} has {list(rows)}, want {cases}")
    slower = []

    def compare(what, counted, column):
        print(f"{what:<24}{'now':>8}{'kept':>8}{'ratio':>8}")
        for case, now in counted.items():
            kept = int(rows[case][column])
            print(f"{case:<24}{now:>8}{kept:>8}{now / kept:>8.3f}")
            if not 0 < now <= MORE * kept:
                slower.append(case)

    compare("instructions a tick", counts, "instructions_per_tick")
    if worst:
        compare("of the worst tick", worst, "worst")
    if slower:
        sys.exit(f"more than 5 % above {KEPT.name}: {', '.join(slower)}")


main()
