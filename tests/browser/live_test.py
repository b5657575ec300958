#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""A run in real time in a headless Chromium.

  tests/browser/live_test.py --build build/release [--shots FOLDER]

Each run is on a bus of its own (--private-bus). What the page drew while it ran is compared with
series.csv afterwards.
"""
import subprocess
import time

import numpy as np
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import Select

import support

PERIOD = 0.01  # [s]
STOP = 2       # operator_t.request
FREE = [word for key in ("controller.compensation.feed_forward=true", "controller.compensation.observer=true",
                         "controller.compensation.inertia=true", "sensor.noise=false",
                         "program=[{move: {}}, {calibration: {}}, {admittance: {duration_s: 9}}]")
        for word in ("--set", key)]

PACED = FREE[:-1] + ["program=[{move: {}}, {calibration: {}}, {admittance: {duration_s: 30}}]"]
LONG = FREE[:-1] + ["program=[{move: {}}, {calibration: {}}, {admittance: {duration_s: 60}}]"]
SWINGING = FREE[:-1] + ["program=[{move: {}}, {calibration: {}}, {admittance: {duration_s: 600}, robot: ["
                        + ", ".join(f"{{at_s: {1 + 4 * k}, duration_s: 1.5, joint: joint_2, to_deg_or_m: {-60 if k % 2 == 0 else -90}}}"
                                    for k in range(149)) + "]}]"]


class Live(support.Page):
    def open(self, run):
        self.addCleanup(run.end)
        self.browser.get("about:blank")  # the page of the run before asks for it once a second
        support.errors(self.browser)
        self.browser.get(run.url)
        self.until("window.ves !== undefined && ves.count > 1")

    def test_draws_what_happens(self):
        run = support.Run(self.out / "live", *support.SHORT)
        self.open(run)
        home = self.ask("ves.live.home")
        seen = []
        names = ["platform", "tool", "link1", "link3", "link6"]
        for t in (3.0, 5.0, 7.0):
            self.until(f"ves.time() > {t}")
            seen.append(self.ask("[ves.time(), ves.live.head[2]].concat(arguments[0].map(ves.matrix))", names))
            self.shot(f"live_{t:.0f}")
        charted = np.array(self.ask("ves.charted()"))
        self.assertEqual(support.errors(self.browser), [])
        self.assertEqual(run.wait(), 0, run.said)
        # Every sample of the run, however seldom it was drawn.
        self.assertGreater(charted[-1] - charted[0], 5.0)
        self.assertLess(np.abs(np.diff(charted) - PERIOD).max(), 1e-4)
        ticks = support.rows(run.out, "tick")
        for t, rate, *matrices in seen:
            due = support.poses(ticks[round(t / PERIOD)], home)
            self.assertTrue(0 < rate < 1.2, rate)  # a machine with other work is late, and never early
            for name, matrix in zip(names, matrices):
                error = np.abs(np.array(matrix).reshape(4, 4).T - due[name]).max()
                self.assertLess(error, 1e-6, f"{name} at {t} s")

    def drag(self, name, dx, dy):
        """Shift, the mouse on that frame, so many pixels, and let go."""
        x, y = self.ask("ves.seen(arguments[0])", name)
        canvas = self.browser.find_element("id", "canvas")
        at = canvas.rect
        mouse = ActionChains(self.browser, duration=50)
        mouse.move_to_element_with_offset(canvas, int(x - at["x"] - at["width"] / 2), int(y - at["y"] - at["height"] / 2))
        mouse.key_down(Keys.SHIFT).click_and_hold().move_by_offset(dx // 2, dy // 2).move_by_offset(dx - dx // 2, dy - dy // 2)
        mouse.perform()
        self.shot("push")
        ActionChains(self.browser).release().key_up(Keys.SHIFT).perform()

    def test_a_push_moves_it_as_it_would_the_base(self):
        run = support.Run(self.out / "push", *LONG)  # however long the mouse takes
        self.open(run)
        Select(self.browser.find_element("id", "pushed")).select_by_value("platform")
        self.until("ves.words.includes('admittance') && ves.time() > 3.5")
        floor = self.ask("ves.seen('')")
        self.drag("platform", 80, 0)  # 0.25 N a pixel
        self.assertEqual(self.ask("ves.seen('')"), floor)  # nobody has turned the camera
        self.until(f"ves.time() > {self.ask('ves.time()') + 3}")
        self.browser.find_element("id", "stop").click()
        self.assertEqual(run.wait(), 0, run.said)
        rows = list(support.rows(run.out, "tick").values())
        force = np.array([[float(r[f"push_f{c}_n"]) for c in "xyz"] for r in rows])
        pushed = np.linalg.norm(force, axis=1) > 0
        self.assertAlmostEqual(np.linalg.norm(force[pushed][0]), 20, delta=0.5)
        self.assertAlmostEqual(pushed.sum() * PERIOD, 0.2, delta=0.011)
        # The base in free space was pushed alike: the platform moves as it does.
        summary = run.summary()
        self.assertGreater(summary["emulation_amplitude_m"], 5e-4)
        self.assertLess(summary["emulation_error_position_share"], 0.05)
        replayed = support.ves("replay", run.out, "--check", stdout=subprocess.PIPE)
        said, _ = replayed.communicate()
        self.assertEqual(replayed.returncode, 0, said)

    def test_sliders_change_the_vehicle_once_the_gate_lets_them(self):
        run = support.Run(self.out / "vehicle", *SWINGING)  # one that rests under a load waits
        self.open(run)
        self.until("ves.words.includes('admittance')")
        slide = """const s = document.getElementById(arguments[0]); s.value = arguments[1];
                   s.dispatchEvent(new Event('input'));"""
        self.browser.execute_script(slide, "stiffness", 0.3)
        self.until("ves.words.includes('vehicle: taken')")
        self.until("ves.words.includes('× 1, 1, 2')")
        self.browser.execute_script(slide, "mass", -0.3)
        self.until("ves.words.includes('× 0.5, 1, 2')")
        self.shot("vehicle")
        self.browser.find_element("id", "stop").click()  # however long the checks took
        self.assertEqual(run.wait(), 0, run.said)

    def test_time_stands_and_goes_slowly_in_lockstep(self):
        run = support.Run(self.out / "pace", "--lockstep", *PACED)
        self.open(run)
        self.until("ves.time() > 1")
        self.browser.find_element("css selector", "[data-pace='0']").click()
        self.until("ves.words.includes('time stands')")
        before = None
        while (now := self.ask("ves.live.head[0]")) != before:  # pictures on their way still come
            before = now
            time.sleep(1)  # that nothing comes has no condition to wait for
        # How fast it is at most: a machine with other work is slower, and that is no error.
        for pace, lasts in ((0.1, 0.3), (5, 5)):
            self.browser.find_element("css selector", f"[data-pace='{pace}']").click()
            self.until(f"Math.abs(ves.pace() - {pace}) < 1e-6")
            began, at = time.monotonic(), self.ask("ves.time()")
            self.until(f"ves.time() > {at + lasts}")
            self.assertLess((self.ask("ves.time()") - at) / (time.monotonic() - began), 1.5 * pace)
        self.until("ves.live.closed")
        self.assertEqual(run.wait(), 0, run.said)
        # What it was shown for changes nothing of what happened.
        alone = self.out / "alone"
        self.assertEqual(support.ves("run", "puma_on_table_4_1", "--lockstep", "--no-plots", "--quiet", "--out", alone, *PACED).wait(), 0)
        self.assertEqual((run.out / "series.csv").read_text(), (alone / "series.csv").read_text())

    def test_a_stop_takes_the_platform_home(self):
        run = support.Run(self.out / "stop")
        self.open(run)
        self.until("ves.time() > 5")
        self.browser.find_element("id", "stop").click()
        self.until("ves.words.includes('stop requested from a browser, and taken')")
        self.shot("stopped")
        self.assertEqual(run.wait(), 0, run.said)
        # At the end it says where the rest is, and has no buttons that do nothing.
        self.until("ves.words.includes('the run is over')")
        self.assertIn(str(run.out), self.ask("ves.words"))
        for name in ("stop", "touch"):
            self.assertTrue(self.ask("document.getElementById(arguments[0]).hidden", name))
        summary = run.summary()
        self.assertRegex(summary["ended_early"], r"a stop was requested at \d")
        self.assertLess(summary["simulated_s"], 15.0)
        orders = run.orders()
        self.assertEqual([request for *_, request in orders if request], [STOP] * len(orders))
        self.assertEqual(len({(source, sequence) for source, sequence, _ in orders}), 1)


if __name__ == "__main__":
    support.main(__doc__)
