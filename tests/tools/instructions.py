#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Instructions of a controller's tick, which no other load on the machine changes.

  instructions.py --build DIR              against tests/benchmarks/instructions.csv; more than
                                           5 % above a count there is an error
  instructions.py --build DIR --write      counts anew, into that file

Counted by callgrind, of 500 ticks under way (tests/support/under_way.hpp) on x86-64.
"""

import argparse
import csv
import pathlib
import re
import subprocess
import sys
import tempfile

KEPT = pathlib.Path(__file__).resolve().parent.parent / "benchmarks/instructions.csv"
MORE = 1.05  # of what is kept


def count(program, case):
    with tempfile.TemporaryDirectory() as folder:
        ran = subprocess.run(
            ["valgrind", "--tool=callgrind", f"--callgrind-out-file={folder}/out",
             "--toggle-collect=ves::countedTick*", program, case],
            capture_output=True, text=True)
        if ran.returncode != 0:
            sys.exit(f"{program} {case}: {ran.stderr}")
        instructions = re.search(r"Collected : (\d+)", ran.stderr)
        return round(int(instructions[1]) / int(ran.stdout))


def main():
    options = argparse.ArgumentParser(description=__doc__,
                                      formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--build", required=True)
    options.add_argument("--write", action="store_true")
    given = options.parse_args()
    program = f"{given.build}/tests/ticks"
    cases = subprocess.run([program], check=True, capture_output=True, text=True).stdout.split()
    counts = {case: count(program, case) for case in cases}
    if given.write:
        with open(KEPT, "w") as out:
            writer = csv.writer(out, lineterminator="\n")
            writer.writerow(["case", "instructions_per_tick"])
            writer.writerows(counts.items())
    with open(KEPT) as rows:
        kept = {row["case"]: int(row["instructions_per_tick"]) for row in csv.DictReader(rows)}
    if kept.keys() != counts.keys():
        sys.exit(f"{KEPT.name} has {list(kept)}, want {cases}")
    print(f"{'instructions a tick':<24}{'now':>8}{'kept':>8}{'ratio':>8}")
    for case, now in counts.items():
        print(f"{case:<24}{now:>8}{kept[case]:>8}{now / kept[case]:>8.3f}")
    slower = [case for case in cases if not 0 < counts[case] <= MORE * kept[case]]
    if slower:
        sys.exit(f"more than 5 % above {KEPT.name}: {', '.join(slower)}")


main()
