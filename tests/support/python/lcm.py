# SPDX-License-Identifier: BSD-3-Clause
"""As much of LCM's Python module as apps/examples uses, for the suite: Debian has none.

UDP multicast, short messages (lcm-proj.github.io, "UDP Multicast Protocol Description"). VES_TEST_LOSS: the share of
messages that are lost, each way.
"""
import os
import random
import re
import select
import socket
import struct
import time

MAGIC = 0x4C433032  # LC02
LOSS = float(os.environ.get("VES_TEST_LOSS", 0.0))


class LCM:
    def __init__(self, url):
        host, port = re.match(r"udpm://([\d.]+):(\d+)", url).groups()
        self.address, self.handlers, self.sequence = (host, int(port)), {}, 0
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        self.socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        self.socket.bind(self.address)
        self.socket.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP,
                               socket.inet_aton(host) + socket.inet_aton("0.0.0.0"))

    def subscribe(self, channel, handler):
        self.handlers[channel] = handler

    def publish(self, channel, data):
        self.sequence += 1
        if random.random() >= LOSS:
            packet = struct.pack(">II", MAGIC, self.sequence & 0xFFFFFFFF) + channel.encode() + b"\0" + data
            self.socket.sendto(packet, self.address)

    def handle_timeout(self, milliseconds):
        end = time.monotonic() + milliseconds * 1e-3
        while select.select([self.socket], [], [], max(0.0, end - time.monotonic()))[0]:
            packet = self.socket.recv(65536)
            if len(packet) < 9 or struct.unpack_from(">I", packet)[0] != MAGIC or random.random() < LOSS:
                continue
            channel, _, data = packet[8:].partition(b"\0")
            if channel.decode() in self.handlers:
                self.handlers[channel.decode()](channel.decode(), data)
                return 1
        return 0
