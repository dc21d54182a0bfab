# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""GitHub's dialect of Markdown, in which the documents are written, for Python-Markdown, which mkdocs uses."""

import re

FENCE = re.compile(r" *(```+|~~~+)")
TABLE = re.compile(r"\|?(?:\s*:?-+:?\s*\|)+[\s:-]*")
ITEM = re.compile(r"([-*+]|\d{1,9}\.) +(?=\S)")


def outside_code(markdown, change):
    """The text with change(line) applied to every line that is not in a fenced block; None leaves the line."""
    lines, fence = [], None
    for line in markdown.split("\n"):
        mark = FENCE.match(line)
        if fence is None and not mark:
            changed = change(line)
            line = line if changed is None else changed
        elif fence is None:
            fence = mark.group(1)
        elif mark and line.strip() == fence:
            fence = None
        lines.append(line)
    return "\n".join(lines)


def for_python_markdown(markdown):
    """GitHub's dialect as Python-Markdown reads it: lists and tables begin after an empty line, the content of a list item stands at 4 columns a
    level, a backslash at the end of a line breaks it."""
    out, fence, shift, before = [], None, 0, ""
    columns, in_list, loose, code = [], False, False, False  # columns: where the content of each open list item begins
    source = markdown.split("\n")
    for number, line in enumerate(source):
        text = line.lstrip(" ")
        indent = len(line) - len(text)
        if fence is not None:
            out.append(" " * (4 * len(columns) + max(0, indent - shift)) + text if text else "")
            fence = None if text.rstrip() == fence else fence
        elif not text:
            out.append("")
            loose = True
        else:
            item, mark = ITEM.match(text), FENCE.match(text)
            if item and before and not (columns and indent < columns[-1]) and item.group(1)[0].isdigit() and item.group(1) != "1.":
                item, text = None, text.replace(".", "\\.", 1)  # a number at the beginning of a line of a paragraph
            if item or not before or mark:  # else: it goes on with the paragraph, wherever it begins
                while columns and indent < columns[-1]:
                    columns.pop()
            extra = indent - (columns[-1] if columns else 0)
            code = extra >= 4 and (code or not before)
            level = len(columns)
            if code:
                pass
            elif item:
                if before and (loose or not in_list):
                    out.append("")
                columns.append(indent + item.end())
                text = f"{item.group(1)} {text[item.end():]}"
                extra, loose = 0, False
            elif mark:
                fence, shift, extra = mark.group(1), indent, 0
            elif before and "|" not in before and TABLE.fullmatch((source + [""])[number + 1].strip()):
                out.append("")
            in_list = bool(columns)
            text = text[:-1] + "  " if text.endswith("\\") and not mark and not code else text
            out.append(" " * (4 * level + (extra if code else 0)) + text)
        before = line if fence is None and text else ""
    return "\n".join(out)
