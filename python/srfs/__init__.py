# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The project's Python: flies the simulated spacecraft, measures, reproduces the paper, draws. python/README.md says what is where."""

import pathlib

ROOT = pathlib.Path(__file__).resolve().parents[2]
