#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""A run in real time and clients of its page that are slow, or behave badly; no browser.

  tests/browser/clients_test.py --build build/release

Each run is on a bus of its own (--private-bus).
"""
import json
import pathlib
import re
import socket
import struct
import tempfile
import time
import unittest

import support


class Frames:
    """A page without a browser: takes pictures as long as it is asked to."""

    def __init__(self, url):
        self.page = support.WebSocket(url)
        self.scene = None
        self.got = []  # their numbers

    def take(self):
        kind, payload = self.page.read()
        if kind == 1:
            self.scene = json.loads(payload)
            return self.take()
        number, _, _ = struct.unpack("<3d", payload[:24])
        size = 4 * self.scene["width"]
        assert len(payload) > 24 and (len(payload) - 24) % size == 0
        # All that came since the last one, and none twice.
        pictures = (len(payload) - 24) // size
        assert not self.got or number - pictures == self.got[-1], (number, pictures, self.got[-1])
        self.got.append(number)
        self.page.send(b"drawn")
        return self.got[-1]


class Clients(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.out = pathlib.Path(folder.name)

    def socket(self, url, **how):
        out = support.WebSocket(url, **how)
        self.addCleanup(out.close)
        return out

    def status(self, url):
        """Of a handshake, once there is room."""
        for _ in range(100):
            try:
                return self.socket(url).status
            except OSError:
                time.sleep(0.05)
        return None

    def frames(self, run):
        out = Frames(run.url)
        self.addCleanup(out.page.close)
        return out

    def test_who_is_slow_sees_what_is_new(self):
        run = support.Run(self.out, *support.SHORT)
        slow, quick = self.frames(run), self.frames(run)
        quick.take()
        slow.take()
        end = time.monotonic() + 4.0
        while time.monotonic() < end:  # one of them pauses
            quick.take()
        slow.take()  # what waited on the way
        number = slow.take()
        self.assertGreaterEqual(number, quick.got[-1])  # as new as what the other one has
        self.assertGreater(number, slow.got[1] + 100)
        self.assertEqual(len(slow.got), 3)
        self.assertEqual(run.wait(), 0, run.said)

    def test_strangers_get_nothing(self):
        run = support.Run(self.out)
        good = self.frames(run)
        good.take()
        wrong = run.url[:-1] + ("0" if run.url[-1] != "0" else "1")
        place = run.url.split("/")[2]
        address, port = place.split(":")
        for what, how in {
                "a wrong token": dict(url=wrong), "no token": dict(url=run.url.split("?")[0]),
                "another page": dict(origin="http://example.com"),
                "another port's page": dict(origin="http://127.0.0.1:1"),
                "no page": dict(origin=""),
                "another name": dict(host=f"evil.example:{port}", origin=f"http://evil.example:{port}"),
                "another protocol": dict(protocol="chat"), "no protocol": dict(protocol=None)}.items():
            with self.subTest(what):
                page = self.socket(how.pop("url", run.url), **how)
                self.assertNotEqual(page.status, 101)
                self.assertTrue(page.closed())
        for what, frames in {
                "no word": [(b"hello", 1)], "a number too large": [(b"stop 99999999999999999999", 1)],
                "binary": [(b"drawn", 2)], "long": [(b"drawn" * 1000, 1)], "empty": [(b"", 1)],
                "another opcode": [(b"drawn", 5)], "no text": [(b"\xff\xfe", 1)],
                "a flood": [(b"drawn", 1)] * 1000, "pieces without an end": [(b"drawn", 1, False)] + [(b"drawn", 0, False)] * 60}.items():
            with self.subTest(what):
                page = self.socket(run.url)
                self.assertEqual(page.status, 101)
                try:
                    for frame in frames:
                        page.send(*frame)
                except OSError:
                    pass
                self.assertTrue(page.closed())
        for what, text in {"no HTTP": b"\x16\x03\x01" * 500, "a long line": b"GET /" + b"a" * 20000,
                           "a body": b"POST / HTTP/1.1\r\nHost: " + place.encode() +
                                     b"\r\nContent-Length: 100000\r\n\r\n" + b"x" * 100000}.items():
            with self.subTest(what), socket.create_connection((address, int(port)), timeout=20) as raw:
                try:
                    raw.sendall(text)
                    answer = raw.recv(4096)
                    self.assertTrue(answer == b"" or re.match(rb"HTTP/1.. 4", answer), answer)
                except OSError:
                    pass
        with self.subTest("a message in pieces"):
            page = self.socket(run.url)
            self.assertEqual([page.read()[0] for _ in range(2)], [1, 2])  # the scene, a picture
            for byte in support.frame(b"dra", 1, False) + support.frame(b"wn", 0):
                page.socket.sendall(bytes([byte]))
            self.assertEqual(page.read()[0], 2)  # it was understood: the next
        with self.subTest("a stop for another controller"):
            page = self.socket(run.url)
            page.send(b"stop 7")
            page.read()  # is let in, and does nothing
        with self.subTest("too many"):
            crowd = [socket.create_connection((address, int(port)), timeout=20) for _ in range(60)]
            good.take()
            for raw in crowd:
                raw.close()
        with self.subTest("and when they have gone, others"):
            self.assertEqual(self.status(run.url), 101)
        last = good.take()
        good.take()
        self.assertGreater(good.got[-1], last)
        self.assertEqual(run.wait(), 0, run.said)
        self.assertNotIn("ended_early", run.summary())
        self.assertEqual(run.orders(), [])
        told = re.search(r"not let in: (\d+) without the token, (\d+) from elsewhere, (\d+) malformed, (\d+) too many", run.said)
        self.assertIsNotNone(told, run.said)
        self.assertEqual([int(n) for n in told.groups()[:2]], [2, 4])
        self.assertGreaterEqual(int(told.group(3)), 9)
        self.assertGreater(int(told.group(4)), 20)


if __name__ == "__main__":
    support.main(__doc__)
