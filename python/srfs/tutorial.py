# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""A tutorial (Markdown) as steps that a program can do, and a shell that does them. CONTRIBUTING.md, "Tutorials", has the convention."""

import contextlib
import dataclasses
import os
import re
import signal
import subprocess
import tempfile
import threading
import time
from pathlib import Path

FENCE = re.compile(r"^```(\w*)\s*$")
HEADING = re.compile(r"^(#+) ")
HARDWARE = "> Needs hardware"
CREATE = re.compile(r"\b(?:Create|Save this as) `([^`]+)`:$")
ADD = re.compile(r"\bIn `([^`]+)`, after `([^`]+)`, add:$")
REPLACE = re.compile(r"\bIn `([^`]+)`, replace `([^`]+)` with:$")
REPLACE_WORDS = re.compile(r"\bIn `([^`]+)`, replace `([^`]+)` with `([^`]+)`\.")
EXIT_CODE = re.compile(r"\(exit code (\d+)\)")
NEEDS_SIMULATION = re.compile(r"You\s+need a running `\./run sim`")


class TutorialError(Exception):
    """The text begins with the page and the line that could not be done."""


@dataclasses.dataclass
class Commands:
    """A fenced block `sh`."""

    line: int  # of its first command
    text: str
    expected: list = dataclasses.field(default_factory=list)  # [(line, text)] of the block `text` behind it
    exit_code: int = 0
    until_interrupted: bool = False  # "Ctrl-C ends it"
    repeats: bool = False  # "Repeat it until": it is run again until the expected output comes
    stays: bool = False  # "Leave it running"


@dataclasses.dataclass
class Edit:
    """A change of a file. anchor None: the file is created."""

    line: int
    path: str
    anchor: str | None
    text: str
    replaces: bool = False


@dataclasses.dataclass
class _Block:
    line: int
    language: str
    text: str
    before: str  # the paragraph before it; empty: a block, or nothing
    after: str = ""


def _paragraphs(lines):
    """[(line number, text)] of what is between empty lines, without blocks in fences: for words that belong to no block."""
    found, fenced = [], False
    for number, line in enumerate(lines, 1):
        if FENCE.match(line):
            fenced = not fenced
            found.append((number, ""))
        elif fenced or not line.strip():
            found.append((number, ""))
        elif found and found[-1][1]:
            found[-1] = (found[-1][0], f"{found[-1][1]} {line.strip()}")
        else:
            found.append((number, line.strip()))
    return [(number, text) for number, text in found if text]


def _skipped(lines):
    """Numbers of the lines in sections that need hardware: from the mark to the next heading of the same level, or a higher one."""
    skipped, level, until = set(), 1, None
    for number, line in enumerate(lines, 1):
        if heading := HEADING.match(line):
            level = len(heading[1])
            until = None if until and level <= until else until
        if line.startswith(HARDWARE):
            until = level
        if until:
            skipped.add(number)
    return skipped


def steps_of(page, text, hardware=False):
    """The steps of a page in order. @param page  for messages. @param hardware  with the sections that need it"""
    lines = text.splitlines()
    skipped = set() if hardware else _skipped(lines)
    steps = []
    for block in _surrounded(page, lines):
        if block.line in skipped:
            continue
        if block.language == "sh":
            steps.append(Commands(block.line, block.text, exit_code=int(code[1]) if (code := EXIT_CODE.search(block.before)) else 0,
                                  until_interrupted="Ctrl-C ends it" in block.after, repeats="Repeat it until" in block.after, stays="Leave it running" in block.after))  # fmt: skip
        elif block.language == "text":
            if not steps or not isinstance(steps[-1], Commands):
                raise TutorialError(f"{page}:{block.line}: output without commands before it")
            steps[-1].expected = [(block.line + i, line) for i, line in enumerate(block.text.splitlines()) if line.strip()]
            steps[-1].until_interrupted |= "Ctrl-C ends it" in block.after
            steps[-1].stays |= "Leave it running" in block.after
        elif edit := _edit(block):
            steps.append(edit)
        elif block.before.endswith(":") and re.search(r"\b(add|replace|create)\b", block.before, re.I):
            raise TutorialError(f"{page}:{block.line}: '{block.before}' is no edit of the convention")
    for number, paragraph in _paragraphs(lines):
        if number not in skipped:
            steps += [Edit(number, *words.groups(), replaces=True) for words in REPLACE_WORDS.finditer(paragraph)]
    return sorted(steps, key=lambda step: step.line)


def _surrounded(page, lines):
    """The fenced blocks in order with the paragraph before and the one after each."""
    chunks, chunk, opened = [], [], None  # (kind, first line, lines)
    for number, line in enumerate(lines, 1):
        fence = FENCE.match(line)
        if opened is None and fence:
            chunks.append(("text", chunk))
            opened, chunk = (number + 1, fence[1]), []
        elif opened is not None and line.rstrip() == "```":
            chunks.append(("block", _Block(*opened, "".join(f"{each}\n" for each in chunk), "")))
            opened, chunk = None, []
        else:
            chunk.append(line)
    if opened is not None:
        raise TutorialError(f"{page}:{opened[0] - 1}: the block has no end")
    chunks.append(("text", chunk))
    found = []
    for before, (kind, block), after in zip(chunks, chunks[1:], chunks[2:]):
        if kind == "block":
            paragraphs = [" ".join(p.split()) for p in "\n".join(before[1]).split("\n\n") if p.strip()]
            block.before = paragraphs[-1] if paragraphs else ""
            paragraphs = [" ".join(p.split()) for p in "\n".join(after[1]).split("\n\n") if p.strip()]
            block.after = paragraphs[0] if paragraphs else ""
            found.append(block)
    return found


def _edit(block):
    if found := CREATE.search(block.before):
        return Edit(block.line, found[1], None, block.text)
    if found := ADD.search(block.before):
        return Edit(block.line, found[1], found[2], block.text)
    if found := REPLACE.search(block.before):
        return Edit(block.line, found[1], found[2], block.text, replaces=True)
    return None


def apply_edit(page, edit, folder, home=None):
    """Changes the file as the page says. The anchor must be there exactly once. @param home  what "~" stands for"""
    where = f"{page}:{edit.line}"
    file = Path(home) / edit.path[2:] if edit.path.startswith("~/") else Path(folder) / edit.path
    if edit.anchor is None:
        if file.exists():
            raise TutorialError(f"{where}: {edit.path} is there already")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(edit.text)
        return
    if not file.exists():
        raise TutorialError(f"{where}: there is no {edit.path}")
    text = file.read_text()
    if text.count(edit.anchor) != 1:
        raise TutorialError(f"{where}: {edit.path} has {text.count(edit.anchor)} times '{edit.anchor}', not once")
    if edit.replaces and "\n" not in edit.text:  # words
        file.write_text(text.replace(edit.anchor, edit.text))
        return
    begin = text.rfind("\n", 0, text.index(edit.anchor)) + 1
    end = text.find("\n", begin) + 1 or len(text)
    file.write_text(text[: begin if edit.replaces else end] + edit.text + text[end:])


def missing_output(expected, output):
    """The first expected line [(line, text)] that the output does not have, in order; None: it has all. "..." stands for anything."""
    position = 0
    for line, text in expected:
        pattern = r"\s+".join(".*".join(map(re.escape, word.split("..."))) for word in text.split())
        found = re.compile(pattern).search(output, position)
        if not found:
            return line, text
        position = found.end()
    return None


class Shell:
    """One bash in a folder: what a block sets is there for the next one."""

    def __init__(self, folder, environment=None):
        self.folder = Path(folder)
        self._lock = threading.Lock()
        self._output = ""
        self._scripts = tempfile.TemporaryDirectory(prefix="srfs_tutorial_")
        self._blocks = 0
        self._bash = subprocess.Popen(["bash", "--norc", "--noprofile"], cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                      stderr=subprocess.STDOUT, text=True, errors="replace", start_new_session=True, env=environment)  # fmt: skip
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self._behind = set()  # pids that run in the background
        self._write("set -m; trap : INT\n")  # what runs in the foreground has a process group of its own, for Ctrl-C

    def _read(self):
        while piece := os.read(self._bash.stdout.fileno(), 65536):
            with self._lock:
                self._output += piece.decode(errors="replace")

    def _write(self, text):
        self._bash.stdin.write(text)
        self._bash.stdin.flush()

    def output(self):
        with self._lock:
            return self._output

    def _children(self):
        return set(map(int, Path(f"/proc/{self._bash.pid}/task/{self._bash.pid}/children").read_text().split()))

    def interrupt(self):
        """Ctrl-C: ends what runs in the foreground."""
        for pid in self._children() - self._behind:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(pid, signal.SIGINT)

    def end(self):
        """Ends the shell and all that runs in it. Returns whether it ended by itself."""
        left = self._children() if self._bash.poll() is None else set()  # in the background, each in a process group of its own, after a page that was cut off
        self._bash.stdin.close()
        try:
            self._bash.wait(10)
            return True
        except subprocess.TimeoutExpired:
            os.killpg(self._bash.pid, signal.SIGKILL)
            self._bash.wait()
            return False
        finally:
            for pid in left:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(pid, signal.SIGTERM)
            self._reader.join(5)
            self._bash.stdout.close()
            self._scripts.cleanup()

    def do(self, page, step, patience_s):
        """Runs a block, again and again if the page says so; TutorialError as for do_once()."""
        end = time.monotonic() + patience_s
        while True:
            try:
                return self.do_once(page, step, max(1, end - time.monotonic()))
            except TutorialError:
                if not step.repeats or time.monotonic() > end:
                    raise
            time.sleep(0.2)

    def do_once(self, page, step, patience_s):
        """Runs a block; TutorialError when a command of it fails, or its output is another one."""
        self._blocks += 1
        script = Path(self._scripts.name) / f"{self._blocks}.sh"
        script.write_text(step.text)
        mark = f"srfs_end_of_block_{self._blocks}"
        with self._lock:
            self._output = ""
        self._write(f"srfs_code=0; trap 'srfs_now=$?; [ $srfs_code != 0 ] || srfs_code=$srfs_now srfs_line=$LINENO' ERR\n. {script} < /dev/null\n"
                    f'trap - ERR; echo; echo "{mark} $srfs_code ${{srfs_line:-0}}"; unset srfs_line\n')  # fmt: skip
        ended = re.compile(rf"^{mark} (\d+) (\d+)$", re.M)
        end = time.monotonic() + patience_s
        settled = None  # when the expected output was seen
        while not (result := ended.search(self.output())):
            if self._bash.poll() is not None:
                raise TutorialError(f"{page}:{step.line}: the shell ended:\n{self.output()[-2000:]}")
            if step.until_interrupted and missing_output(step.expected, self.output()) is None:
                settled = settled or time.monotonic() + (0 if step.expected else 2)
                if time.monotonic() >= settled:
                    self.interrupt()
                    settled = time.monotonic() + 5
            if time.monotonic() > end:
                self.interrupt()
                raise TutorialError(f"{page}:{step.line}: not done within {patience_s} s:\n{self.output()[-2000:]}")
            time.sleep(0.02)
        self._behind = self._children()
        output = self.output()[: result.start()]
        code, line = int(result[1]), step.line + max(int(result[2]), 1) - 1
        allowed = {step.exit_code} | ({0, 130} if step.until_interrupted else set())
        if code not in allowed:
            raise TutorialError(f"{page}:{line}: exit code {code}, expected {step.exit_code}:\n{output[-2000:]}")
        if missing := missing_output(step.expected, output):
            raise TutorialError(f"{page}:{missing[0]}: the output has no '{missing[1]}':\n{output[-2000:]}")
