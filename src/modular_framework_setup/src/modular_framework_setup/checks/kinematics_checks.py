# SPDX-License-Identifier: BSD-3-Clause
"""Checks the groups, solvers and settings of kinematics.yaml."""

from __future__ import annotations

from modular_framework_core.files.faults import FaultList
from modular_framework_core.files.located_yaml import Mapping, kind_of
from modular_framework_planning.kinematics.kinematics_settings import KEYS, NUMERIC, PLUGINS, is_known_solver
from modular_framework_setup.config_files.robot_tree import Semantics
from modular_framework_setup.config_files.yaml_files import (
    has_argument,
    parameters_of,
    plain_text,
    read_number,
    read_truth,
)

NUMBERS = ("kinematics_solver_search_resolution", "kinematics_solver_timeout", "kinematics_solver_attempts")


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
        if has_argument(group):
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
    solver, where = plain_text(entry.entries["kinematics_solver"]), entry.keys["kinematics_solver"]
    if not (is_known_solver(solver) or has_argument(solver)):
        faults.add_unknown(where, f"group '{group}': kinematics_solver", solver, (NUMERIC, *PLUGINS))
