#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Deliberate errors, one at a time, and whether the test suite notices.

  mutate.py generate   the mutated copy of the project, every mutant behind a run-time switch
  mutate.py build      it, leaving out the mutants that are not C++
  mutate.py run        every mutant against the tests that pass it; MODULE... or numbers limit it
  mutate.py table      the result by module, as Markdown

Needs the Debian packages python3-clang-14 and libclang-common-14-dev.

The mutants are drawn at random, the same for one --seed. Survivors that cannot be noticed are listed
with a reason in equivalent.txt. Everything else is in build/mutation.
"""
import argparse
import collections
import concurrent.futures
import contextlib
import dataclasses
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import time

from draw import MODULES, ROOT, SOURCE, draw, find_all, render

WORK = ROOT / "build" / "mutation"
TREE = WORK / "tree"
BUILD = WORK / "build"


def key_of(record):
    text = " ".join(record["text"].split())
    return f"{record['file']} | {record['line_text']} | {record['what']}, of {text}"


def put(target, content, mode_of):
    """Writes what differs, so that nothing is built again without need."""
    if target.exists() and target.read_bytes() == content:
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_bytes(content)
    shutil.copymode(mode_of, target)


def snapshot():
    listed = subprocess.run(["git", "-C", str(ROOT), "ls-files", "-co", "--exclude-standard"],
                            capture_output=True, text=True, check=True).stdout.splitlines()
    present = {name for name in listed if (ROOT / name).is_file()}
    for old in SOURCE.rglob("*"):
        if old.is_file() and str(old.relative_to(SOURCE)) not in present:
            old.unlink()
            (TREE / old.relative_to(SOURCE)).unlink(missing_ok=True)
    for name in present:
        put(SOURCE / name, (ROOT / name).read_bytes(), ROOT / name)


def generate(args):
    WORK.mkdir(parents=True, exist_ok=True)
    snapshot()
    chosen = draw(find_all(args.modules), args.count, args.seed)
    records = [{"id": number, "module": module, **dataclasses.asdict(m)}
               for number, (module, m) in enumerate(chosen, start=1)]
    (WORK / "mutants.json").write_text(json.dumps(records, indent=1))
    (WORK / "dropped.json").write_text("[]")
    write_tree(records, set())
    print(f"{len(records)} mutants")


def write_tree(records, dropped):
    by_file = collections.defaultdict(list)
    for m in records:
        if m["id"] not in dropped:
            by_file[SOURCE / m["file"]].append(m)
    for source in SOURCE.rglob("*"):
        if source.is_file():
            content = source.read_bytes()
            if source in by_file:
                # Beside the others' includes: before them it would spoil the precompiled headers.
                text = render(source.read_text(), by_file[source])
                switch = f'#include "{TREE}/tests/mutation/mutant.hpp"\n#include '
                content = text.replace("#include ", switch, 1).encode()
            put(TREE / source.relative_to(SOURCE), content, source)


def build(_):
    flags = "-O1 -w -D_GLIBCXX_ASSERTIONS"  # with assert(): an index past the end is noticed
    configure = ["cmake", "-S", str(TREE), "-B", str(BUILD), "-G", "Ninja",
                 "-DCMAKE_CXX_COMPILER=clang++-14", "-DCMAKE_BUILD_TYPE=Release",
                 "-DCMAKE_CXX_FLAGS_RELEASE=" + flags]
    records = json.loads((WORK / "mutants.json").read_text())
    dropped = set(json.loads((WORK / "dropped.json").read_text()))
    for _ in range(8):
        subprocess.run(configure, check=True, stdout=subprocess.DEVNULL)
        made = subprocess.run(["cmake", "--build", str(BUILD), "--", "-k", "0"],
                              capture_output=True, text=True)
        if made.returncode == 0:
            print(f"built; {len(dropped)} mutants are not C++")
            return
        bad = set()
        for file, line in re.findall(r"^(\S+?):(\d+):\d+:\s+(?:error|note: in inst)",
                                     made.stdout, re.M):
            if not file.startswith(str(TREE)):
                continue
            lines = pathlib.Path(file).read_text().splitlines()
            for k in range(max(0, int(line) - 2), min(len(lines), int(line) + 1)):
                bad |= {int(n) for n in re.findall(r"ves_[mf]\((\d+)", lines[k])}
        if not bad - dropped:
            print(made.stdout[-4000:])
            sys.exit("the mutated tree does not build")
        dropped |= bad
        (WORK / "dropped.json").write_text(json.dumps(sorted(dropped)))
        write_tree(records, dropped)
    sys.exit("too many mutants are not C++")


def environment(**more):
    return {**os.environ, "VES_CONFIG_DIR": str(TREE / "config"), "GTEST_FAIL_FAST": "1",
            "GTEST_BRIEF": "1", **more}


FIRST = 0.5  # s of tests in the first run of a mutant; each run after it is twice as long
PATIENCE = 60.0  # s of tests after which a mutant that none has noticed counts as survived
KILLS = collections.Counter()  # mutants by the test that noticed them, so far
OF_A_SUITE = 3  # tests of one suite, before those of others have been tried
LIVE = "test_programs"  # starts the programs as processes
FEWEST = 500  # tests; fewer are found where the test programs are called otherwise
# The tests of ctest that are no gtests, and what `ves` is asked in them.
ASKED = {"Faults.Table.published": ["faults", "--lockstep"],
         "Faults.Processes": ["faults", "F14", "F15", "F21"]}


def command(binary, names):
    if binary in ASKED:
        return [BUILD / "apps" / "ves", *ASKED[binary]]
    return [BUILD / "tests" / binary, "--gtest_filter=" + ":".join(names)]


def all_tests():
    """[binary, test] of everything in C++ that ctest would run."""
    out = [(name, name) for name in ASKED]
    for binary in sorted((BUILD / "tests").glob("test_*")):
        if binary.name == "test_no_heap" or not os.access(binary, os.X_OK):
            continue
        listing = subprocess.run([binary, "--gtest_list_tests"], capture_output=True, text=True,
                                 check=True).stdout
        suite = ""
        for line in listing.splitlines():
            name = line.split("#")[0].rstrip()
            if name and not name.startswith(" "):
                suite = name
            elif name:
                out.append((binary.name, suite + name.strip()))
    if len(out) < FEWEST:
        sys.exit(f"{len(out)} tests are found in {BUILD / 'tests'}, want {FEWEST} or more: "
                 "nothing would be measured")
    return out


def cover(test):
    binary, name = test
    file = WORK / "coverage" / f"{abs(hash(test))}"
    file.unlink(missing_ok=True)
    start = time.monotonic()
    done = subprocess.run(command(binary, [name]),
                          env=environment(VES_MUTANT_COVERAGE=str(file)), cwd=BUILD / "tests",
                          stdin=subprocess.DEVNULL, capture_output=True, text=True)
    seconds = time.monotonic() - start
    seen = [n for n, byte in enumerate(file.read_bytes()) if byte] if file.exists() else []
    return {"binary": binary, "name": name, "seconds": seconds, "seen": seen,
            "status": done.returncode}


def measure_coverage():
    (WORK / "coverage").mkdir(exist_ok=True)
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        tests = list(pool.map(cover, all_tests()))
    failing = [t["name"] for t in tests if t["status"] != 0]
    if failing:
        print(f"left out, because they fail without any mutant: {failing}", flush=True)
    tests = [t for t in tests if t["status"] == 0]
    (WORK / "coverage.json").write_text(json.dumps(tests))
    print(f"{len(tests)} tests in {sum(t['seconds'] for t in tests):.0f} s")
    return tests


def batches(record, tests, before):
    """The tests that pass the mutant, in runs of a test program: what noticed it last time, then small
    runs of the quickest tests, the most particular and those that noticed others, a few of each suite
    first, then ever longer ones."""
    covering = [t for t in tests if record["id"] in t["seen"]]
    last = [t for t in covering if t["name"] == before.get(key_of(record))]
    rest = sorted((t for t in covering if t not in last),
                  key=lambda t: (t["seconds"] + 0.02) * len(t["seen"]) ** 0.5
                  / (1 + KILLS[t["name"]]))
    tried, turns = collections.Counter(), []
    for t in rest:
        suite = t["name"].split(".")[0]
        turns.append(tried[suite] // OF_A_SUITE)
        tried[suite] += 1
    rest = [t for _, t in sorted(zip(turns, rest), key=lambda pair: pair[0])]
    out = [last] if last else []
    budget, spent = FIRST, 0.0
    while rest and spent < PATIENCE:
        some, seconds = [], 0.0
        while rest and (not some or seconds + rest[0]["seconds"] < budget):
            some.append(rest.pop(0))
            seconds += some[-1]["seconds"]
        spent += seconds
        budget *= 2.0
        by_binary = collections.defaultdict(list)
        for t in some:
            by_binary[t["binary"]].append(t)
        out += by_binary.values()
    return out, len(covering)


def attack(record, tests, before):
    """The first test that notices the mutant."""
    runs, covered = batches(record, tests, before)
    for some in runs:
        binary, allowed = some[0]["binary"], 10.0 + 6.0 * sum(t["seconds"] for t in some)
        names = [t["name"] for t in some]
        killer = noticed(record, binary, names, allowed)
        # What waits for other processes can fail by itself.
        if killer and binary in (LIVE, "Faults.Processes"):
            killer = noticed(record, binary, names, allowed)
        if killer:
            KILLS[killer] += 1
            return {**record, "killed_by": killer, "covered": covered}
    return {**record, "killed_by": None, "covered": covered}


def noticed(record, binary, names, allowed):
    """The test that fails with the mutant, or None."""
    with subprocess.Popen(
            command(binary, names), env=environment(VES_MUTANT=str(record["id"])),
            cwd=BUILD / "tests", stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, text=True, errors="replace", start_new_session=True) as test:
        try:
            printed, _ = test.communicate(timeout=allowed)
        except subprocess.TimeoutExpired:
            return f"{binary}: time out"
        finally:  # and whatever it has started
            with contextlib.suppress(ProcessLookupError):
                os.killpg(test.pid, signal.SIGKILL)
    if test.returncode == 0:
        return None
    failed = re.search(r"\[  FAILED  \] (\S+)", printed)
    return failed.group(1).rstrip(",") if failed else f"{binary}: status {test.returncode}"


def known_results():
    """What earlier runs found, by key_of(); of mutants that are alike, the one that survived."""
    file = WORK / "results.json"
    known = {}
    for result in json.loads(file.read_text()) if file.exists() else []:
        if key_of(result) not in known or not result["killed_by"]:
            known[key_of(result)] = result
    return known


def run(args):
    records = json.loads((WORK / "mutants.json").read_text())
    dropped = set(json.loads((WORK / "dropped.json").read_text()))
    known = known_results()
    before = {key: r["killed_by"] for key, r in known.items()}
    wanted = set(args.which)

    def chosen(r):
        if not wanted or str(r["id"]) in wanted or r["module"] in wanted:
            return True
        return "survivors" in wanted and not before.get(key_of(r))

    records = [r for r in records if r["id"] not in dropped]
    results = {r["id"]: {**known[key_of(r)], "id": r["id"]} for r in records
               if not chosen(r) and key_of(r) in known}
    tests = measure_coverage()
    left = [r for r in records if chosen(r)]
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        for n, result in enumerate(pool.map(lambda r: attack(r, tests, before), left), start=1):
            results[result["id"]] = result
            if not result["killed_by"]:
                print(f"{result['id']:4} {result['file']}:{result['line']}: {result['what']}: "
                      f"{result['text'][:70]!r} ({result['covered']} tests pass it)", flush=True)
            if n % 20 == 0:
                keep(results)
    keep(results)
    table(args)


def keep(results):
    (WORK / "results.json").write_text(json.dumps(list(results.values()), indent=1))


def equivalents():
    out = {}
    for line in (pathlib.Path(__file__).parent / "equivalent.txt").read_text().splitlines():
        if line.strip() and not line.startswith("#"):
            key, _, reason = line.rpartition(" | ")
            out[key] = reason
    return out


def table(_):
    results = json.loads((WORK / "results.json").read_text())
    known = equivalents()
    rows = collections.defaultdict(lambda: [0, 0, 0, 0])
    for r in results:
        equivalent = not r["killed_by"] and key_of(r) in known
        for name in (r["module"], "all"):
            row = rows[name]
            row[0] += 1
            row[1] += bool(r["killed_by"])
            row[2] += equivalent
            row[3] += not r["killed_by"] and not equivalent
    print("| module | mutants | killed | equivalent | survived | killed of the rest |")
    print("|---|---|---|---|---|---|")
    for name in [*(m for m in MODULES if m in rows), "all"]:
        n, killed, equivalent, survived = rows[name]
        share = 100.0 * killed / max(1, n - equivalent)
        print(f"| {name} | {n} | {killed} | {equivalent} | {survived} | {share:.1f} % |")


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=600)
    parser.add_argument("--modules", default=",".join(MODULES), type=lambda text: text.split(","),
                        help="of generate, with commas between")
    parser.add_argument("step", choices=["generate", "build", "run", "table"])
    parser.add_argument("which", nargs="*", help="modules, numbers, or 'survivors'")
    args = parser.parse_args()
    {"generate": generate, "build": build, "run": run, "table": table}[args.step](args)


if __name__ == "__main__":
    main()
