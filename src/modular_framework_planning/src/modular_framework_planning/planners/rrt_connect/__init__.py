# SPDX-License-Identifier: BSD-3-Clause
"""RRT-Connect, with edge checks inside one compiled loop."""
