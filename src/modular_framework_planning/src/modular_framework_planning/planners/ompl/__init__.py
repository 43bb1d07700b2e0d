# SPDX-License-Identifier: BSD-3-Clause
"""OMPL's geometric planners, the planning pipeline `ompl`."""
