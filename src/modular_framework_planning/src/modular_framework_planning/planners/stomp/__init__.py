# SPDX-License-Identifier: BSD-3-Clause
"""Stochastic trajectory optimisation, the planning pipeline `stomp`."""
