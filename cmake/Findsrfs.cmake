# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
# find_package(srfs) in a folder of this tree: everything is here already. So such a folder builds in the tree and outside it.
set(srfs_FOUND TRUE)
