# SPDX-License-Identifier: BSD-3-Clause
"""Checks and runs launch files, reports their results, and starts controllers."""
