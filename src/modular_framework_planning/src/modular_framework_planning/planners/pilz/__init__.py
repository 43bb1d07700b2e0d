# SPDX-License-Identifier: BSD-3-Clause
"""Pilz industrial motions: point-to-point (PTP), linear (LIN), circular (CIRC), and blended sequences."""
