# SPDX-License-Identifier: BSD-3-Clause
"""Drivers of real devices."""
