# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""What was judged: one line each, true or not, and the goals that were met or missed."""

MOST_SHOWN = 5  # violations of a check


def check(good, what):
    return {"ok": bool(good), "what": what}


def check_none(violations, what, count=None):
    """violations: texts, of `count` that were looked at."""
    return {"what": what, "ok": not violations, "violations": len(violations), "shown": violations[:MOST_SHOWN],
            **({} if count is None else {"of": count})}  # fmt: skip


def all_ok(checks):
    return all(result["ok"] for result in checks)


def show(checks):
    for result in checks:
        count = f" ({result['of']})" if "of" in result else ""
        print(f"  {'ok    ' if result['ok'] else 'NOT OK'}  {result['what']}{count}")
        for line in result.get("shown", ()):
            print(f"            {line}")


def verdict(met):
    return "met" if met else "missed"
