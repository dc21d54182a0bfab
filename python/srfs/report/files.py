# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Files of results: CSV, JSON lines, drawings."""

import csv
import json


def write_csv(path, head, rows):
    with open(path, "w", newline="") as file:
        lines = csv.writer(file)
        lines.writerow(head)
        lines.writerows(rows)


def write_messages(path, messages):
    """Messages of a Lines, one a line, without the time of their arrival here."""
    with open(path, "w") as file:
        for message in messages:
            file.write(json.dumps({key: value for key, value in message.items() if key != "arrived"}) + "\n")


def pyplot():
    """matplotlib's, that draws into files; ImportError where it is missing."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    return pyplot


def save(figure, folder, name, dpi, rect=(0, 0, 1, 1)):
    """NAME.svg and NAME.png."""
    figure.tight_layout(rect=rect)
    for kind in ("svg", "png"):
        figure.savefig(folder / f"{name}.{kind}", dpi=dpi)
    pyplot().close(figure)
