# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Figures of many values. Pure."""

SHARES = {"p50": 0.5, "p90": 0.9, "p99": 0.99, "p99_9": 0.999, "max": 1.0}


def percentile(values, q):
    """The q-quantile (0 to 1) of values, None without values."""
    if not values:
        return None
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(q * len(ordered)))]


def quantiles(values, names="p50 p99 max", unit=1, digits=None, suffix=""):
    """{name + suffix: that quantile, in units, rounded}; None each without values."""
    found = {name: percentile(values, SHARES[name]) for name in names.split()}
    return {name + suffix: value if value is None or digits is None else round(value / unit, digits) for name, value in found.items()}
