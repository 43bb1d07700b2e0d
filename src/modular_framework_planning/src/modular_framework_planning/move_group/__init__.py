# SPDX-License-Identifier: BSD-3-Clause
"""The move_group node."""
