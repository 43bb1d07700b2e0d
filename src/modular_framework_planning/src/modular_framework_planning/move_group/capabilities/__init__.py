# SPDX-License-Identifier: BSD-3-Clause
"""Endpoints of the move_group node, one class per file."""
