# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Which part may use which other (docs/explanation/architecture_details.md: "Who uses whom"), read from the includes of its sources."""

import re
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]

# What a part may include beside itself and the system. "mission" and "srfs_msgs" are generated from msgs/.
MAY_USE = {
    "lib/base": set(),
    "lib/wire": {"base"},
    "lib/cfdp": {"base", "wire"},
    "lib/image": {"base"},
    "lib/hw": {"base", "image"},
    "lib/mcap": {"base"},
    "lib/update": {"base", "mission"},
    "lib/ros": {"base"},
    "lib/suite": {"base", "wire", "ros", "update", "mission", "srfs_msgs", "msgs/mission"},
    "msgs/mission": {"base", "wire"},
    "hw_sim": {"base", "wire", "hw", "image", "suite", "update"},
    "ground": {"base", "wire", "cfdp", "image", "update", "suite", "mission", "msgs/mission"},
    "programs/detect": {"base", "image"},
    "programs/product": {"base", "image"},
    "programs/lane": {"base", "msgs/mission", "update"},
    "programs/rescue": {"base", "wire", "cfdp", "hw", "suite", "update", "mission", "nodes/ttc"},
    "programs/srfs": {"base", "hw", "mcap", "ros", "suite", "update", "wire", "msgs/mission", "srfs_msgs"},
}
OF_NODES = {"base", "wire", "cfdp", "hw", "image", "ros", "suite", "update", "mission", "msgs/mission", "srfs_msgs"}
LIBRARY_OF_PAYLOADS = "nodes/payload"

INCLUDE = re.compile(r'^#include ["<]([a-z_0-9]+/[^">]+)[">]', re.MULTILINE)


def parts():
    """Folder of each part -> names of what it may use."""
    nodes = {str(f.relative_to(ROOT)) for parent in ("nodes", "examples", "mission") for f in (ROOT / parent).iterdir() if f.is_dir()}
    return MAY_USE | {node: OF_NODES | {LIBRARY_OF_PAYLOADS} | ({"hw_sim"} if not node.startswith("nodes") else set()) for node in nodes}


def part_of(include: str) -> str:
    """`nodes/ttc/ttc_core.hpp` -> `nodes/ttc`, `base/fd.hpp` -> `base`."""
    names = include.split("/")
    return "/".join(names[:2]) if names[0] in ("nodes", "programs", "msgs", "examples", "lib") or include.startswith("mission/payload_") else names[0]


def sources(folder: Path):
    return (f for f in folder.rglob("*.[ch]pp") if "test" not in f.relative_to(folder).parts)


class LayersTest(unittest.TestCase):
    def test_a_part_includes_only_parts_that_it_may_use(self):
        ours = {folder.removeprefix("lib/") for folder in parts()} | {"mission", "srfs_msgs"}
        for folder, may_use in parts().items():
            own = folder.removeprefix("lib/")
            for source in sources(ROOT / folder):
                used = {part_of(i) for i in INCLUDE.findall(source.read_text(encoding="utf-8"))} & ours
                self.assertLessEqual(used - {own}, may_use, f"{source.relative_to(ROOT)}: see {__file__}")

    def test_every_library_has_its_rule(self):
        self.assertEqual({f"lib/{f.name}" for f in (ROOT / "lib").iterdir() if f.is_dir()}, {f for f in MAY_USE if f.startswith("lib/")})

    def test_the_ros_layer_knows_no_node_and_no_payload(self):
        nodes = [f.name for parent in ("nodes", "mission") for f in (ROOT / parent).iterdir() if f.is_dir() and f.name != "payload"]
        for source in sources(ROOT / "lib/ros"):
            code = re.sub(r"//.*", "", source.read_text(encoding="utf-8"))
            for node in nodes:
                self.assertIsNone(re.search(rf'"/?{node}\b', code), f"{source.relative_to(ROOT)} names {node}")


class PythonTest(unittest.TestCase):
    """python/srfs (python/README.md): programs use what they share, not each other."""

    SHARED = {"ROOT", "program", "report", "record", "flight"}
    MAY_USE = {"report": set(), "program": {"ROOT"}, "record": {"report"}, "flight": SHARED - {"report"},
               "experiments": SHARED | {"measures"}, "measures": SHARED | {"demo"}, "pictures": SHARED | {"web"}}  # fmt: skip

    def test_a_module_uses_only_those_that_it_may_use(self):
        package = ROOT / "python/srfs"
        for source in package.rglob("*.py"):
            own = source.relative_to(package).parts[0].removesuffix(".py")
            imports = re.findall(r"^from srfs(?:\.(\w+)\S*)? import (.*)$", source.read_text(encoding="utf-8"), re.MULTILINE)
            used = {name for module, names in imports for name in ([module] if module else names.split(", "))}
            self.assertLessEqual(used - {own}, self.MAY_USE.get(own, self.SHARED), f"{source.relative_to(ROOT)}: see {__file__}")

    def test_modules_are_found_through_pythonpath_alone(self):
        edits = [str(f.relative_to(ROOT)) for folder in ("python", "tests", "tools", "msgs", "examples") for f in (ROOT / folder).rglob("*.py")
                 if f != Path(__file__) and re.search(r"\bsys\.path\b", f.read_text(encoding="utf-8"))]  # fmt: skip
        self.assertEqual(edits, [])


if __name__ == "__main__":
    unittest.main()
