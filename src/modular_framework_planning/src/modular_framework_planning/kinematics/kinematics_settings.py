# SPDX-License-Identifier: BSD-3-Clause
"""How each group's inverse kinematics is solved: the contents of kinematics.yaml."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from modular_framework_planning.errors import ErrorCode, PlanningError

NUMERIC, CLOSED_FORM, CLOSED_FORM_AND_SEARCH = "numeric", "closed form", "closed form and search"
"""The methods of inverse kinematics. With the last, the value of one joint of a redundant chain is searched for."""
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
"""Public plugins of MoveIt, whose configuration files run here unchanged: the framework's own methods solve."""
KEYS = (
    "kinematics_solver",
    "kinematics_solver_search_resolution",
    "kinematics_solver_timeout",
    "kinematics_solver_attempts",
    "kinematics_solver_ik_links",
)
_PLUGIN = re.compile(r"\w+/\w+")


def is_known_solver(name: str) -> bool:
    """Returns whether a name may stand in kinematics.yaml.

    A plugin that is not in `PLUGINS` may be somebody's own, unless its package or its class is one of theirs.
    """
    if name in ("", NUMERIC, *PLUGINS) or name.endswith("IKFastKinematicsPlugin"):
        return True
    if _PLUGIN.fullmatch(name) is None:
        return False
    package, own_class = name.split("/")
    known = {plugin.split("/")[0] for plugin in PLUGINS}, {plugin.split("/")[1] for plugin in PLUGINS}
    return package not in known[0] and own_class not in known[1]


def unknown_solver_text(name: str) -> str:
    """Returns the message about a name for which `is_known_solver` is false."""
    return (
        f"there is no kinematics_solver '{name}'; allowed: {', '.join((NUMERIC, *PLUGINS))}, or PACKAGE/CLASS of "
        "another plugin"
    )


@dataclass(frozen=True, slots=True)
class KinematicsSettings:
    """Kinematics settings of one group; the keys of kinematics.yaml without their prefix.

    Attributes:
        solver: A name of `is_known_solver`; "numeric" leaves closed forms out.
        search_resolution: step of the held joint of a seven-joint chain [rad].
        timeout_s: time one attempt of the numeric search may take, where a request gives none.
        attempts: how many such times.
        position_only: whether compute_ik and pose goals bring the link's origin to the position and leave the
            orientation open.
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
                f"kinematics_solver_attempts is {self.attempts}; allowed are numbers above 0, and "
                "whole attempts",
            )

    @property
    def total_timeout_s(self) -> float:
        """Time of all attempts."""
        return self.timeout_s * self.attempts


def settings_from(parameters: Mapping[str, object]) -> dict[str, KinematicsSettings]:
    """Reads the contents of kinematics.yaml: a mapping from group to its keys.

    Raises:
        PlanningError: a group's entry is not a mapping, or a value is not a number above 0.
    """
    result = {}
    for group, entry in parameters.items():
        if not isinstance(entry, Mapping):
            raise PlanningError(
                ErrorCode.FAILURE,
                f"kinematics.yaml: '{group}' is {entry!r}; a mapping with kinematics_solver and its keys is needed",
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
                f"kinematics.yaml: '{group}': {error}; numbers above 0 are "
                "needed, and for position_only_ik true or false",
            ) from error
    return result


def _bool(value: object) -> bool:
    if not isinstance(value, bool):
        raise ValueError(f"position_only_ik is {value!r}")
    return value
