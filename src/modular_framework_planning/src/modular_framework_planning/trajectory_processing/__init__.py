# SPDX-License-Identifier: BSD-3-Clause
"""Paths made shorter and timed within the limits of the joints."""
