# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Makes a picture of docs/pictures: python3 -m srfs.pictures flight|imaging|nodes|page. After ./run build; nodes needs none."""

import argparse
import tempfile
from pathlib import Path

from srfs import ROOT, program
from srfs.pictures import flight, imaging, nodes, page

PICTURES = {"flight": (flight, "svg"), "imaging": (imaging, "png"), "nodes": (nodes, "svg"), "page": (page, "png")}


def main():
    parser = argparse.ArgumentParser(prog="srfs.pictures", description="Makes a picture of docs/pictures.")
    parser.add_argument("name", choices=PICTURES)
    parser.add_argument("--out", type=Path, metavar="FILE", help="default: its file in docs/pictures")
    program.add_bin(parser)
    options = parser.parse_args()
    picture, kind = PICTURES[options.name]
    out = (options.out or ROOT / "docs/pictures" / f"{options.name}.{kind}").absolute()
    with tempfile.TemporaryDirectory(prefix="srfs_picture_") as folder:
        picture.make(options.bin.absolute(), Path(folder), out)
    print(out)
    return 0


if __name__ == "__main__":
    program.run_program("pictures", main)
