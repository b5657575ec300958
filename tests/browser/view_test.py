#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The page of `ves view` in a headless Chromium: what it draws is what the log says.

  tests/browser/view_test.py --build build/release [--shots FOLDER]

Poses are read back from the objects that are drawn and compared with series.csv and with forward
kinematics of the URDF that is written here. Debian's chromium, chromium-driver, python3-selenium and
python3-numpy.
"""
import argparse
import csv
import os
import pathlib
import subprocess
import tempfile
import unittest
import xml.etree.ElementTree as xml

import numpy as np
from selenium import webdriver
from selenium.webdriver.chrome.options import Options
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.support.ui import WebDriverWait

ROOT = pathlib.Path(__file__).resolve().parents[2]
options = None


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


class View(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.out = pathlib.Path(cls.folder.name)
        ves = [str(options.build / "apps/ves")]
        env = dict(os.environ, VES_CONFIG_DIR=str(ROOT / "config"))
        subprocess.run(ves + ["run", "puma_on_table_4_1", "--lockstep", "--no-plots", "--quiet",
                              "--out", str(cls.out)], check=True, env=env, stdout=subprocess.DEVNULL)
        cls.page = cls.out / "run.html"
        subprocess.run(ves + ["view", str(cls.out / "run.lcmlog"), "--html", str(cls.page)],
                       check=True, env=env, stdout=subprocess.DEVNULL)
        with open(cls.out / "series.csv") as file:
            cls.rows = {round(float(row["t_s"]), 6): row for row in csv.DictReader(file)}
        flags = Options()
        flags.binary_location = "/usr/bin/chromium"
        for flag in ["--headless=new", "--no-sandbox", "--use-angle=swiftshader",
                     "--enable-unsafe-swiftshader", "--disable-dev-shm-usage",
                     "--window-size=1280,720", f"--user-data-dir={cls.folder.name}/chromium"]:
            flags.add_argument(flag)
        flags.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        cls.browser = webdriver.Chrome(options=flags, service=Service("/usr/bin/chromedriver"))
        cls.browser.get(cls.page.as_uri())
        WebDriverWait(cls.browser, 60).until(
            lambda b: b.execute_script("return window.ves !== undefined && ves.count > 1"))

    @classmethod
    def tearDownClass(cls):
        cls.browser.quit()
        cls.folder.cleanup()

    def ask(self, script, *values):
        return self.browser.execute_script("return " + script, *values)

    def shot(self, name):
        file = options.shots / (name + ".png")
        self.browser.save_screenshot(str(file))
        return file

    def test_no_errors(self):
        self.assertEqual([e for e in self.browser.get_log("browser") if e["level"] == "SEVERE"], [])

    def test_is_small(self):
        size, data = self.page.stat().st_size, self.ask("VES_RECORDINGS[0].pictures.length")
        self.assertLess(size - data, 2_000_000)

    def test_draws_what_the_log_says(self):
        last = self.ask("ves.count") - 1
        for at in (5, last // 2, last - 5):
            self.ask("ves.show(arguments[0])", at)
            row = self.rows[round(self.ask("ves.time()"), 2)]
            get = lambda names: np.array([float(row[n]) for n in names])
            P = pose(get(["x_actual_m", "y_actual_m", "z_actual_m"]) + [0, 0, self.ask("VES_RECORDINGS[0].scene.home")],
                     get(["alpha_actual_rad", "beta_actual_rad", "gamma_actual_rad"]))
            tool = pose(get(["tool_x_actual_m", "tool_y_actual_m", "tool_z_actual_m"]),
                        get(["tool_alpha_actual_rad", "tool_beta_actual_rad", "tool_gamma_actual_rad"]))
            q = get([f"joint_{i}_rad" for i in range(1, 7)])
            mount = pose([0, 0, 0.0957 + 0.0127], [0, 0, 0])  # config/robots/mount.yaml
            due = {"platform": P, "tool": tool}
            for i, X in enumerate(links(ROOT / "config/robots/puma560.urdf", q)):
                due[f"link{i + 1}"] = P @ mount @ X
            for name in ["platform", "tool", "link1", "link3", "link6"]:
                drawn = np.array(self.ask("ves.matrix(arguments[0])", name)).reshape(4, 4).T
                self.assertLess(np.abs(drawn - due[name]).max(), 1e-6, f"{name} at {row['t_s']} s")

    def test_seeks_and_steps(self):
        middle = self.ask("ves.count") // 2
        self.browser.execute_script(
            "const s = document.getElementById('seek'); s.value = arguments[0];"
            "s.dispatchEvent(new Event('input'));", middle)
        before = self.ask("ves.time()")
        self.browser.find_element("id", "forth").click()
        self.assertGreater(self.ask("ves.time()"), before)
        self.browser.find_element("id", "back").click()
        self.assertEqual(self.ask("ves.time()"), before)
        self.browser.find_element("id", "play").click()
        WebDriverWait(self.browser, 60).until(lambda b: self.ask("ves.time()") > before + 0.2)
        self.browser.find_element("id", "play").click()

    def test_pictures_are_not_empty(self):
        self.ask("ves.show(arguments[0])", self.ask("ves.count") // 2)
        for view in ("iso", "front", "side", "top"):
            self.browser.find_element("css selector", f"[data-view={view}]").click()
            # What the canvas holds, in a coarse raster: more than a background.
            colours = self.browser.execute_async_script("""
              const done = arguments[arguments.length - 1];
              requestAnimationFrame(() => requestAnimationFrame(() => {
                const small = document.createElement('canvas');
                small.width = 64; small.height = 48;
                const context = small.getContext('2d');
                context.drawImage(document.getElementById('canvas'), 0, 0, 64, 48);
                const data = context.getImageData(0, 0, 64, 48).data, seen = new Set();
                for (let i = 0; i < data.length; i += 4) seen.add(data[i] << 16 | data[i + 1] << 8 | data[i + 2]);
                done(seen.size);
              }));""")
            self.assertGreater(colours, 50, view)
            self.shot(view)
        self.browser.set_window_size(420, 860)  # a telephone
        self.shot("telephone")
        self.assertLessEqual(self.ask("document.documentElement.scrollWidth"), 500)
        self.browser.set_window_size(1280, 720)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build/release")
    parser.add_argument("--shots", type=pathlib.Path)
    options = parser.parse_args()
    options.shots = options.shots or options.build / "shots"
    options.shots.mkdir(parents=True, exist_ok=True)
    unittest.main(argv=["view_test.py", "-v"])
