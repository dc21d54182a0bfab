# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The page of ground/web in a real browser: tests, measurement, pictures of the documents."""
