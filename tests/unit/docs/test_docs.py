# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The Markdown files agree with the tree: the paths, links, ./run commands and tests that they name exist, and lists match the code.

For command lines of the programs, see tests/system/test_documented_commands.py.
"""

import re
import subprocess
import unittest
from pathlib import Path

from srfs import ROOT
from srfs.flight import deployments

TOP = ("docs", "lib", "nodes", "programs", "tests", "tools", "python", "ground", "hw_sim", "msgs", "launch_config", "packaging", "examples", "cmake")
# Folders of a running deployment (VAR) and of an installation whose names begin like folders of the tree.
NOT_OURS = re.compile(r"^(ground/(files|uplink\.json|web\.json|web_orders|dictionary\.cache|package_test\.seed)|lib/(systemd|modules)|docs/how-to/yamcs/(mdb|etc/(events|tc_uplink)))")
SOURCE = re.compile(r"(?<![\w./*-])[a-z][a-z0-9_]*\.(?:cpp|hpp|py|jinja|cmake)\b")
TREE = [p for p in subprocess.run(["git", "-C", ROOT, "ls-files", "--cached", "--others", "--exclude-standard"], capture_output=True, text=True, check=False)
        .stdout.splitlines()] or [str(p.relative_to(ROOT)) for p in ROOT.rglob("*") if "build-" not in str(p)]  # fmt: skip
DOCUMENTS = [ROOT / p for p in TREE if p.endswith(".md") and not p.startswith(".github/")]
TUTORIALS = "docs/tutorial/"  # what they name is made in them: tests/system/test_tutorials.py
LONGEST_LINE = 120
README_LINES = 100


def links_of(document):
    """(line, path or "", anchor) of a document's links within the tree."""
    for where, line in lines_of(document):
        for target in re.findall(r"\]\(([^)\s]+)\)", line):
            if not re.match(r"[a-z]+:", target):
                path, _, anchor = target.partition("#")
                yield where, path, anchor


def lines_of(document):
    for number, line in enumerate(document.read_text().splitlines(), 1):
        yield f"{document.relative_to(ROOT)}:{number}", line


def all_lines():
    for document in DOCUMENTS:
        yield from lines_of(document)


def anchors_of(document):
    """Anchors as GitHub makes them: lower case, hyphens for spaces, without other signs; and those of <a name>."""
    text = document.read_text()
    heads = re.findall(r"^#+ (.*?)\s*$", re.sub(r"^```.*?^```", "", text, flags=re.M | re.S), re.M)
    plain = (re.sub(r"\[(.*?)\]\(.*?\)", r"\1", head) for head in heads)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in plain} | set(re.findall(r'<a (?:name|id)="(.*?)"', text))


def sources(*folders):
    for folder in folders:
        for path in (ROOT / folder).rglob("*"):
            if path.suffix in (".cpp", ".hpp") and "test" not in path.relative_to(ROOT).parts:
                yield path


class Names(unittest.TestCase):
    def test_every_link_leads_somewhere(self):
        missing = []
        for document in DOCUMENTS:
            for where, path, anchor in links_of(document):
                file = (document.parent / path).resolve() if path else document
                if not file.exists() or (anchor and anchor not in anchors_of(file)):
                    missing.append(f"{where}: {path}#{anchor}")
        self.assertEqual(missing, [])

    def test_the_reading_path_leads_to_every_document(self):
        reached, ahead = set(), [ROOT / "docs/README.md"]
        while ahead:
            document = ahead.pop()
            if document in reached:
                continue
            reached.add(document)
            ahead += [file for _, path, _ in links_of(document) if (file := (document.parent / path).resolve()).suffix == ".md"]
        self.assertEqual([str(d.relative_to(ROOT)) for d in DOCUMENTS if d not in reached], [])

    def test_lines_can_be_read(self):
        # Table rows and links must stay on one line; everything else wraps.
        longer = [f"{where}: {len(line)}" for where, line in all_lines() if len(line) > LONGEST_LINE]
        self.assertEqual(longer, [])
        self.assertLessEqual(len((ROOT / "README.md").read_text().splitlines()), README_LINES)

    def test_every_path_of_the_tree_is_there(self):
        folders = "|".join(TOP)
        pattern = re.compile(rf"(?<![\w./$~-])(?:\.\./)*((?:{folders})/[\w./*-]*[\w*])")
        missing = []
        for where, line in all_lines():
            line = re.sub(r"\]\([^)]*\)", "]", line)  # test_every_link_leads_somewhere checks links
            for path in pattern.findall(line):
                if NOT_OURS.match(path) or re.search(r"\b(NAME|NODE|TASK|DIR|FILE|N)\b", path):
                    continue
                if not list(ROOT.glob(path)) and not list(ROOT.glob(f"{path}.*")):  # a module's name stands for its sources
                    missing.append(f"{where}: {path}")
        self.assertEqual(missing, [])

    def test_every_source_is_there(self):
        known = {Path(p).name for p in TREE}
        not_files = {"node.hpp", "x.hpp"}  # generated; an example
        found = [(where, name) for where, line in all_lines() if not where.startswith(TUTORIALS) for name in SOURCE.findall(line)]
        self.assertGreater(len(found), 50)
        self.assertEqual([f"{where}: {name}" for where, name in found if name not in known | not_files], [])

    def test_every_test_is_there(self):
        suites, tests = set(), set()
        for path in map(ROOT.joinpath, TREE):
            if path.suffix == ".cpp":
                for suite, name in re.findall(r"\bTEST(?:_F|_P)?\(\s*(\w+),\s*(\w+)\)", path.read_text(errors="replace")):
                    suites.add(suite)
                    tests.add(f"{suite}.{name}")
            elif path.suffix == ".py" and path.name.startswith("test"):
                for suite, body in re.findall(r"^class (\w+)\(.*?$(.*?)(?=^\S|\Z)", path.read_text(), re.M | re.S):
                    suites.add(suite)
                    names = re.findall(r"^    def (test_\w+)", body, re.M)
                    tests.update([*names, *(f"{suite}.{name}" for name in names)])
        examples = {"Suite.Name", "Class.test_name"}
        files = {Path(p).stem for p in TREE}
        missing = []
        for where, line in ((where, line) for where, line in all_lines() if not where.startswith(TUTORIALS)):
            for suite, name in re.findall(r"`([A-Z]\w+)\.(\*|[A-Z]\w+|test_\w+)`", line):
                there = suite in suites and (name == "*" or f"{suite}.{name}" in tests)
                missing += [] if there or f"{suite}.{name}" in examples else [f"{where}: {suite}.{name}"]
            missing += [f"{where}: {name}" for name in re.findall(r"`([A-Z]\w+Test)`", line) if name not in suites]
            missing += [f"{where}: {name}" for name in re.findall(r"(?<![\w.])(test_[a-z0-9_]+)\b", line) if name not in files | tests]
        self.assertEqual(missing, [])

    def test_every_name_of_ctest_is_there(self):
        cmake = "\n".join((ROOT / p).read_text() for p in TREE if Path(p).name == "CMakeLists.txt")
        known = set(re.findall(r"add_test\(NAME ([a-z]+\.\w+)", cmake))
        for function, prefix in (("srfs_add_unit_test", "unit."), ("srfs_add_system_test", "system."), ("srfs_add_fuzzer", "unit.fuzz_")):
            known |= {prefix + name for name in re.findall(rf"{function}\((\w+)", cmake)}
        known |= {f"unit.{name}_logic" for name in re.findall(r"add_(?:srfs_)?node\((\w+)", cmake)}
        named = [(where, name) for where, line in all_lines() for name in re.findall(r"(?<![\w.])((?:unit|system)\.(?!conf)[a-z]\w+)(?!\()", line)]
        self.assertEqual([f"{where}: {name}" for where, name in named if name not in known], [])

    def test_every_command_of_run_is_there_with_its_options(self):
        known = set(re.findall(r"^  ([a-z0-9-]+)  ", subprocess.run([ROOT / "run", "--help"], capture_output=True, text=True, check=True).stdout, re.M))
        self.assertIn("demo", known)
        helps, wrong = {}, []
        for where, line in all_lines():
            for command, rest in re.findall(r"\./run ([a-z][a-z0-9-]*)((?: +(?:--?[\w-]+|[\w.,-]+))*)", line):
                if command not in known:
                    wrong.append(f"{where}: ./run {command}")
                    continue
                if command not in helps:
                    helps[command] = subprocess.run([ROOT / "run", command, "--help"], capture_output=True, text=True, check=True).stdout
                wrong += [f"{where}: ./run {command} {option}" for option in re.findall(r"--[\w-]+", rest) if option not in helps[command]]
        self.assertGreater(len(helps), 8)
        self.assertEqual(wrong, [])


class Architecture(unittest.TestCase):
    text = (ROOT / "docs/explanation/architecture.md").read_text()

    def table(self, head):
        """{first cell: names in backticks in the second cell} of the table with this head."""
        rows = re.search(rf"^\| Node \| {head} \|\n\|[-|]+\|\n((?:\|.*\n)+)", self.text, re.M).group(1)
        table = {}  # a long row may be split into two
        for node, names in (line.strip("|\n").split("|") for line in rows.splitlines()):
            table.setdefault(node.strip(), set()).update(re.findall(r"`(\w+)`", names))
        return table

    def test_lists_the_workers_of_every_node(self):
        def created(*paths):
            text = "".join(path.read_text() for path in paths)
            return set(re.findall(r'create_(?:background_)?worker\(\s*"(\w+)"', text))

        commanding = created(*sources("lib/suite/commanding"))
        expected = {"payload_adcs, payload_eps, payload_thermal": created(*sources("nodes/payload")), "every node of a ring": {"ring"}}
        for node in ("timing", "can_switcher", "ttc", "image_acquisition", "image_processing", "maintenance"):
            files = list(sources(f"nodes/{node}"))
            expected[node] = created(*files) | (commanding if any("public CommandedNode" in f.read_text() for f in files) else set())
        self.assertEqual(self.table("Workers"), expected)
        self.assertIn('"ring"', "".join(f.read_text() for f in sources("lib/suite/ring")))

    def test_lists_the_logic_that_uses_the_disk(self):
        uses = re.compile(r"write_file_atomically|read_file\(|(?<![\w.>])open\(|openat\(|fsync\(|fdatasync\(|directory_iterator|file_size\(|FileTree::open|read_versions\(|StateFile<|_file\([^)]*\)\.(?:load|store)\(|BootStore\(")
        expected = {}
        for cmake in (ROOT / "nodes").glob("*/CMakeLists.txt"):
            if "add_srfs_node(" not in cmake.read_text():
                continue
            logic = re.search(r"add_srfs_node\((\w+)\s+LOGIC\s+(.*?)\s+(?:ADAPTER|DEPS|TEST)\b", cmake.read_text(), re.S)
            self.assertIsNotNone(logic, cmake)
            names = [word for word in re.sub(r"#.*", "", logic.group(2)).split() if "$" not in word]
            found = {Path(name).stem for name in names if uses.search((cmake.parent / name).read_text())}
            if found:
                expected[logic.group(1)] = found
        self.assertEqual(self.table("Logic that uses the disk"), expected)

    def test_says_where_the_ring_is_on(self):
        on = sorted(file.stem for file in deployments.FOLDER.glob("*.yaml") if "ring" in deployments.read(file))

        def named(pattern, text):
            return re.findall(r"`(\w+)`", re.search(pattern, text, re.S).group(1))

        self.assertEqual(named(r"liveness ring \(.*?\), on in (.*?); behind", self.text), on)


if __name__ == "__main__":
    unittest.main()
