# SPDX-License-Identifier: BSD-3-Clause
"""Pilz's industrial motions: point to point (PTP), straight lines (LIN), arcs (CIRC), and sequences of them."""
