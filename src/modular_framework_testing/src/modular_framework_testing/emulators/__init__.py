# SPDX-License-Identifier: BSD-3-Clause
"""Emulated devices, which use the wire protocols of the real devices and simulate faults on command."""
