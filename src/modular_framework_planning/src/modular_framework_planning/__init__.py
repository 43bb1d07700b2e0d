# SPDX-License-Identifier: BSD-3-Clause
"""The move_group node: planning scene, kinematics, planning and execution, under the names of MoveIt."""

from modular_framework_planning import numba_cache  # noqa: F401 - before any module imports numba
