# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""How tutorials are read and run (python/srfs/tutorial.py), with pages made for it. tests/system/test_tutorials.py runs the real ones."""

import tempfile
import unittest
from pathlib import Path

from srfs import tutorial
from srfs.tutorial import Commands, Edit, TutorialError

PAGE = """# Title

Words.

```sh
echo one
```

```text
one
```

```sh
tail -f log
```

Ctrl-C ends it. More words.

A wrong one never leaves (exit code 2):

```sh
false
```

Create `a/b.txt`:

```cpp
first
last
```

Words. In `a/b.txt`, replace `fir` with `fi`. In `a/b.txt`, replace `fist` with
`begin`. Then go on.

In `a/b.txt`, after `begin`, add:

```
middle
```

In `a/b.txt`, replace `last` with:

```
end
```

## On the bench

> Needs hardware: a board.

```sh
false
```

### More of it

```sh
false
```

## Again

```sh
./run sim
```

Leave it running.
"""


class Steps(unittest.TestCase):
    def test_blocks_and_edits_come_in_order_with_their_lines(self):
        steps = tutorial.steps_of("page.md", PAGE)
        lines = PAGE.splitlines()
        self.assertEqual([type(step).__name__ for step in steps], ["Commands"] * 3 + ["Edit"] * 5 + ["Commands"])
        self.assertEqual([lines[step.line - 1] for step in steps if isinstance(step, Commands)], ["echo one", "tail -f log", "false", "./run sim"])
        self.assertEqual(steps[0].expected, [(10, "one")])
        self.assertEqual([step.until_interrupted for step in steps[:3]], [False, True, False])
        self.assertEqual([step.exit_code for step in steps[:3]], [0, 0, 2])
        self.assertTrue(steps[-1].stays)

    def test_what_needs_hardware_is_left_out_with_its_subsections(self):
        commands = [step.text for step in tutorial.steps_of("page.md", PAGE) if isinstance(step, Commands)]
        self.assertEqual(sum("false" in text for text in commands), 1)
        commands = [step.text for step in tutorial.steps_of("page.md", PAGE, hardware=True) if isinstance(step, Commands)]
        self.assertEqual(sum("false" in text for text in commands), 3)

    def test_edits_are_applied_literally(self):
        with tempfile.TemporaryDirectory() as folder:
            for step in tutorial.steps_of("page.md", PAGE):
                if isinstance(step, Edit):
                    tutorial.apply_edit("page.md", step, folder)
            self.assertEqual((Path(folder) / "a/b.txt").read_text(), "begin\nmiddle\nend\n")

    def test_an_edit_that_does_not_fit_is_reported_with_its_line(self):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "x"
            file.write_text("a\na\n")
            for edit, says in ((Edit(7, "x", "a", "b\n"), "2 times"), (Edit(7, "x", "c", "b\n"), "0 times"),
                               (Edit(7, "y", "a", "b\n"), "there is no y"), (Edit(7, "x", None, "b\n"), "there already")):  # fmt: skip
                with self.assertRaisesRegex(TutorialError, f"page.md:7: .*{says}"):
                    tutorial.apply_edit("page.md", edit, folder)
            self.assertEqual(file.read_text(), "a\na\n")

    def test_what_looks_like_an_edit_and_is_none_is_an_error(self):
        with self.assertRaisesRegex(TutorialError, "page.md:4: .*no edit"):
            tutorial.steps_of("page.md", "Somewhere in `x`, add:\n\n```\nb\n```\n")
        with self.assertRaisesRegex(TutorialError, "no end"):
            tutorial.steps_of("page.md", "```sh\necho\n")
        with self.assertRaisesRegex(TutorialError, "without commands"):
            tutorial.steps_of("page.md", "```text\nx\n```\n")


    def test_words_after_a_block_say_how_it_runs(self):
        (step,) = tutorial.steps_of("page.md", "```sh\nls\n```\n\nRepeat it until it shows:\n\n```text\nx\n```\n")
        self.assertTrue(step.repeats)
        self.assertEqual(step.expected, [(8, "x")])


class Output(unittest.TestCase):
    def test_lines_are_expected_in_order_and_dots_stand_for_anything(self):
        output = "9 nodes up in 340 ms\nfirst  line\nsecond line\n"
        self.assertIsNone(tutorial.missing_output([(1, "9 nodes up in ... ms"), (2, "first line"), (3, "...line")], output))
        self.assertEqual(tutorial.missing_output([(1, "second line"), (2, "first line")], output), (2, "first line"))
        self.assertEqual(tutorial.missing_output([(5, "8 nodes")], output), (5, "8 nodes"))


class Running(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.shell = tutorial.Shell(folder.name)
        self.addCleanup(self.shell.end)

    def do(self, text, **more):
        self.shell.do("page.md", Commands(10, text, **more), 60)

    def test_variables_stay_for_the_next_block(self):
        self.do("name=world\n")
        self.do('echo "hello $name"\n', expected=[(11, "hello world")])

    def test_a_command_that_fails_is_reported_with_its_line(self):
        with self.assertRaisesRegex(TutorialError, "page.md:12: exit code 3"):
            self.do("true\ntrue\n(exit 3)\ntrue\n")
        self.do("true\n")

    def test_an_exit_code_can_be_expected(self):
        self.do("(exit 2)\n", exit_code=2)
        with self.assertRaisesRegex(TutorialError, "exit code 0, expected 2"):
            self.do("true\n", exit_code=2)

    def test_other_output_is_reported_with_the_line_of_what_is_missing(self):
        with self.assertRaisesRegex(TutorialError, "page.md:14: the output has no 'two'"):
            self.do("echo one\n", expected=[(13, "one"), (14, "two")])

    def test_a_block_is_repeated_until_its_output_comes(self):
        self.do("echo -n x >> count; cat count\n", expected=[(11, "xxx")], repeats=True)

    def test_ctrl_c_ends_what_runs_and_not_the_shell(self):
        self.do("echo ready; sleep 1000\n", expected=[(11, "ready")], until_interrupted=True)
        self.do("echo still here\n", expected=[(12, "still here")])

    def test_ctrl_c_leaves_what_runs_in_the_background(self):
        self.do("sleep 1000 &\n")
        self.do("echo ready; sleep 1000\n", expected=[(11, "ready")], until_interrupted=True)
        self.do("kill $!\n")


if __name__ == "__main__":
    unittest.main()
