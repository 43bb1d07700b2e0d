# SPDX-License-Identifier: BSD-3-Clause
"""Checks of a config package, one module per subject."""
