#!/usr/bin/env python3
"""urdf_files.py URDF_COUNT FOLDER: reads every *.urdf below FOLDER with the program urdf_count, and
counts links, joints, mass, centre and inertia about the root once more, from the XML with numpy.
Prints what differs, what was refused, and every kind of warning. Status 1 when something differs.
"""
import collections
import json
import pathlib
import re
import subprocess
import sys
import xml.etree.ElementTree as ET

import numpy as np


def turned(rpy):
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array([[cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
                     [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
                     [-sp, cp * sr, cp * cr]])


def origin(element):
    o = element.find("origin")
    if o is None:
        return np.eye(3), np.zeros(3)
    numbers = lambda key: np.array([float(x) for x in o.get(key, "0 0 0").split()])
    return turned(numbers("rpy")), numbers("xyz")


def count(file):
    """links, joints in the tree's order, mass, first moment, inertia about the root: at zero."""
    text = file.read_text(encoding="utf-8", errors="replace")
    root = ET.fromstring(re.sub(r"<(/?)(\w+):", r"<\1\2_", text))  # prefixes without a namespace
    links = {link.get("name"): link for link in root.findall("link")}
    below, carried = collections.defaultdict(list), set()
    for joint in root.findall("joint"):
        below[joint.find("parent").get("link")].append(joint)
        carried.add(joint.find("child").get("link"))
    (first,) = [name for name in links if name not in carried]
    names, total = [], [0.0, np.zeros(3), np.zeros((3, 3))]

    def add(name, R, p):
        inertial = links[name].find("inertial")
        if inertial is not None:
            mass = float(inertial.find("mass").get("value"))
            Ro, po = origin(inertial)
            i = {k: float(inertial.find("inertia").get(k)) for k in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")}
            I = np.array([[i["ixx"], i["ixy"], i["ixz"]], [i["ixy"], i["iyy"], i["iyz"]],
                          [i["ixz"], i["iyz"], i["izz"]]])
            c = p + R @ po
            total[0] += mass
            total[1] += mass * c
            total[2] += R @ Ro @ I @ Ro.T @ R.T + mass * (c @ c * np.eye(3) - np.outer(c, c))
        for joint in below[name]:
            Rj, pj = origin(joint)
            here = R @ Rj, p + R @ pj
            if joint.get("type") != "fixed":
                names.append(joint.get("name"))
                here = at_zero(joint, *here, root)
            add(joint.find("child").get("link"), *here)

    add(first, np.eye(3), np.zeros(3))
    return len(links), names, *total


def at_zero(joint, R, p, root):
    """Where zero is outside the limits, a joint stands at the one next to it; one that follows, where that leads."""
    def value(j):
        mimic = j.find("mimic")
        if mimic is not None:
            master = next(o for o in root.findall("joint") if o.get("name") == mimic.get("joint"))
            return float(mimic.get("multiplier", 1)) * value(master) + float(mimic.get("offset", 0))
        limit = j.find("limit")
        if limit is None or j.get("type") == "continuous":
            return 0.0
        return min(max(0.0, float(limit.get("lower", 0))), float(limit.get("upper", 0)))

    q, axis = value(joint), joint.find("axis")
    a = np.array([float(x) for x in axis.get("xyz").split()]) if axis is not None else np.array([1.0, 0, 0])
    a /= np.linalg.norm(a)
    if joint.get("type") == "prismatic":
        return R, p + R @ (q * a)
    K = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    return R @ (np.eye(3) + np.sin(q) * K + (1 - np.cos(q)) * K @ K), p


def main(program, folder):
    files = sorted(pathlib.Path(folder).rglob("*.urdf"))
    lines = subprocess.run([program, *files], capture_output=True, text=True, check=True).stdout.splitlines()
    kinds, bad, refused, warned = collections.Counter(), 0, 0, 0
    for file, line in zip(files, lines):
        ours = json.loads(line)
        if "refused" in ours:
            refused += 1
            print("refused", ours["refused"][len(str(file.parent)) + 1:])
            continue
        warned += bool(ours["warnings"])
        for warning in ours["warnings"]:
            kinds[re.sub(r"^.*?:\d+: (link|joint|robot)( '[^']*')?: ", "", warning)[:100]] += 1
            print("  warning", warning[len(str(file.parent)) + 1:])
        links, joints, mass, moment, inertia = count(file)
        scale = 1e-9 * (1.0 + abs(mass) + np.abs(moment).max() + np.abs(inertia).max())
        if (links, joints) != (ours["links"], ours["joints"]) or abs(mass - ours["mass"]) > scale or \
                np.abs(moment - ours["moment"]).max() > scale or \
                np.abs(inertia - np.reshape(ours["inertia"], (3, 3))).max() > scale:
            bad += 1
            print("DIFFERS", file, (links, joints, mass, moment, inertia), ours)
    print(f"{len(files)} files: {bad} differ, {refused} refused, {warned} with warnings")
    return bad > 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
