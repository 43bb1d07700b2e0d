# SPDX-License-Identifier: BSD-3-Clause
"""Interactive goals in RViz."""
