# SPDX-License-Identifier: BSD-3-Clause
"""Inverse kinematics settings of the groups, as in kinematics.yaml."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_ros.allowed_names import nearest

NUMERIC, CLOSED_FORM, CLOSED_FORM_AND_SEARCH = "numeric", "closed form", "closed form and search"
"""Inverse kinematics methods. The last one searches over the value of a joint of a redundant chain."""
PLUGINS = (
    "kdl_kinematics_plugin/KDLKinematicsPlugin",
    "lma_kinematics_plugin/LMAKinematicsPlugin",
    "srv_kinematics_plugin/SrvKinematicsPlugin",
    "cached_ik_kinematics_plugin/CachedKDLKinematicsPlugin",
    "cached_ik_kinematics_plugin/CachedSrvKinematicsPlugin",
    "trac_ik_kinematics_plugin/TRAC_IKKinematicsPlugin",
    "bio_ik/BioIKKinematicsPlugin",
    "pick_ik/PickIkPlugin",
    "moveit_opw_kinematics_plugin/MoveItOPWKinematicsPlugin",
    "pr2_arm_kinematics/PR2ArmKinematicsPlugin",
    *(f"ur_kinematics/UR{name}KinematicsPlugin" for name in ("3", "5", "10")),
)
"""Public MoveIt plugins, accepted so that their configuration files run unchanged; none of them is loaded."""
KEYS = (
    "kinematics_solver",
    "kinematics_solver_search_resolution",
    "kinematics_solver_timeout",
    "kinematics_solver_attempts",
    "kinematics_solver_ik_links",
    "position_only_ik",
)
_PLUGIN = re.compile(r"\w+/\w+")


def is_known_solver(name: str) -> bool:
    """Checks whether kinematics.yaml may contain a solver name.

    A plugin outside `PLUGINS` can be user-defined, unless its package or its class is part of `PLUGINS`.
    """
    if name in ("", NUMERIC, *PLUGINS) or name.endswith("IKFastKinematicsPlugin"):
        return True
    if _PLUGIN.fullmatch(name) is None:
        return False
    package, own_class = name.split("/")
    known = {plugin.split("/")[0] for plugin in PLUGINS}, {plugin.split("/")[1] for plugin in PLUGINS}
    return package not in known[0] and own_class not in known[1]


def unknown_solver_text(name: str) -> str:
    """Returns the error message for a name that `is_known_solver` rejects."""
    known = (NUMERIC, *PLUGINS)
    return (
        f"there is no kinematics_solver '{name}'; allowed: {', '.join(known)}, or PACKAGE/CLASS of another plugin"
        f"{nearest(name, known)}"
    )


@dataclass(frozen=True, slots=True)
class KinematicsSettings:
    """Kinematics settings of a group, named as in kinematics.yaml without prefix.

    Attributes:
        solver: A solver name accepted by `is_known_solver`; "numeric" disables closed forms.
        search_resolution: Step of the locked joint of a seven-joint chain [rad].
        timeout_s: Default timeout of an attempt of the numeric search [s].
        attempts: Number of attempts.
        position_only: Whether compute_ik and pose goals ignore the orientation.
    """

    solver: str = ""
    search_resolution: float = 0.1
    timeout_s: float = 0.05
    attempts: int = 1
    position_only: bool = False

    def __post_init__(self) -> None:
        if not (self.search_resolution > 0.0 and self.timeout_s > 0.0 and self.attempts >= 1):
            raise PlanningError(
                ErrorCode.FAILURE,
                f"kinematics.yaml: kinematics_solver_search_resolution is "
                f"{self.search_resolution}, kinematics_solver_timeout is {self.timeout_s}, "
                f"kinematics_solver_attempts is {self.attempts}; all must be above 0, and the attempts "
                "a whole number",
            )

    @property
    def total_timeout_s(self) -> float:
        """Total timeout of all attempts [s]."""
        return self.timeout_s * self.attempts


def settings_from(parameters: Mapping[str, object]) -> dict[str, KinematicsSettings]:
    """Returns the settings in the contents of kinematics.yaml, keyed by group.

    Raises:
        PlanningError: The entry of a group is not a mapping, or a value is invalid.
    """
    result = {}
    for group, entry in parameters.items():
        if not isinstance(entry, Mapping):
            raise PlanningError(
                ErrorCode.FAILURE,
                f"kinematics.yaml: '{group}' is {entry!r}; it must be a mapping with kinematics_solver and its keys",
            )
        solver = str(entry.get("kinematics_solver", ""))
        if not is_known_solver(solver):
            raise PlanningError(ErrorCode.FAILURE, f"kinematics.yaml: '{group}': {unknown_solver_text(solver)}")
        default = KinematicsSettings()
        try:
            result[group] = KinematicsSettings(
                str(entry.get("kinematics_solver", default.solver)),
                float(entry.get("kinematics_solver_search_resolution", default.search_resolution)),
                float(entry.get("kinematics_solver_timeout", default.timeout_s)),
                int(entry.get("kinematics_solver_attempts", default.attempts)),
                _bool(entry.get("position_only_ik", default.position_only)),
            )
        except (TypeError, ValueError) as error:
            raise PlanningError(
                ErrorCode.FAILURE,
                f"kinematics.yaml: '{group}': {error}; position_only_ik must be true or false, all other values "
                "numbers above 0",
            ) from error
    return result


def _bool(value: object) -> bool:
    if not isinstance(value, bool):
        raise ValueError(f"position_only_ik is {value!r}")
    return value
