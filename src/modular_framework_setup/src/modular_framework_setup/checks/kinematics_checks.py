# SPDX-License-Identifier: BSD-3-Clause
"""Checks the groups, solvers and settings of kinematics.yaml."""

from __future__ import annotations

import re

from modular_framework_core.files.faults import FaultList, closest
from modular_framework_core.files.located_yaml import Mapping, kind_of
from modular_framework_planning.kinematics.kinematics_settings import NUMERIC
from modular_framework_setup.config_files.robot_tree import Semantics
from modular_framework_setup.config_files.yaml_files import is_open, parameters_of, plain_text, read_number, read_truth

SOLVERS = (
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
    NUMERIC,
)
NUMBERS = ("kinematics_solver_search_resolution", "kinematics_solver_timeout", "kinematics_solver_attempts")
KEYS = ("kinematics_solver", *NUMBERS, "kinematics_solver_ik_links")
_PLUGIN = re.compile(r"\w+/\w+")


def check_kinematics(top: Mapping, semantics: Semantics, faults: FaultList) -> None:
    """Checks the content of kinematics.yaml.

    Args:
        top: Content of the file.
        semantics: Groups of the SRDF.
        faults: Receives the faults.
    """
    top = parameters_of(top)
    nested = top.entries.get("robot_description_kinematics")
    for group, node in (nested if isinstance(nested, Mapping) else top).entries.items():
        where = (nested if isinstance(nested, Mapping) else top).keys[group]
        if is_open(group):
            continue
        if group not in semantics.groups:
            faults.add_unknown(where, "group", group, semantics.groups)
        if not isinstance(node, Mapping):
            faults.add(where, f"group '{group}' is {kind_of(node)}; expected a mapping with kinematics_solver")
            continue
        _check_group(group, node, faults)


def _check_group(group: str, entry: Mapping, faults: FaultList) -> None:
    for key, node in entry.entries.items():
        where = entry.keys[key]
        if key.startswith("kinematics") and key not in KEYS:
            faults.add_unknown(where, f"group '{group}': key", key, KEYS)
        elif key in NUMBERS:
            value = read_number(node, f"group '{group}': {key}", faults)
            if value is not None and value <= 0.0:
                faults.add(where, f"group '{group}': {key} is {value:g}; it must be above 0")
        elif key == "position_only_ik":
            read_truth(node, f"group '{group}': {key}", faults)
    if "kinematics_solver" in entry.entries:
        _check_solver(group, entry, faults)


def _check_solver(group: str, entry: Mapping, faults: FaultList) -> None:
    """Checks the solver plugin. An unknown plugin is allowed unless it resembles a known plugin."""
    solver, where = plain_text(entry.entries["kinematics_solver"]), entry.keys["kinematics_solver"]
    if solver in SOLVERS or is_open(solver):
        return
    package = solver.partition("/")[0]
    is_of_known_package = any(package == known.partition("/")[0] for known in SOLVERS)
    is_plugin = _PLUGIN.fullmatch(solver) is not None
    is_ikfast = solver.endswith("IKFastKinematicsPlugin")
    if not is_plugin or is_of_known_package or (not is_ikfast and closest(solver, SOLVERS) in _same_class(solver)):
        faults.add_unknown(where, f"group '{group}': kinematics_solver", solver, SOLVERS)


def _same_class(solver: str) -> list[str]:
    """Returns the known solvers of the same class name, in which case the package is misspelt."""
    name = solver.partition("/")[2]
    return [known for known in SOLVERS if known.partition("/")[2] == name]
