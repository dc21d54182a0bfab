# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Deployment files (launch_config/README.md) as the flight software reads them (lib/base/config.cpp)."""

import pathlib

import yaml

from srfs import ROOT

PAYLOADS = ("payload_adcs", "payload_eps", "payload_thermal")  # the paper's payload1, 2, 3
NODES = ("timing", "can_switcher", *PAYLOADS, "ttc", "image_acquisition", "image_processing", "maintenance")
FOLDER = ROOT / "launch_config"


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
    """What a file says, with those that it extends. A name without a folder is one of launch_config."""
    chain = files(FOLDER / f"{file}.yaml" if "/" not in str(file) else file)
    result = yaml.safe_load(chain[-1].read_text())
    for upper in reversed(chain[:-1]):
        result = merged(yaml.safe_load(upper.read_text()), result)
    result.pop("extends", None)
    return result


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
