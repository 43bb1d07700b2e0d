# SPDX-License-Identifier: BSD-3-Clause
"""Reads user-written files with the line of every value, and writes files atomically."""
