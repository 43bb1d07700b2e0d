# SPDX-License-Identifier: BSD-3-Clause
"""Runs and records episodes on the real stack."""
