# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Checks the hardening of ELF programs and libraries from the file itself (readelf): x86-64 and arm64, on any machine.

python3 -m srfs.hardening FOLDER...: checks all ELF files directly in the folders and prints one line per fault. Exit code 1 if there is any.
"""

import dataclasses
import re
import subprocess
import sys
from pathlib import Path

X86_64 = "Advanced Micro Devices X86-64"
AARCH64 = "AArch64"
# First octets of a function that an indirect branch may enter (IBT, BTI).
LANDING_PADS = {
    X86_64: (bytes.fromhex("f30f1efa"),),  # endbr64
    AARCH64: tuple(word.to_bytes(4, "little") for word in (0xD503233F, 0xD503245F, 0xD50324DF)),  # paciasp, bti c, bti jc
}
START_FILES = {"_init", "_fini", "_start"}  # crti.o and crt1.o of Debian have no landing pads


@dataclasses.dataclass
class Elf:
    machine: str
    pie: bool
    shared: bool
    segments: dict  # type -> flags of the last one
    bind_now: bool
    runpath: list | None  # its elements
    properties: str
    undefined: set  # names of symbols that other files provide
    without_pad: list  # exported functions that do not begin with a landing pad
    functions: int  # number of exported functions


def is_elf(path):
    with path.open("rb") as file:
        return file.read(4) == b"\x7fELF"


def elf_files(*folders):
    return sorted(p for folder in folders for p in Path(folder).iterdir() if p.is_file() and not p.is_symlink() and is_elf(p))


def read(path):
    command = ["readelf", "-hldnW", "--dyn-syms", str(path)]
    text = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60, env={"LC_ALL": "C", "PATH": "/usr/bin:/bin"}).stdout
    machine = re.search(r"Machine: +(.+)", text).group(1).strip()
    loads, segments = [], {}
    for name, offset, address, size, flags in re.findall(r"^  ([A-Z_]+) +(0x\S+) (0x\S+) 0x\S+ (0x\S+) 0x\S+ ([RWE ]{3})", text, re.M):
        segments[name] = flags.replace(" ", "")
        if name == "LOAD":
            loads.append((int(address, 16), int(size, 16), int(offset, 16)))
    flags = " ".join(re.findall(r"\((?:FLAGS|FLAGS_1)\) +(?:Flags: )?(.*)", text))
    runpath = re.search(r"\((?:RUNPATH|RPATH)\) +Library r(?:un)?path: \[(.*)\]", text)
    content = path.read_bytes()
    undefined, functions, without_pad = set(), 0, []
    for value, kind, binding, index, name in re.findall(r"^ +\d+: (\w+) +\S+ (\S+) +(\S+) +\S+ +(\S+) (\S+)", text, re.M):
        name = name.partition("@")[0]
        if index == "UND":
            undefined.add(name)
        elif kind == "FUNC" and binding in ("GLOBAL", "WEAK") and name not in START_FILES:
            address = int(value, 16)
            (start,) = (offset + address - first for first, size, offset in loads if first <= address < first + size)
            functions += 1
            if content[start : start + 4] not in LANDING_PADS.get(machine, ()):
                without_pad.append(name)
    return Elf(machine=machine, pie="PIE" in flags.split(), shared="(SONAME)" in text, segments=segments,
               bind_now="BIND_NOW" in flags.split() or "NOW" in flags.split(), runpath=runpath and runpath.group(1).split(":"),
               properties=" ".join(re.findall(r"Properties: (.*)", text)), undefined=undefined, without_pad=without_pad, functions=functions)  # fmt: skip


def is_fortified(elf):
    return any(re.fullmatch(r"__\w+_chk", name) and name != "__stack_chk_fail" for name in elf.undefined)


def has_stack_protector(elf):
    return "__stack_chk_fail" in elf.undefined


def faults(elf, absolute_runpath=False):
    """Lists the missing hardening. absolute_runpath: the file lies elsewhere than its libraries, as programs compiled on board do."""
    found = []
    if not elf.shared and not elf.pie:
        found.append("not position independent")
    if "GNU_RELRO" not in elf.segments:
        found.append("no RELRO")
    if not elf.bind_now:
        found.append("symbols are resolved while it runs (no BIND_NOW)")
    if "E" in elf.segments.get("GNU_STACK", "E"):
        found.append("executable stack")
    if any(flags == "RWE" for flags in elf.segments.values()):
        found.append("a segment to write and to execute")
    for element in elf.runpath or ():
        if not element:
            found.append("RUNPATH with an empty element: the current folder")
        elif not (element == "$ORIGIN" or element.startswith("$ORIGIN/")) and not (absolute_runpath and element.startswith("/")):
            found.append(f"RUNPATH with {element}")
    if elf.machine == X86_64 and "SHSTK" not in elf.properties:
        found.append("no note of the shadow stack (SHSTK)")
    if elf.without_pad:
        found.append(f"{len(elf.without_pad)} of {elf.functions} functions without a landing pad: {' '.join(elf.without_pad[:3])}")
    return found


def faults_below(*folders):
    return [f"{path}: {fault}" for path in elf_files(*folders) for fault in faults(read(path))]


def main(folders):
    lines = faults_below(*folders)
    count = len(elf_files(*folders))
    print(*lines, f"{count} programs and libraries, {len(lines)} faults", sep="\n")
    return 1 if lines or not count else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
