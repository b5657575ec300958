#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The wheel in bare environments: it runs, with either NumPy, and brings nothing that is under the GPL.

  wheel_test.py [PYTHON]    the wheel for this Python; without, for Debian's

Exit status 77 where no package index can be reached.
"""

import os
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
PROGRAM = """
import numpy, ves
run = ves.run("z_sine", {"legs.tau_s": 0.01}, seed=1)
assert run.phase == "parked", run.phase
assert abs(run["z_actual_m"]).max() > 0.15
assert "site-packages" in str(ves.config_folder()), ves.config_folder()
platform = ves.load_platform("desk")
lengths = ves.leg_lengths(platform, numpy.zeros((1000, 6)))
assert numpy.allclose(ves.forward_pose(platform, lengths), 0.0, atol=1e-9)
print(numpy.__version__)
"""


# What pandas reads is what CSV says.
TABLES = """
import pandas, sys
for name in sys.argv[1:]:
    table = pandas.read_parquet(name + ".parquet")
    text = pandas.read_csv(name + ".csv", keep_default_na=False, dtype=str)
    assert list(table.columns) == list(text.columns) and len(table) == len(text) > 1, name
    for column in table.columns:
        for there, said in zip(table[column], text[column]):
            if table[column].dtype == float and said not in ("", "nan"):
                assert there == float(said), (name, column, there, said)
            else:
                assert there == said or pandas.isna(there) and said in ("", "nan"), (name, column, there, said)
"""


def run(*command, cwd):
    bare = {"PATH": "/usr/bin:/bin", "HOME": str(cwd), "LANG": "C.UTF-8"}
    done = subprocess.run([str(word) for word in command], cwd=cwd, env=bare, text=True, capture_output=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}: {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def main():
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        interpreter = sys.argv[1] if len(sys.argv) > 1 else "/usr/bin/python3"
        subprocess.run([interpreter, "-m", "venv", folder / "env"], check=True)
        pip, python, ves = (folder / "env/bin" / name for name in ("pip", "python", "ves"))
        if subprocess.run([pip, "download", "--no-deps", "--quiet", "wheel", "-d", folder],
                          capture_output=True).returncode != 0:
            print("no package index")
            sys.exit(77)
        built = subprocess.run([ROOT / "ves", "wheel", *sys.argv[1:]], text=True, capture_output=True)
        if built.returncode != 0:
            sys.exit(built.stderr)
        wheel = pathlib.Path(built.stdout.split()[-1])
        assert "manylinux" in wheel.name, wheel.name
        run(pip, "install", "--quiet", wheel, cwd=folder)
        print(run(ves, "--version", cwd=folder).strip())
        run(ves, "demo", "--lockstep", "--out", "demo", cwd=folder)
        run(ves, "view", "demo", "--html", "demo.html", cwd=folder)
        assert (folder / "demo.html").stat().st_size > 500_000
        run(ves, "sweep", "z_sine", "--vary", "safety.translation_m=0.1,0.3", "--parquet", "--out", "swept",
            cwd=folder)
        # more rows than are written at a time
        run(ves, "run", "z_sine", "--lockstep", "--no-plots", "--set", "program=[{move: {duration_s: 700}}]",
            "--out", "long", cwd=folder)
        for to in ("--out", "long.csv"), ("--parquet", "long.parquet"):
            run(ves, "collect", "long", "--select", "z_", "phase", "kind", *to, cwd=folder)
        assert run(python, "-c", PROGRAM, cwd=folder).startswith("2.")
        run(pip, "install", "--quiet", "pandas", "pyarrow", cwd=folder)
        run(python, "-c", TABLES, "swept/sweep", "long", cwd=folder)
        if run(python, "-c", "import sys; print(sys.version_info < (3, 13))", cwd=folder).strip() == "True":
            run(pip, "install", "--quiet", "numpy<2", cwd=folder)  # which knows no later Python
            assert run(python, "-c", PROGRAM, cwd=folder).startswith("1.")
        names = os.listdir(next(folder.glob("env/lib/python*/site-packages/ves.libs")))
        assert any("lcm" in name for name in names) and not any("gsl" in name for name in names), names
        print(f"{wheel.name}: {wheel.stat().st_size / 1e6:.1f} MB, {len(names)} libraries")


main()
