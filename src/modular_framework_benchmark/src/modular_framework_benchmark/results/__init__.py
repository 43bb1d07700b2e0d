# SPDX-License-Identifier: BSD-3-Clause
"""Keeps results in a database, and exports them."""
