# SPDX-License-Identifier: BSD-3-Clause
"""Loads, starts, stops and updates controllers."""
