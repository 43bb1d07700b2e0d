# SPDX-License-Identifier: BSD-3-Clause
"""Reads the files of a config package with line numbers."""
