# SPDX-License-Identifier: BSD-3-Clause
"""Devices in software: they speak the wire protocols of the real ones and take faults on command."""
