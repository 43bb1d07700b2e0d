# SPDX-License-Identifier: BSD-3-Clause
"""Generates the data of a description package: models with exact inertia, and scenes that match worlds."""
