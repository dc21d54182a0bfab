# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Flies ./run simulate with bugs of the project's history put back, one at a time, and reports which it finds.

Each bug is a patch in tests/simulation/history_bugs: a story, its requirement, the commit that mended it, and the
lines that bring it back where the environment variable SRFS_HISTORY_BUG has its name. All of them are built into one
program, which without the variable flies as the product does. A seed counts as a find only if it fails with the bug
and the same program passes the same seed without it. The seeds are not those that the simulation is developed with.
"""

import argparse
import json
import os
import re
import resource
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from srfs import ROOT

FOLDER = "tests/simulation/history_bugs"
GUARD = """#ifndef SRFS_HISTORY_BUG
#define SRFS_HISTORY_BUG
#include <cstdlib>
#include <string_view>
namespace history_bug {
inline bool is_on(std::string_view name) {
  static const char* const chosen = std::getenv("SRFS_HISTORY_BUG");
  return chosen != nullptr && name == chosen;
}
}  // namespace history_bug
#endif
"""
MOST_CPU_S = 600
FIRST_SEED = 100_001
STOP_AT_S = 1100  # a storm, a calm, and a part of the next storm


@dataclass
class Bug:
    name: str
    story: str
    requirement: str
    mended_by: str
    files: list


def bugs(root=ROOT):
    found = []
    for patch in sorted((root / FOLDER).glob("*.patch")):
        text = patch.read_text()
        field = lambda name: re.search(rf"^{name}: (.*)$", text, re.M)[1]  # noqa: E731
        story = " ".join(text.split("\n\n")[0].split())
        files = re.findall(r"^\+\+\+ b/(.*)$", text, re.M)
        found.append(Bug(patch.stem, story, field("Requirement"), field("Mended-by"), files))
    return found


def put_in(tree):
    """All bugs into the sources in `tree`, each asleep until it is chosen."""
    patches = [str(ROOT / FOLDER / f"{bug.name}.patch") for bug in bugs()]
    subprocess.run(["git", "apply", *patches], cwd=tree, check=True)
    for file in {file for bug in bugs() for file in bug.files}:
        path = Path(tree) / file
        path.write_text(GUARD + path.read_text())


def build(source):
    """@return the program, built from a clone of the present commit"""
    if not source.exists():
        subprocess.run(["git", "clone", "-q", "--shared", str(ROOT), str(source)], check=True)
        put_in(source)
    subprocess.run(["cmake", "--preset", "release"], cwd=source, check=True, stdout=sys.stderr)
    subprocess.run(["cmake", "--build", "build-release", "--target", "srfs-simulate"], cwd=source, check=True, stdout=sys.stderr)
    return source / "build-release/bin/srfs-simulate"


def fly(program, seed, bug, *options):
    """@return whether it ended well, what it printed, seconds of CPU"""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    environment = {**os.environ, "SRFS_HISTORY_BUG": bug}
    done = subprocess.run([str(program), "--seed", str(seed), "--stop-at", str(STOP_AT_S), *options], env=environment, capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode not in (0, 1):
        sys.exit(f"{program}: exit code {done.returncode}: {done.stderr}")
    return done.returncode == 0, done.stdout, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def violation_in(text):
    found = re.search(r"^VIOLATION of (.*)$", text, re.M)
    return found[1] if found else ""


def find(program, bug, first_seed, most_cpu_s):
    """Seed by seed until one fails because of the bug."""
    result = {"bug": bug.name, "found": False, "seeds": 0, "cpu_s": 0.0, "defects": []}
    seed = first_seed
    while result["cpu_s"] < most_cpu_s:
        well, text, cpu_s = fly(program, seed, bug.name, "--no-shrink")
        result["cpu_s"] += cpu_s
        result["seeds"] += 1
        if not well:
            well_without, text_without, _ = fly(program, seed, "", "--no-shrink")
            if well_without:
                _, shrunk, shrinking_s = fly(program, seed, bug.name)
                fewest = re.search(r"^Fewest faults that still fail: (.*)$", shrunk, re.M)[1]
                faults = [] if fewest == "none" else fewest.split(",")
                return {**result, "found": True, "seed": seed, "violation": violation_in(text), "faults": faults, "shrinking_s": shrinking_s}
            result["defects"].append({"seed": seed, "violation": violation_in(text_without)})
        seed += 1
    return result


def show(result):
    text = f"not found in {result['seeds']} seeds, {result['cpu_s']:.0f} s of CPU time"
    if result["found"]:
        text = f"seed {result['seed']}, {result['cpu_s']:.1f} s of CPU time, {len(result['faults'])} faults ({', '.join(result['faults'])}): {result['violation']}"
    print(f"{result['bug']:22} {text}", flush=True)
    for defect in result["defects"]:
        print(f"{'':22} defect of the product: seed {defect['seed']}: {defect['violation']}", flush=True)


def main():
    parser = argparse.ArgumentParser(prog="python3 -m srfs.history_bugs", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--put-in", metavar="TREE", help="only put all bugs into the sources in TREE, which must be a clone of this repository")
    parser.add_argument("--program", type=Path, help="srfs-simulate that was built from such a tree; default: clone and build in var/history_bugs")
    parser.add_argument("--only", nargs="*", metavar="BUG", help="these bugs; default: all")
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED, metavar="S")
    parser.add_argument("--cpu-s", type=float, default=MOST_CPU_S, metavar="S", help="CPU time until a bug counts as not found (default: 600)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the results there, too")
    options = parser.parse_args()
    if options.put_in:
        return put_in(options.put_in)
    chosen = [bug for bug in bugs() if not options.only or bug.name in options.only]
    program = options.program or build(ROOT / "var/history_bugs")
    results = []
    for bug in chosen:
        results.append(find(program, bug, options.first_seed, options.cpu_s))
        show(results[-1])
        if options.json:
            options.json.write_text(json.dumps(results, indent=1))
    found = sum(result["found"] for result in results)
    print(f"{found} of {len(results)} found")
    return 0 if found == len(results) and not any(result["defects"] for result in results) else 1


if __name__ == "__main__":
    sys.exit(main())
