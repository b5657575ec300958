# SPDX-License-Identifier: BSD-3-Clause
"""What the tests of the page share: a headless Chromium, poses by themselves, runs, web sockets."""
import argparse
import base64
import csv
import importlib
import json
import os
import pathlib
import re
import socket
import struct
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree as xml

import numpy as np
from selenium import webdriver
from selenium.webdriver.chrome.options import Options
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.support.ui import WebDriverWait

ROOT = pathlib.Path(__file__).resolve().parents[2]
PATIENCE = 180  # [s] to wait; what is waited for takes seconds on a machine that does nothing else
options = argparse.Namespace()


def main(description):
    parser = argparse.ArgumentParser(description=description,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build/release")
    parser.add_argument("--shots", type=pathlib.Path, help="folder for pictures of the page")
    parser.parse_args(namespace=options)
    if options.shots:
        options.shots.mkdir(parents=True, exist_ok=True)
    unittest.main(argv=["browser", "-v"])


def ves(*arguments, **how):
    """A command, as a process."""
    how.setdefault("stdout", subprocess.DEVNULL)
    return subprocess.Popen([str(options.build / "apps/ves"), *map(str, arguments)], text=True,
                            env=dict(os.environ, VES_CONFIG_DIR=str(ROOT / "config")), **how)


def message(name):
    """A type of lcmtypes/, as lcm-gen writes it."""
    if str(options.build / "python") not in sys.path:
        sys.path.insert(0, str(options.build / "python"))
    return getattr(importlib.import_module(f"ves.{name}"), name)


def rows(folder, key):
    """series.csv by a column's numbers."""
    with open(pathlib.Path(folder) / "series.csv") as file:
        return {round(float(row[key]), 6): row for row in csv.DictReader(file)}


# A program of ten seconds.
SHORT = ["--set", "program=[{move: {}}, {calibration: {}}, {admittance: {duration_s: 6}, robot: "
         "[{at_s: 1, duration_s: 2, joint: joint_2, to_deg_or_m: -60}]}]"]


# A machine that is busy with the browser sleeps through samples, and no test is about that.
PATIENT = [word for key in ("stale_ticks=1000", "stall_ticks=1000", "overruns_per_second=1000",
                            "position_error_still_m=0.1", "reading_jump_m=1") for word in ("--set", "safety." + key)]


class Run:
    """A run with a view beside it."""

    def __init__(self, out, *arguments):
        self.out = pathlib.Path(out)
        self.process = ves("run", "puma_on_table_4_1", "--view", "--private-bus", "--no-plots", "--quiet",
                           "--out", out, *PATIENT, *arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self.url = re.search(r"http://\S+", self.process.stdout.readline()).group(0)

    def end(self):
        """Ends what a failed test left running, so that it does not run beside the next."""
        self.process.kill()
        self.process.communicate()

    def wait(self):
        _, self.said = self.process.communicate(timeout=PATIENCE)
        return self.process.returncode

    def summary(self):
        return json.loads((self.out / "summary.json").read_text())

    def orders(self):
        """(source, sequence, request) of every operator_t in the log."""
        data, at, out = (self.out / "run.lcmlog").read_bytes(), 0, []
        while at + 28 <= len(data):
            _, _, _, channel, size = struct.unpack(">IqqII", data[at:at + 28])
            name, body = data[at + 28:at + 28 + channel], data[at + 28 + channel:at + 28 + channel + size]
            if name == b"VES_OPERATOR":
                order = message("operator_t").decode(body)
                out.append((order.header.source, order.header.sequence, order.request))
            at += 28 + channel + size
        return out


def browser(profile):
    flags = Options()
    flags.binary_location = "/usr/bin/chromium"
    for flag in ["--headless=new", "--no-sandbox", "--use-angle=swiftshader",
                 "--enable-unsafe-swiftshader", "--disable-gpu-rasterization",
                 "--disable-accelerated-2d-canvas", "--disable-dev-shm-usage",
                 "--window-size=1280,720", f"--user-data-dir={profile}"]:
        flags.add_argument(flag)
    flags.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    return webdriver.Chrome(options=flags, service=Service("/usr/bin/chromedriver"))


def errors(chromium):
    """What went wrong in the page. That its web socket asks again for a run that is over is no error."""
    asked_again = re.compile(r"WebSocket connection to .* failed: .*net::ERR_CONNECTION_REFUSED")
    return [e for e in chromium.get_log("browser") if e["level"] == "SEVERE" and not asked_again.search(e["message"])]


def turn(rpy):
    """X-Y-Z fixed angles."""
    (sa, sb, sg), (ca, cb, cg) = np.sin(rpy), np.cos(rpy)
    return (np.array([[cg, -sg, 0], [sg, cg, 0], [0, 0, 1]])
            @ np.array([[cb, 0, sb], [0, 1, 0], [-sb, 0, cb]])
            @ np.array([[1, 0, 0], [0, ca, -sa], [0, sa, ca]]))


def pose(p, rpy):
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = turn(rpy), p
    return X


def about(axis, angle):
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    X = np.eye(4)
    X[:3, :3] += np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
    return X


def links(urdf, q):
    """Poses of the links of a serial arm in its base, link by link as the file has them."""
    X, out, values = np.eye(4), [], iter(q)
    for joint in xml.parse(urdf).getroot().findall("joint"):
        origin = joint.find("origin")
        get = lambda key: [float(x) for x in (origin.get(key) or "0 0 0").split()] if origin is not None else [0, 0, 0]
        X = X @ pose(get("xyz"), get("rpy"))
        if joint.get("type") == "fixed":
            continue
        axis = np.array([float(x) for x in joint.find("axis").get("xyz").split()])
        X = X @ about(axis / np.linalg.norm(axis), next(values))
        out.append(X)
    return out


def poses(row, home):
    """Platform, tool and links of puma_on_table_4_1 as a row of series.csv has them."""
    get = lambda names: np.array([float(row[n]) for n in names])
    P = pose(get(["x_actual_m", "y_actual_m", "z_actual_m"]) + [0, 0, home],
             get(["alpha_actual_rad", "beta_actual_rad", "gamma_actual_rad"]))
    out = {"platform": P,
           "tool": pose(get(["tool_x_actual_m", "tool_y_actual_m", "tool_z_actual_m"]),
                        get(["tool_alpha_actual_rad", "tool_beta_actual_rad", "tool_gamma_actual_rad"]))}
    mount = pose([0, 0, 0.0957 + 0.0127], [0, 0, 0])  # config/robots/mount.yaml
    q = get([f"joint_{i}_rad" for i in range(1, 7)])
    for i, X in enumerate(links(ROOT / "config/robots/puma560.urdf", q)):
        out[f"link{i + 1}"] = P @ mount @ X
    return out


class Page(unittest.TestCase):
    """A folder, and a browser that keeps its page from test to test."""

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.out = pathlib.Path(cls.folder.name)
        cls.browser = browser(cls.out / "chromium")

    @classmethod
    def tearDownClass(cls):
        cls.browser.quit()
        cls.folder.cleanup()

    @classmethod
    def ask(cls, script, *values):
        return cls.browser.execute_script("return " + script, *values)

    @classmethod
    def until(cls, script):
        WebDriverWait(cls.browser, PATIENCE, 0.1).until(lambda b: cls.ask(script))

    @classmethod
    def shot(cls, name):
        if options.shots:  # without a processor of its own, a machine is slow at that
            cls.browser.save_screenshot(str(options.shots / (name + ".png")))


def frame(payload, opcode=1, final=True):
    """Of a client: masked."""
    n, mask = len(payload), os.urandom(4)
    head = bytes([(0x80 if final else 0) | opcode])
    head += (bytes([0x80 | n]) if n < 126 else bytes([0x80 | 126]) + struct.pack(">H", n)
             if n < 65536 else bytes([0x80 | 127]) + struct.pack(">Q", n))
    return head + mask + bytes(b ^ mask[i % 4] for i, b in enumerate(payload))


class WebSocket:
    """RFC 6455, as much as a test needs; `status` of the answer to the handshake."""

    def __init__(self, url, *, origin=None, host=None, protocol="ves"):
        place, _, query = url.removeprefix("http://").partition("/")
        address, _, port = place.partition(":")
        self.socket = socket.create_connection((address, int(port)), timeout=20)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        lines = [f"GET /{query} HTTP/1.1", f"Host: {host or place}", "Upgrade: websocket",
                 "Connection: Upgrade", "Sec-WebSocket-Version: 13",
                 "Sec-WebSocket-Key: " + base64.b64encode(os.urandom(16)).decode()]
        if origin != "":
            lines.append(f"Origin: {origin or 'http://' + place}")
        if protocol:
            lines.append(f"Sec-WebSocket-Protocol: {protocol}")
        self.socket.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
        self.buffer = b""
        while b"\r\n\r\n" not in self.buffer:
            more = self.socket.recv(4096)
            if not more:
                break
            self.buffer += more
        head, _, self.buffer = self.buffer.partition(b"\r\n\r\n")
        self.status = int(head.split()[1]) if head else None

    def close(self):
        self.socket.close()

    def take(self, n):
        while len(self.buffer) < n:
            more = self.socket.recv(65536)
            if not more:
                raise ConnectionError
            self.buffer += more
        out, self.buffer = self.buffer[:n], self.buffer[n:]
        return out

    def read(self):
        """(opcode, payload); ConnectionError when it is closed."""
        first, length = self.take(2)
        if length == 126:
            length, = struct.unpack(">H", self.take(2))
        elif length == 127:
            length, = struct.unpack(">Q", self.take(8))
        payload = self.take(length)
        if first & 15 == 8:
            raise ConnectionError(payload)
        return first & 15, payload

    def send(self, payload, opcode=1, final=True):
        self.socket.sendall(frame(payload, opcode, final))

    def closed(self):
        """Waits until the other side has closed; false when it goes on talking, or is silent for 5 s."""
        self.socket.settimeout(5)
        try:
            for _ in range(50):
                self.read()
        except TimeoutError:
            return False
        except OSError:
            return True
        return False
