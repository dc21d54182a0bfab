// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The source that a target which only holds precompiled headers must have (srfs_precompile in SrfsTargets.cmake).
int main() {
  return 0;
}
