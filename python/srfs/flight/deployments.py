# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Deployment files (launch_config/README.md) as the flight software reads them (lib/base/config.cpp)."""

import pathlib

import yaml

from srfs import ROOT
from srfs.program import MissionError

PAYLOADS = ("payload_adcs", "payload_eps", "payload_thermal")  # the paper's payload1, 2, 3
NODES = ("timing", "can_switcher", *PAYLOADS, "ttc", "image_acquisition", "image_processing", "maintenance")
FOLDER = ROOT / "launch_config"


def find(name):
    """The file that NAME means: a file, or launch_config/NAME.yaml."""
    for path in (pathlib.Path(name), FOLDER / f"{name}.yaml"):
        if path.is_file():
            return path.resolve()
    known = ", ".join(sorted(p.stem for p in FOLDER.glob("*.yaml")))
    raise MissionError(f"no deployment '{name}': expected a file, or one of {known}", code=2)


def files(file):
    """The file, then those that it extends."""
    chain = [pathlib.Path(file)]
    while name := yaml.safe_load(chain[-1].read_text()).get("extends"):
        base = chain[-1].with_name(f"{name}.yaml")
        if base in chain:
            raise ValueError(f"{chain[-1]}: 'extends': {name} extends this file")
        chain.append(base)
    return chain


def merged(upper, lower):
    """Mappings are merged; other values of `upper` replace those of `lower`, and None removes one."""
    result = dict(lower)
    for key, value in upper.items():
        if value is None:
            result.pop(key, None)
        elif isinstance(value, dict) and isinstance(lower.get(key), dict):
            result[key] = merged(value, lower[key])
        else:
            result[key] = value
    return result


def read(file):
    """What a file (or the NAME of one of launch_config) says, with those that it extends."""
    chain = files(find(file))
    result = yaml.safe_load(chain[-1].read_text())
    for upper in reversed(chain[:-1]):
        result = merged(yaml.safe_load(upper.read_text()), result)
    result.pop("extends", None)
    return result


def node(deployment, name):
    """The entry of a node; MissionError without one."""
    for entry in deployment["nodes"]:
        if entry["name"] == name:
            return entry
    raise MissionError(f"the deployment has no node '{name}'", code=2)


def scheduled(deployment, scheduling):
    """A deployment with other values of `scheduling`: {node: mapping}."""
    for name, value in scheduling.items():
        node(deployment, name)["scheduling"] = value
    return deployment


def realtime():
    """{node: scheduling} of the nodes that a board has under SCHED_FIFO, on any CPU."""
    board = {entry["name"]: entry["scheduling"] for entry in read("board_rk3568")["nodes"]}
    return {name: {**scheduling, "cpus": []} for name, scheduling in board.items() if scheduling["policy"] == "fifo"}


def write(deployment, file):
    file.write_text(yaml.safe_dump(deployment, sort_keys=False))
    return file


def copy(file, target, replacements):
    """Copies a file to `target`, those that it extends beside it. Each of `replacements` (old text, new text) changes the first file that has it."""
    chain = files(file)
    texts = [each.read_text() for each in chain]
    for old, new in replacements:
        found = [old in text for text in texts]
        if True not in found:
            raise ValueError(f"{file}: has no {old!r}")
        place = found.index(True)
        texts[place] = texts[place].replace(old, new, 1)
    for place, text in zip([target, *(target.with_name(each.name) for each in chain[1:])], texts):
        place.write_text(text)
    return target
