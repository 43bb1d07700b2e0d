# SPDX-License-Identifier: BSD-3-Clause
"""Stores results in a database, and exports them."""
