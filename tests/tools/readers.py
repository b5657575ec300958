#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""An MCAP file of `ves collect LOG --mcap` in the readers that others wrote.

  tests/tools/readers.py [--build build/release] [--readers FOLDER]

Fetches PyPI's mcap, mcap-ros2-support, rosbags and pymcap-cli into a virtual environment (FOLDER, kept, or
a temporary one), records a run, and checks: every message is decoded by mcap-ros2-support and by rosbags;
what they read equals series.csv; pymcap-cli doctor finds no error; two exports are the same bytes; a file
that is cut off anywhere is refused or read in part, by words.
"""
import argparse
import os
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
READERS = ["mcap==1.6.0", "mcap-ros2-support==0.6.0", "rosbags==0.11.9", "pymcap-cli==0.34.0"]


def inside(file, csv_file):
    """Runs in the virtual environment."""
    import csv
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory
    from rosbags.rosbag2.storage_mcap import McapReader
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    with open(csv_file) as f:
        rows = {int(float(row["tick"])): row for row in csv.DictReader(f)}
    count = compared = 0
    with open(file, "rb") as f:
        reader = make_reader(f, validate_crcs=True, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        ticks = {}
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            count += 1
            if channel.topic == "/ves/state":
                row = rows[decoded.header.sequence]
                ticks[message.log_time] = row
                pairs = [(decoded.x[2], row["z_commanded_m"]), (decoded.total[5], row["mz_total_nm"]),
                         (decoded.counts[5], row["leg6_command_count"]),
                         (decoded.leg_measured[0], row["leg1_measured_m"])]
            elif channel.topic == "/joint_states":
                row = ticks.get(message.log_time)
                pairs = [(p, row[f"{n}_rad"]) for n, p in zip(decoded.name, decoded.position)] if row else []
                # Joint angles of the truth are those of the sample.
            elif channel.topic == "/tf":
                row = ticks.get(message.log_time)
                first = decoded.transforms[0]
                assert first.child_frame_id == "platform", first.child_frame_id
                pairs = [(first.transform.translation.x, row["x_actual_m"])] if row else []
            else:
                pairs = []
            for ours, theirs in pairs:
                assert abs(ours - float(theirs)) < 1e-12, (channel.topic, ours, theirs)
                compared += 1
        assert count == summary.statistics.message_count, count
        attachments = [a.name for a in reader.iter_attachments()]
        assert len(attachments) == 1 and attachments[0].endswith(".yaml"), attachments
    print(f"mcap-ros2-support: {count} messages, {compared} numbers equal series.csv")

    store = get_typestore(Stores.EMPTY)
    with open(file, "rb") as f:
        for schema in make_reader(f).get_summary().schemas.values():
            types = get_types_from_msg(schema.data.decode(), schema.name)
            store.register({k: v for k, v in types.items() if k not in store.fielddefs})
    source, read = McapReader(pathlib.Path(file)), 0
    source.open()
    for connection, _, data in source.messages(source.connections):
        store.deserialize_cdr(data, connection.msgtype)
        read += 1
    source.close()
    assert read == count, (read, count)
    print(f"rosbags: {read} messages decoded")


def cut(file):
    """Cuts the file off at every thousandth of its bytes and reads what is left."""
    import io
    import struct
    from mcap.exceptions import McapError
    from mcap.stream_reader import StreamReader
    data, said, whole = pathlib.Path(file).read_bytes(), 0, 0
    for k in range(1000):
        try:
            whole += sum(1 for _ in StreamReader(io.BytesIO(data[:len(data) * k // 1000])).records) > 0
        except (McapError, struct.error):  # the reader's words for a short record
            said += 1
    print(f"cut off at 1000 places: {said} times the reader says so, {whole} times it reads what is there")


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build/release")
    parser.add_argument("--readers", type=pathlib.Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        home = options.readers or pathlib.Path(temporary) / "readers"
        if not (home / "bin/python").exists():
            subprocess.run([sys.executable, "-m", "venv", home], check=True)
            subprocess.run([home / "bin/pip", "install", "--quiet", *READERS], check=True)
        ves, out = options.build.resolve() / "apps/ves", pathlib.Path(temporary)
        env = dict(os.environ, VES_CONFIG_DIR=str(ROOT / "config"))
        subprocess.run([ves, "run", "puma_on_table_4_1", "--lockstep", "--no-plots", "--quiet",
                        "--out", out], check=True, env=env, stdout=subprocess.DEVNULL)
        for name in ("a", "b"):
            subprocess.run([ves, "collect", out / "run.lcmlog", "--mcap", out / f"{name}.mcap"],
                           check=True, env=env)
        assert (out / "a.mcap").read_bytes() == (out / "b.mcap").read_bytes()
        for call in ("inside", "cut"):
            subprocess.run([home / "bin/python", __file__, "--" + call, out / "a.mcap",
                            out / "series.csv"], check=True)
        subprocess.run([home / "bin/pymcap-cli", "doctor", out / "a.mcap"], check=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--inside"]:
        inside(*sys.argv[2:4])
    elif sys.argv[1:2] == ["--cut"]:
        cut(sys.argv[2])
    else:
        main()
