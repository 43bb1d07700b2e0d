# SPDX-License-Identifier: BSD-3-Clause
"""Reads and checks experiment files, and plans their episodes."""
