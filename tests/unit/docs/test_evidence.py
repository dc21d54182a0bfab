# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The pages of docs/evidence match the results in docs/evidence/results, and each result states its origin."""

import re
import subprocess
import unittest
from unittest import mock

from srfs import ROOT, evidence

TOPICS = {name: evidence.load(name) for _, _, names in evidence.PAGES.values() for name in names}


def git(*arguments):
    return subprocess.run(["git", "-C", ROOT, *arguments], capture_output=True, text=True, check=False)


def results():
    """(description, topic, run, row) of each row."""
    for name, topic in TOPICS.items():
        for run in topic["runs"]:
            for row in run["rows"]:
                yield f"{name}: {run.get('title', '')}: {row['measure']}", topic, run, row


def example(**changes):
    run = {"command": "./run bench time", "commit": "0123abc", "date": "2026-11-22", "load": "none", "rows": [{"measure": "a", "found": "1"}]}
    return {"title": "Example", "introduction": ["Text."], "machine": "a board", "runs": [run | changes]}


def page_of(topic):
    with mock.patch.object(evidence, "load", lambda _: topic), mock.patch.object(evidence, "PAGES", {"page.md": ("Page", ["Text."], ("example",))}):
        return evidence.render("page.md")


class Results(unittest.TestCase):
    def test_each_row_has_commit_machine_and_command(self):
        self.assertGreater(len(list(results())), 200)
        for where, topic, run, row in results():
            with self.subTest(where):
                self.assertRegex(row.get("commit", run["commit"]), r"^[0-9a-f]{7,40}$")
                self.assertRegex(run["date"], r"^20\d\d-\d\d-\d\d$")
                for text in (run.get("machine", topic["machine"]), run["load"], row["measure"]):
                    self.assertTrue(text.strip())
                commands = [run["command"]] if isinstance(run["command"], str) else run["command"]
                self.assertTrue(commands and all(command.strip() for command in commands))
                self.assertTrue(any(row["found"]))
                self.assertFalse(row.get("verdict") and not row.get("goal"), "a verdict without a goal")

    def test_their_commits_are_in_the_history(self):
        if git("rev-parse", "--is-shallow-repository").stdout.strip() != "false":
            self.skipTest("the history is not here")
        named = {row.get("commit", run["commit"]) for _, _, run, row in results()}
        pages = "".join((evidence.FOLDER / page).read_text() for page in evidence.PAGES)
        named |= set(re.findall(r"[Cc]ommit `([0-9a-f]{7,40})`", pages))
        # An ancestor, not only an object: a commit that was rebased since is still in its author's clone, and in no other.
        self.assertEqual([commit for commit in sorted(named) if git("merge-base", "--is-ancestor", commit, "HEAD").returncode != 0], [])

    def test_each_file_is_shown_on_a_page(self):
        self.assertEqual({path.stem for path in (evidence.FOLDER / "results").glob("*.json")}, set(TOPICS))


class Pages(unittest.TestCase):
    def test_are_those_of_the_results(self):
        for page in evidence.PAGES:
            self.assertEqual((evidence.FOLDER / page).read_text(), evidence.render(page), f"{page} is stale: run python/srfs/evidence.py")

    def test_have_headings_of_their_own(self):
        for page in evidence.PAGES:
            heads = re.findall(r"^#+ (.*)$", re.sub(r"^```.*?^```", "", evidence.render(page), flags=re.M | re.S), re.M)
            self.assertEqual(len(heads), len(set(heads)), page)

    def test_columns_are_shown_where_a_row_fills_them(self):
        self.assertIn("| Measure | Found |\n|---|---|\n| a | 1 |\n", page_of(example()))
        rows = [{"measure": "a", "found": ["1", "2"], "goal": "3", "verdict": "missed", "note": "Why."}, {"measure": "b", "found": ["4", "5"], "note": "Why."}]
        page = page_of(example(rows=rows, columns=["M", "x", "y"]))
        self.assertIn("| M | x | y | Goal | Verdict | Note |\n|---|---|---|---|---|---|\n| a | 1 | 2 | 3 | **missed** | 1 |\n| b | 4 | 5 |  |  | 1 |\n", page)
        self.assertIn("\n1. Why.\n", page)
        self.assertIn("- [Example](#example): 0 of 1 goals met\n", page)

    def test_a_commit_of_a_single_row_is_shown(self):
        page = page_of(example(rows=[{"measure": "a", "found": "1"}, {"measure": "b", "found": "2", "commit": "4567def"}]))
        self.assertIn("| a | 1 | `0123abc` |\n| b | 2 | `4567def` |\n", page)

    def test_lines_that_are_too_long_and_rows_that_do_not_fit_are_refused(self):
        for rows in ([{"measure": "a" * 120, "found": "1"}], [{"measure": "a", "found": ["1", "2"]}]):
            with self.assertRaises(SystemExit):
                page_of(example(rows=rows))

    def test_a_long_command_stays_one_for_the_shell(self):
        command = "./run campaign overload " + " ".join(f"--option{n} value{n}" for n in range(12))
        lines = evidence.broken(command)
        self.assertGreater(len(lines), 2)
        self.assertTrue(all(len(line) <= 100 and line.endswith(" \\") for line in lines[:-1]))
        self.assertEqual(subprocess.run(["sh", "-c", "echo " + "\n".join(lines)], capture_output=True, text=True, check=True).stdout.strip(), command)
        self.assertTrue(all(re.search(r"value\d+$", line.removesuffix(" \\")) for line in lines))

    def test_code_is_not_broken(self):
        lines = evidence.wrap("word " * 18 + "`a code span of words` " + "word " * 5)
        self.assertEqual(len(lines), 2)
        self.assertTrue(lines[1].startswith("`a code span of words`"))


if __name__ == "__main__":
    unittest.main()
