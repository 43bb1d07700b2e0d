# SPDX-License-Identifier: BSD-3-Clause
"""The planning pipeline `ompl`: OMPL's geometric planners."""
