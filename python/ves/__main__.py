# SPDX-License-Identifier: BSD-3-Clause
"""`ves`, or `python -m ves`: the program that came with this package."""

import os
import pathlib
import sys


def main():
    program = pathlib.Path(__file__).parent / "bin/ves"
    if not program.exists():
        sys.exit("ves: this package came without the program; it is that of the checkout, ./ves")
    os.execv(program, [str(program), *sys.argv[1:]])


if __name__ == "__main__":
    main()
