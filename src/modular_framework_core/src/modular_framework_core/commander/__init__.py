# SPDX-License-Identifier: BSD-3-Clause
"""Plans and executes arm motions through move_group."""
