#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""A run in real time in a headless Chromium.

  tests/browser/live_test.py --build build/release [--shots FOLDER]

Each run is on a bus of its own (--private-bus). What the page drew while it ran is compared with
series.csv afterwards.
"""
import numpy as np

import support

PERIOD = 0.01  # [s]
STOP = 2       # operator_t.request


class Live(support.Page):
    def open(self, run):
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
            self.assertLess(abs(rate - 1), 0.2)
            for name, matrix in zip(names, matrices):
                error = np.abs(np.array(matrix).reshape(4, 4).T - due[name]).max()
                self.assertLess(error, 1e-6, f"{name} at {t} s")

    def test_a_stop_takes_the_platform_home(self):
        run = support.Run(self.out / "stop")
        self.open(run)
        self.until("ves.time() > 5")
        self.browser.find_element("id", "stop").click()
        self.until("ves.words.includes('stop requested from a browser, and taken')")
        self.shot("stopped")
        self.assertEqual(run.wait(), 0, run.said)
        summary = run.summary()
        self.assertRegex(summary["ended_early"], r"a stop was requested at \d")
        self.assertLess(summary["simulated_s"], 15.0)
        orders = run.orders()
        self.assertEqual([request for *_, request in orders if request], [STOP] * len(orders))
        self.assertEqual(len({(source, sequence) for source, sequence, _ in orders}), 1)


if __name__ == "__main__":
    support.main(__doc__)
