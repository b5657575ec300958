#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Deliberate attacks on the programs, and what became of them.

  attack.py [--seed N] [--scale X] [--only KIND] [--build build/release]

Everything happens in a network of its own. Status 1 when anything was lost, crashed or was too slow.

  refused   status 2 and one line that says what is wrong
  survived  it did its work all the same
  lost      a recording, a result or the word about what is wrong is missing
  crashed   ended by a signal that nobody sent, or it never ended
  slow      over 2 s of processor time, or 1 GB
"""
import argparse
import ctypes
import fcntl
import json
import os
import pathlib
import random
import resource
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
CONFIG = ROOT / "config"
SHORT = "program=[{trajectory: {duration_s: 1, z: {sine: {amplitude_m: 0.02, frequency_hz: 1}}}}]"
# What a machine busy with other things does to a run in real time is no finding.
ON_TIME = ["--set", "safety.stall_ticks=1000", "--set", "safety.overruns_per_second=1000"]
FRESH = ["--set", "safety.stale_ticks=1000"]
VERDICTS = ("refused", "survived", "lost", "crashed", "slow")


def enter_private_network():
    """As --private-bus does: loopback up, with multicast."""
    user, group = os.geteuid(), os.getegid()
    if ctypes.CDLL(None, use_errno=True).unshare(0x10000000 | 0x40000000) != 0:
        sys.exit("attack: this machine gives no network of its own")
    for file, text in (("setgroups", "deny"), ("uid_map", f"0 {user} 1"), ("gid_map", f"0 {group} 1")):
        pathlib.Path("/proc/self", file).write_text(text)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
        flags = 0x1 | 0x40 | 0x1000  # up, running, multicast
        fcntl.ioctl(s, 0x8914, struct.pack("16sh22x", b"lo", flags))
        address = lambda text: struct.pack("HH4s8x", socket.AF_INET, 0, socket.inet_aton(text))
        device = ctypes.create_string_buffer(b"lo")
        route = struct.pack("Q16s16s16sHhQQhPQQH", 0, address("224.0.0.0"), address("0.0.0.0"),
                            address("240.0.0.0"), 1, 0, 0, 0, 0, ctypes.addressof(device), 0, 0, 0)
        fcntl.ioctl(s, 0x890B, route)


def signal_to(process, number):
    """Not by Popen: that asks how it has ended, and Run would wait for nobody."""
    os.kill(process.pid, number)


class Run:
    """One command: how it ended, what it said, what it cost."""

    def __init__(self, arguments, folder, stdout=subprocess.PIPE, limits=None, sent=None, patience=90.0):
        def prepare():
            for what, value in (limits or {}).items():
                resource.setrlimit(what, (value, value))
        with tempfile.TemporaryFile() as err:
            process = subprocess.Popen([str(VES), *arguments], cwd=folder, stdin=subprocess.DEVNULL,
                                       stdout=stdout if stdout != subprocess.PIPE else subprocess.DEVNULL,
                                       stderr=err, preexec_fn=prepare, start_new_session=True)
            killer = threading.Timer(patience, signal_to, (process, signal.SIGKILL))
            killer.start()
            if sent:
                sent(process)
            _, status, usage = os.wait4(process.pid, 0)
            killer.cancel()
            process.returncode = os.waitstatus_to_exitcode(status)
            err.seek(0)
            self.said = err.read().decode(errors="replace")
        self.status = process.returncode
        self.seconds = usage.ru_utime + usage.ru_stime
        self.megabytes = usage.ru_maxrss / 1024

    def complaint(self):
        """The lines that are no progress, warning or note."""
        return [line for line in self.said.splitlines()
                if line.strip() and not line.startswith(("warning:", "note:")) and " s  " not in line
                and "parked, legs" not in line]


def judge(run, good=lambda: True, bound=True, statuses=(0, 1)):
    if run.status < 0 or run.status >= 126:
        return "crashed"
    if bound and (run.seconds > 2.0 or run.megabytes > 1024):
        return "slow"
    if run.status == 2:
        lines = run.complaint()
        return "refused" if len(lines) == 1 and len(lines[0]) < 1000 else "lost"
    return "survived" if run.status in statuses and good() else "lost"


def results(folder):
    """A run's summary can be read, and its log is not empty."""
    try:
        json.loads((folder / "summary.json").read_text())
        return (folder / "run.lcmlog").stat().st_size > 1000
    except (OSError, ValueError):
        return False


def mangle(rng, data):
    """A text or file with some of what people, editors and disks do to it."""
    data = bytearray(data)
    for _ in range(rng.choice([1, 1, 1, 2])):
        at = rng.randrange(len(data)) if data else 0
        what = rng.randrange(9)
        if what == 0 and data:
            data[at] = rng.randrange(256)
        elif what == 1:
            del data[at:at + rng.randint(1, 200)]
        elif what == 2:
            data[at:at] = bytes(rng.randrange(256) for _ in range(rng.randint(1, 20)))
        elif what == 3:
            data = data[:at]
        elif what == 4:
            data[at:at] = rng.choice([b"nan", b".inf", b"-1e308", b"1e999", b"99999999999999999999",
                                      b"''", b"[]", b"{}", b"~", b"!x ", b"&a *a", b"\t", b"\0"])
        elif what == 5:
            lines = data.split(b"\n")
            rng.shuffle(lines)
            data = bytearray(b"\n".join(lines))
        elif what == 6:
            lines = data.split(b"\n")
            line = rng.choice(lines)
            lines.insert(rng.randrange(len(lines) + 1), line)
            data = bytearray(b"\n".join(lines))
        elif what == 7:
            digits = [i for i, c in enumerate(data) if chr(c).isdigit()]
            if digits:
                data[rng.choice(digits)] = rng.choice(b"-.0eE9x")
        else:
            data[at:at] = rng.choice([b"- " * 2000, b"a: " * 500, b"<a>" * 3000, b"#" * 5000])
    return bytes(data)


def lockstep(folder, *more, **options):
    return Run(["run", "z_sine", "--lockstep", "--no-plots", "--quiet", "--set", SHORT, "--out", "out",
                *more], folder, **options)


def attack_files(rng, folder):
    scenario = rng.choice([*sorted((CONFIG / "scenarios").glob("*.yaml")), *8 * [RESOLVED]])
    text = scenario.read_bytes().replace(b"from: ../", f"from: {CONFIG}/".encode())
    file = folder / "mine.yaml"
    file.write_bytes(mangle(rng, text))
    run = Run(["stability", "loop", str(file)], folder) if rng.random() < 0.15 else \
        Run(["run", str(file), "--lockstep", "--no-plots", "--quiet", "--out", "out", "--set", SHORT],
            folder)
    return judge(run, bound=False) if run.megabytes < 1024 else "slow", run


def attack_robots(rng, folder):
    (folder / "mine.urdf").write_bytes(mangle(rng, (CONFIG / "robots" / "puma560.urdf").read_bytes()))
    run = Run(["run", "puma_on_table_4_1", "--lockstep", "--no-plots", "--quiet", "--set", SHORT, "--set",
               "robot.urdf=mine.urdf", "--out", "out"], folder)
    return judge(run, lambda: results(folder / "out")), run


def attack_arguments(rng, folder):
    values = ["nan", "-1", "1e999", "", "x" * 3000, "\xff", "0x10", "a=b", "=", "a.b.c=", "/dev/null", "..",
              "program.0=3", "program.9.x=1", "robot.urdf=", "base=!replace {}", "seed=-1", "--", "legs=[",
              "controller.period_ns=1", "sensor.noise=perhaps", "gravity_m_per_s2=1e9"]
    options = ["--set", "--seed", "--out", "--calibration", "--masses", "--servo", "--url", "--vary",
               "--draw", "--runs", "--workers", "--rate", "--from", "--select", "--speed", "--with", "--x",
               "--do", "--nonsense"]
    command = rng.choice([["run", "z_sine", "--lockstep", "--no-plots", "--quiet", "--set", SHORT],
                          ["collect", "none.lcmlog"], ["replay", "none.lcmlog"],
                          ["sweep", "z_sine", "--set", SHORT], ["stability", "loop", "z_sine"],
                          ["stability", "map"], ["identify", "plan", "z_sine"], ["identify", "masses"],
                          ["srms", "modes", "table_4_1"], ["faults", "--lockstep", "F3"], ["run"], ["fly"],
                          ["controller", "z_sine", "--do"]])
    extra = [rng.choice(options), rng.choice(values)] if rng.random() < 0.9 else [rng.choice(values)]
    if "map" in command and extra[0] not in ("--x", "--nonsense"):
        extra = ["--x", rng.choice(values)]
    if extra[0] == "--workers":
        extra = ["--workers", rng.choice(["0", "-3", "nan", "1e9"])]
    run = Run([*command, *extra], folder)
    if run.status == 2 and "usage: ves" in run.said:
        return "refused", run
    return judge(run, bound=False), run


def attack_logs(rng, folder):
    log = bytearray(LOG.read_bytes())
    at = rng.randrange(len(log))
    what = rng.randrange(6)
    if what == 0:
        log = log[:at]
    elif what == 1:
        for _ in range(rng.randint(1, 50)):
            log[rng.randrange(len(log))] ^= 1 << rng.randrange(8)
    elif what == 2:
        del log[at:at + rng.randint(1, 5000)]
    elif what == 3:
        log[at:at] = bytes(rng.randrange(256) for _ in range(rng.randint(1, 5000)))
    elif what == 4:
        log += LOG.read_bytes()
    else:
        log[at:at + 64] = b"\x7f" * 64
    (folder / "a.lcmlog").write_bytes(log)
    if rng.random() < 0.3:
        run = Run(["replay", "a.lcmlog", "--check"], folder)
        return judge(run), run
    out = folder / "a.csv"
    run = Run(["collect", "a.lcmlog", "--select", "z_", "--out", str(out)], folder)

    def used():  # what is whole before the damage is there
        rows = out.read_text().count("\n") - 1
        return rows > 0.8 * ROWS * min(at, len(LOG.read_bytes())) / LOG.stat().st_size - 20
    beginning = at < 20_000  # where the configuration stands
    return judge(run, lambda: beginning or what == 1 or used()), run


def attack_signals(rng, folder):
    number = rng.choice([signal.SIGHUP, signal.SIGTERM, signal.SIGINT, signal.SIGPIPE])
    after = rng.uniform(0.3, 3.5)

    def send(process):
        time.sleep(after)
        signal_to(process, number)
    run = Run(["run", "z_sine", "--no-plots", *ON_TIME, *FRESH, "--set",
               "program=[{trajectory: {duration_s: 2, z: {sine: {amplitude_m: 0.1, frequency_hz: 0.5}}}}]",
               "--out", "out"], folder, sent=send)
    return judge(run, lambda: results(folder / "out"), bound=False), run


def attack_kills(rng, folder):
    """The recorder is gone at once: what is a second old is readable. (Controller and plant: faults F14,
    F15.)"""
    after = rng.uniform(1.5, 4.0)
    log = folder / "out" / "run.lcmlog"
    seen = 0

    def kill(process):
        nonlocal seen
        time.sleep(after)
        seen = log.stat().st_size if log.exists() else 0
        time.sleep(1.0)
        signal_to(process, signal.SIGKILL)
    Run(["run", "z_sine", "--no-plots", *ON_TIME, "--set",
         "program=[{trajectory: {duration_s: 9, z: {sine: {amplitude_m: 0.1, frequency_hz: 0.5}}}}]",
         "--out", "out"], folder, sent=kill)
    read = Run(["collect", str(log), "--select", "z_", "--out", "k.csv"], folder)
    if read.status != 0 or log.stat().st_size < seen or seen == 0:
        return "lost", read
    return "survived", read


def attack_conditions(rng, folder):
    what = rng.randrange(7)
    out = folder / "out"
    if what == 0:  # the disk fills up
        run = lockstep(folder, limits={resource.RLIMIT_FSIZE: rng.randint(1, 300_000)})
        return judge(run), run
    if what == 1:
        out.write_text("a file")
        run = lockstep(folder)
        return judge(run), run
    if what == 2:  # nobody reads
        with open("/dev/full", "w") as full:
            run = Run(["collect", str(LOG), "--select", "z_"], folder, stdout=full)
        return judge(run), run
    if what == 3:
        run = Run(["run", "z_sine", "--lockstep", "--no-plots", "--set", SHORT, "--out", "out"], folder,
                  limits={resource.RLIMIT_STACK: 512 * 1024})
        return judge(run, lambda: results(out)), run
    if what == 4:  # many at once
        runs = [subprocess.Popen([str(VES), "run", "z_sine", "--lockstep", "--no-plots", "--quiet", "--set",
                                  SHORT], cwd=folder, stdout=subprocess.DEVNULL,
                                 stderr=subprocess.DEVNULL) for _ in range(5)]
        for run in runs:
            run.wait()
        whole = [f for f in (folder / "ves-runs").iterdir() if results(f)]
        last = lockstep(folder)
        return "survived" if len(whole) == 5 and judge(last) == "survived" else "lost", last
    if what == 5:
        run = lockstep(folder, limits={resource.RLIMIT_NOFILE: rng.randint(6, 14)})
        return judge(run, lambda: results(out)), run
    with open("/dev/full", "w") as full:
        run = Run(["run", "z_sine", "--lockstep", "--no-plots", "--set", SHORT, "--out", "out"], folder,
                  stdout=full)
    return "refused" if run.status == 2 and results(out) else judge(run), run


def main():
    global VES, LOG, ROWS, RESOLVED
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scale", type=float, default=1.0, help="times as many inputs")
    parser.add_argument("--only", default="")
    parser.add_argument("--build", default=str(ROOT / "build" / "release"))
    args = parser.parse_args()
    VES = pathlib.Path(args.build).resolve() / "apps" / "ves"
    os.environ["VES_CONFIG_DIR"] = str(CONFIG)
    enter_private_network()
    work = pathlib.Path(tempfile.mkdtemp(prefix="ves_attack_"))
    first = Run(["run", "z_sine", "--lockstep", "--no-plots", "--quiet", "--set", SHORT, "--out", "log"], work)
    if first.status != 0:
        sys.exit(f"attack: without an attack: status {first.status}: {first.said}")
    LOG = work / "log" / "run.lcmlog"
    RESOLVED = work / "log" / "experiment.yaml"  # everything in one file
    ROWS = (work / "log" / "series.csv").read_text().count("\n") - 1
    kinds = {"files": (attack_files, 250), "robots": (attack_robots, 80),
             "arguments": (attack_arguments, 130), "logs": (attack_logs, 130),
             "signals": (attack_signals, 15), "kills": (attack_kills, 5),
             "conditions": (attack_conditions, 30)}
    table = {}
    for kind, (attack, count) in kinds.items():
        if args.only not in ("", kind):
            continue
        row = table[kind] = dict.fromkeys(VERDICTS, 0)
        for i in range(max(1, round(count * args.scale))):
            rng = random.Random(f"{args.seed}/{kind}/{i}")
            folder = work / f"{kind}{i}"
            folder.mkdir()
            verdict, run = attack(rng, folder)
            row[verdict] += 1
            if verdict in ("lost", "crashed", "slow"):
                print(f"{kind} {i}: {verdict}: status {run.status}, {run.seconds:.1f} s, "
                      f"{run.megabytes:.0f} MB: {run.said[-300:]!r} ({folder})", flush=True)
            else:
                shutil.rmtree(folder)
    print(f"{'':<12}{'inputs':>8}" + "".join(f"{v:>10}" for v in VERDICTS))
    bad = 0
    for kind, row in table.items():
        print(f"{kind:<12}{sum(row.values()):>8}" + "".join(f"{row[v]:>10}" for v in VERDICTS))
        bad += row["lost"] + row["crashed"] + row["slow"]
    if bad == 0:
        shutil.rmtree(work)
    sys.exit(1 if bad else 0)


if __name__ == "__main__":
    main()
