#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Published robot descriptions, and what becomes of each: the table of docs/robots.md.

  tests/tools/robots.py [--build build/release] [FOLDER]

Loads every URDF of the PyPI package example-robot-data (fetched with pip into a temporary folder),
or of FOLDER, and asks check_tree of the build how far Newton-Euler is from KDL's tree solver and from
the rate of momentum. Where more joints can move than may, the tip is the first link at the end of the longest
chain that may move.
"""
import argparse
import pathlib
import re
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as xml
import zipfile

PACKAGE = "example-robot-data==6.0.0"
MOST = 12


def fetch(folder):
    subprocess.run([sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--dest", folder,
                    PACKAGE], check=True)
    for wheel in pathlib.Path(folder).glob("*.whl"):
        zipfile.ZipFile(wheel).extractall(folder)


def tip(file):
    """The first link at the end of the longest chain of at most twelve joints."""
    joints = [j for j in xml.parse(file).getroot().findall("joint") if j.find("child") is not None]
    above = {j.find("child").get("link"): j for j in joints}
    parents = {j.find("parent").get("link") for j in joints}

    def moves(link):
        count = 0
        while link in above:
            joint = above[link]
            count += joint.get("type") != "fixed" and joint.find("mimic") is None
            link = joint.find("parent").get("link")
        return count

    ends = [link for link in above if link not in parents]
    return max((link for link in ends if moves(link) <= MOST), key=moves, default=None)


def ask(ves, file, sets):
    told = subprocess.run([ves, "robot", str(file)] + [f"--set={s}" for s in sets],
                          capture_output=True, text=True, timeout=60)
    return told.returncode, (told.stdout if told.returncode == 0 else told.stderr)


def row(ves, check, file, top, worst):
    name = str(file.relative_to(top)).split("robots/", 1)[-1]
    status, text = ask(ves, file, [])
    chosen = "all"
    if status and "may: say which" in text:
        chosen = f"`tip: {tip(file)}`"
        status, text = ask(ves, file, [f"tip={tip(file)}"])
    if status:
        return f"| {name} | | | refused: {text.strip().split(file.name + ':', 1)[-1]} | | |", False
    joints = re.search(r"move by (\d+) joints", text).group(1)
    mass = re.search(r"^  (\S+) kg, centre", text, re.M).group(1)
    exact = subprocess.run([check, str(file)] + ([tip(file)] if chosen != "all" else []),
                           capture_output=True, text=True, timeout=60, check=True).stdout.split()
    worst.append(max(map(float, exact)))
    return f"| {name} | {joints} | {float(mass):.4g} | {chosen} | {exact[0]} | {exact[1]} |", True


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", default="build/release")
    parser.add_argument("folder", nargs="?")
    options = parser.parse_args()
    build = pathlib.Path(options.build).resolve()
    ves, check = build / "apps/ves", build / "tests/check_tree"
    with tempfile.TemporaryDirectory() as temporary:
        top = pathlib.Path(options.folder or temporary)
        if not options.folder:
            fetch(temporary)
        worst = []
        rows = [row(ves, check, file, top, worst) for file in sorted(top.rglob("*.urdf"))]
    print("| file | joints that move | mass [kg] | which | off from KDL | from momentum |\n"
          "|---|---|---|---|---|---|")
    print("\n".join(text for text, _ in rows))
    print(f"\n{sum(good for _, good in rows)} of {len(rows)} load; the largest error is {max(worst):.1e}.")


if __name__ == "__main__":
    main()
