#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The page of `ves view` in a headless Chromium: what it draws is what the log says.

  tests/browser/view_test.py --build build/release [--shots FOLDER]

Poses are read back from the objects that are drawn and compared with series.csv and with forward
kinematics of the URDF that is written here. Debian's chromium, chromium-driver, python3-selenium and
python3-numpy.
"""
import json
import struct
import subprocess

import numpy as np
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys

import support


class View(support.Page):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        log = cls.out / "run.lcmlog"
        cls.page = cls.out / "run.html"
        for arguments in (["run", "puma_on_table_4_1", "--lockstep", "--no-plots", "--quiet", "--out", cls.out],
                          ["view", log, "--html", cls.page]):
            if support.ves(*arguments).wait() != 0:
                raise RuntimeError(arguments)
        cls.rows = support.rows(cls.out, "t_s")
        cls.browser.get(cls.page.as_uri())
        cls.until("window.ves !== undefined && ves.count > 1")

    def test_no_errors(self):
        self.assertEqual(support.errors(self.browser), [])

    def test_is_small(self):
        size, data = self.page.stat().st_size, self.ask("VES_RECORDINGS[0].pictures.length")
        self.assertLess(size - data, 2_000_000)

    def test_draws_what_the_log_says(self):
        last = self.ask("ves.count") - 1
        for at in (5, last // 2, last - 5):
            self.ask("ves.show(arguments[0])", at)
            row = self.rows[round(self.ask("ves.time()"), 2)]
            due = support.poses(row, self.ask("VES_RECORDINGS[0].scene.home"))
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
        self.until(f"ves.time() > {before + 0.2}")
        self.browser.find_element("id", "play").click()

    def begin(self, address=""):
        self.browser.get("about:blank")
        self.browser.get(self.page.as_uri() + address)
        self.until("window.ves !== undefined && ves.count > 1")

    def column(self, name, factor=1):
        return np.array([float(row[name] or "nan") for row in self.rows.values()]) * factor

    def test_charts_have_every_tick(self):
        self.begin()  # the pictures are 60 a second
        self.assertEqual(self.ask("ves.layout")[0][:3], ["x_actual_m", "y_actual_m", "z_actual_m"])
        rows = np.array(self.ask("ves.chart(0).rows"), dtype=float)
        self.assertEqual(len(rows), len(self.rows))
        self.assertLess(np.abs(rows[:, 0] - self.column("t_s")).max(), 1e-5)
        for k, name in enumerate(self.ask("ves.layout")[0]):
            due = self.column(name, 1e3)
            self.assertTrue(np.array_equal(np.isnan(due), np.isnan(rows[:, 1 + k])), name)
            self.assertLess(np.nanmax(np.abs(rows[:, 1 + k] - due)), 1e-4 * max(1e-3, np.nanmax(due) - np.nanmin(due)), name)
        legs = next(k for k, names in enumerate(self.ask("ves.layout")) if names[0].startswith("leg1_commanded_m-"))
        due = self.column("leg1_commanded_m", 1e3) - self.column("leg1_measured_m", 1e3)
        drawn = np.array(self.ask(f"ves.chart({legs}).rows"), dtype=float)[:, 1]
        self.assertLess(np.abs(drawn - due).max(), 0.01)

    def plots(self):
        return self.browser.find_elements("css selector", ".plot")

    def add(self, chart, name):
        box = self.browser.find_elements("css selector", ".head input")[chart]
        box.clear()
        box.send_keys(name, Keys.ENTER)
        return box

    def test_any_curve_in_any_chart_and_all_of_it_in_the_address(self):
        self.begin()
        self.add(0, "fx_dynamic_n")  # a second axis
        self.assertIn("fx_dynamic_n", self.ask("ves.layout")[0])
        box = self.add(0, "energy_put_in_j")
        self.assertIn("two axes", self.ask("arguments[0].validationMessage", box))
        box = self.add(0, "no_such_thing")
        self.assertEqual(self.ask("arguments[0].validationMessage", box), "no such column")
        self.assertEqual(len(self.ask("ves.layout")[0]), 7)
        self.add(0, "")
        # Zoomed in one, zoomed in all.
        ActionChains(self.browser).move_to_element_with_offset(self.plots()[1], -60, 0).click_and_hold() \
            .move_by_offset(60, 0).release().perform()
        self.until("ves.window().every(w => w[1] - w[0] < 8)")
        windows = np.array(self.ask("ves.window()"))
        self.assertEqual(np.abs(windows - windows[0]).max(), 0)
        self.shot("charts")
        layout, address = self.ask("ves.layout"), self.ask("location.hash")
        self.begin(address)
        self.assertEqual(self.ask("ves.layout"), layout)
        self.assertLess(np.abs(np.array(self.ask("ves.window()")) - windows).max(), 2e-3)
        # What the mouse is over is told in every chart.
        ActionChains(self.browser).move_to_element(self.plots()[1]).perform()
        self.until("[0, 1, 2].every(k => ves.chart(k).chips[0].textContent !== '')")
        self.assertEqual(self.ask("document.querySelectorAll('.cursor.hover:not([hidden])').length"), len(layout))
        self.browser.find_element("css selector", ".chip").click()
        self.assertEqual(self.ask("ves.layout")[0], layout[0][1:])

    def test_two_runs_are_laid_over_each_other_by_name(self):
        other, both = self.out / "other", self.out / "both.html"
        for arguments in (["run", "puma_on_table_4_1", "--lockstep", "--no-plots", "--quiet", "--out", other, "--seed", "7"],
                          ["view", self.out, other, "--html", both]):
            self.assertEqual(support.ves(*arguments).wait(), 0)
        self.browser.get(both.as_uri())
        self.until("window.ves !== undefined && ves.count > 1")
        words = self.ask("ves.words")
        self.assertIn("solid: " + self.out.name, words)
        self.assertIn("dash-dotted: other", words)
        rows = np.array(self.ask("ves.chart(2).rows"), dtype=float)  # the force, with its noise
        names = self.ask("ves.layout")[2]
        self.assertEqual(rows.shape[1], 1 + 2 * len(names))
        mine = support.rows(other, "t_s")
        due = np.array([float(row["fx_dynamic_n"]) for row in mine.values()])
        known = ~np.isnan(rows[:, 1 + len(names)])
        self.assertLess(np.abs(rows[known, 1 + len(names)] - due[-known.sum():]).max(), 0.01)
        self.assertGreater(np.nanmax(np.abs(rows[:, 1] - rows[:, 1 + len(names)])), 0.1)

    def test_colours_can_be_read_and_told_apart(self):
        def luminance(c):
            c = np.where(c <= 0.03928, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
            return c @ [0.2126, 0.7152, 0.0722]

        def contrast(a, b):
            a, b = sorted((luminance(a), luminance(b)))
            return (b + 0.05) / (a + 0.05)

        def seen(c, how):  # as Machado, Oliveira and Fernandes (2009) have it, severity 1
            linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
            return np.clip(how @ linear, 0, 1)

        def lab(linear):
            xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]) @ linear
            f = np.cbrt(np.maximum(xyz / [0.9505, 1, 1.089], 0.008856))
            return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])

        eyes = {"every colour": np.eye(3),
                "no red": np.array([[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]),
                "no green": np.array([[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]])}
        self.begin()
        for theme in ("light", "dark"):
            self.browser.execute_script("document.documentElement.dataset.theme = arguments[0]", theme)
            of = lambda name: np.array([int(self.ask(
                "getComputedStyle(document.documentElement).getPropertyValue(arguments[0]).trim()", "--" + name)[i:i + 2], 16) / 255
                for i in (1, 3, 5)])
            lines = [of(f"c{k}") for k in range(1, 7)]
            for ground in ("back", "panel"):
                for name in ("ink", "soft", "stop", "ghost", "c1", "c2", "c3", "c4", "c5", "c6"):
                    self.assertGreaterEqual(contrast(of(name), of(ground)), 4.5, f"{name} on {ground}, {theme}")
            for eye, how in eyes.items():  # the three of a chart of x, y and z
                for i in range(3):
                    for j in range(i):
                        apart = np.linalg.norm(lab(seen(lines[i], how)) - lab(seen(lines[j], how)))
                        self.assertGreater(apart, 15, f"c{i + 1} and c{j + 1} for {eye}, {theme}")

    def test_a_film_and_a_picture_for_print(self):
        film, still = self.out / "run.mp4", self.out / "run.png"
        self.assertEqual(support.ves("view", self.out, "--video", film, "--from", 5, "--to", 6, "--rate", 10).wait(), 0)
        told = json.loads(subprocess.run(
            ["ffprobe", "-v", "error", "-count_frames", "-show_streams", "-of", "json", film], capture_output=True, check=True).stdout)["streams"][0]
        self.assertEqual((told["width"], told["height"], int(told["nb_read_frames"])), (1280, 720, 11))
        seen = {subprocess.run(["ffmpeg", "-v", "error", "-ss", str(t), "-i", film, "-frames:v", "1", "-f", "rawvideo", "-"],
                               capture_output=True, check=True).stdout for t in (0, 0.5)}
        self.assertEqual(len(seen), 2)  # it moves
        self.assertEqual(support.ves("view", self.out, "--png", still, "--at", 7, "--look", "front").wait(), 0)
        data = still.read_bytes()
        self.assertEqual(struct.unpack(">II", data[16:24]), (4000, 2250))
        self.assertEqual(struct.unpack(">4sIIB", data[37:50]), (b"pHYs", 11811, 11811, 1))  # 300 dots an inch
        for wrong in (["--video", self.out / "x.mp4", "--from", 100], ["--video", "/nowhere/x.mp4"],
                      ["--video", self.out / "x.avi"], ["--png", "/nowhere/x.png"]):
            refused = support.ves("view", self.out, *wrong, stderr=subprocess.PIPE)
            _, said = refused.communicate()
            self.assertEqual((refused.returncode, said.count("\n")), (2, 1), said)

    def test_pictures_are_not_empty(self):
        self.begin()
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
        for size in ((1280, 720), (1920, 1080), (420, 860)):  # the last a telephone
            self.browser.set_window_size(*size)
            self.until(f"document.documentElement.scrollWidth <= {max(500, size[0])}")  # once the charts have followed
            for _ in range(2):
                self.browser.find_element("id", "theme").click()
                self.shot(f"{size[0]}_{self.ask('document.documentElement.dataset.theme')}")
        self.browser.set_window_size(1280, 720)

    def test_one_exaggeration_for_all_that_moves(self):
        self.begin()
        self.browser.find_element("id", "trail").click()
        self.ask("ves.film(arguments[0])", 8.0)
        home = np.array([0, 0, self.ask("VES_RECORDINGS[0].scene.home")])
        before = [np.array(self.ask("ves.position(arguments[0])", name)) - home for name in ("platform", "base")]
        self.browser.execute_script("const s = document.getElementById('times'); s.value = 1; s.dispatchEvent(new Event('input'));")
        after = [np.array(self.ask("ves.position(arguments[0])", name)) - home for name in ("platform", "base")]
        for small, large in zip(before, after):
            self.assertGreater(np.linalg.norm(small), 1e-3)
            self.assertLess(np.abs(large - 10 * small).max(), 1e-5)
        # The legs go on ending where the platform's joints are.
        legs = self.ask("VES_RECORDINGS[0].scene.legs")
        platform = np.array(self.ask("ves.matrix('platform')")).reshape(4, 4).T
        for k, (below, above) in enumerate(legs):
            rod = np.array(self.ask("ves.matrix(arguments[0])", f"rod{k + 1}")).reshape(4, 4).T
            self.assertLess(np.abs(rod[:3, 3] - (platform @ [*above, 1])[:3]).max(), 1e-6)
            way = (rod[:3, 3] - below) / np.linalg.norm(rod[:3, 3] - below)
            self.assertLess(np.abs(rod[:3, 2] - way).max(), 1e-6)


if __name__ == "__main__":
    support.main(__doc__)
