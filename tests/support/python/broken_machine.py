# SPDX-License-Identifier: BSD-3-Clause
"""apps/examples/machine.py with one thing wrong: broken_machine.py WHAT."""
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[3] / "apps/examples"))
import machine  # noqa: E402


class Broken(machine.Machine):
    def __init__(self, what):
        super().__init__(200.0, "udpm://239.255.76.67:7667?ttl=0", "machine")
        self.what, self.begun = what, time.monotonic()
        if what == "epoch 0":
            self.epoch = 0

    def sample(self):
        m = super().sample()
        if self.what == "restart" and (self.command and self.command.engaged or time.monotonic() - self.begun > 1.5):
            self.source, self.epoch, self.sequence, self.begun = self.source + 1, time.time_ns(), 0, time.monotonic()
        if self.what == "stalled clock":
            m.header.time_ns = 10**9
        if self.what == "NaN":
            m.q[1] = float("nan")
        if self.what == "ADC out of range":
            m.adc[2] = 40000
        if self.what == "swapped legs":
            m.legs[1], m.legs[4] = m.legs[4], m.legs[1]
        return m

    def reference(self):
        if self.what == "keeps its reference" and self.engaged:
            return self.engaged.counts
        return super().reference()


Broken(sys.argv[1]).run()
