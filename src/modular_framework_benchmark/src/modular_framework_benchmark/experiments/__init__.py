# SPDX-License-Identifier: BSD-3-Clause
"""Reads experiment files, checks them and lays out their episodes."""
