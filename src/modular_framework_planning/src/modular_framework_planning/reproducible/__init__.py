# SPDX-License-Identifier: BSD-3-Clause
"""Bitwise reproducible planning with seeds."""
