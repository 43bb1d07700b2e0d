# SPDX-License-Identifier: BSD-3-Clause
"""Straight lines of a link."""
