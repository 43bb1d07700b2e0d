# SPDX-License-Identifier: BSD-3-Clause
"""RRT-Connect with its edges checked inside one compiled loop."""
