#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The page of `ves view` in a headless Chromium: what it draws is what the log says.

  tests/browser/view_test.py --build build/release [--shots FOLDER]

Poses are read back from the objects that are drawn and compared with series.csv and with forward
kinematics of the URDF that is written here. Debian's chromium, chromium-driver, python3-selenium and
python3-numpy.
"""
import pathlib

import numpy as np

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
    support.main(__doc__)
