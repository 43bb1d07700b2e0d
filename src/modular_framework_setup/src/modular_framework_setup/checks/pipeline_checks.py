# SPDX-License-Identifier: BSD-3-Clause
"""Checks the groups, planner configurations and projections in the YAML files of planning pipelines."""

from __future__ import annotations

import re

from modular_framework_core.files.faults import FaultList, SourceLocation
from modular_framework_core.files.located_yaml import Mapping, Node
from modular_framework_setup.config_files.robot_tree import RobotTree, Semantics
from modular_framework_setup.config_files.yaml_files import has_argument, mappings, parameters_of, plain_text, texts

GROUP_KEYS = ("default_planner_config", "planner_configs", "projection_evaluator", "longest_valid_segment_fraction")
PLANNER_TYPES = tuple(
    f"geometric::{name}"
    for name in (
        "ABITstar AITstar AORRTC AnytimePathShortening BFMT BITstar BKPIECE1 BKPIECE BLITstar BiEST BiTRRT "
        "EIRMstar  EITstar EST FMT InformedRRTstar KPIECE KPIECE1 LBKPIECE LBKPIECE1 LBTRRT LazyLBTRRT "
        "LazyPRM LazyPRMstar LazyRRT  PDST PRM PRMstar ProjEST QRRT RLRT BiRLRT RRT RRTConnect RRTXstatic "
        "RRTsharp RRTstar SBL SORRTstar SPARS SPARStwo  SST STRIDE SyCLoP TRRT TSRRT VFRRT pRRT pSBL SPARSdb "
        "TrajOpt"  # written by MoveIt's Setup Assistant
    ).split()
)
_PROJECTION = re.compile(r"(joints|link)\((.*)\)")


def check_planners(top: Mapping, tree: RobotTree, semantics: Semantics, faults: FaultList) -> None:
    """Checks the content of ompl_planning.yaml or of a different pipeline's file.

    Args:
        top: Content of the file.
        tree: Kinematic tree of the robot.
        semantics: Groups of the SRDF.
        faults: Receives the faults.
    """
    _Planners(parameters_of(top), tree, semantics, faults).check()


class _Planners:
    """Checks one file."""

    def __init__(self, top: Mapping, tree: RobotTree, semantics: Semantics, faults: FaultList) -> None:
        self._top, self._tree, self._semantics, self._faults = top, tree, semantics, faults
        configs = top.entries.get("planner_configs")
        self._configs = configs.entries if isinstance(configs, Mapping) else {}

    def check(self) -> None:
        for name, where, entry in mappings(self._top.entries.get("planner_configs")):
            kind = plain_text(entry.entries.get("type"))
            if kind and not has_argument(kind) and kind not in PLANNER_TYPES:
                location = entry.keys.get("type", where)
                self._faults.add_unknown(location, f"planner configuration '{name}': type", kind, PLANNER_TYPES)
        for name, where, entry in mappings(self._top):
            if name != "planner_configs" and any(key in entry.entries for key in GROUP_KEYS):
                self._check_group(name, where, entry)
        self._check_stomp(self._top.entries.get("stomp"))

    def _check_group(self, name: str, where: SourceLocation, entry: Mapping) -> None:
        if has_argument(name):
            return
        if name not in self._semantics.groups:
            self._faults.add_unknown(where, "group", name, self._semantics.groups)
        listed = texts(entry.entries.get("planner_configs"))
        listed += texts(entry.entries.get("default_planner_config"))
        for config, location in listed if self._configs else ():
            if config and config not in self._configs:
                self._faults.add_unknown(location, f"group '{name}': planner configuration", config, self._configs)
        for text, location in texts(entry.entries.get("projection_evaluator")):
            self._check_projection(name, text, location)

    def _check_projection(self, group: str, text: str, where: SourceLocation) -> None:
        match = _PROJECTION.fullmatch(text.strip())
        if has_argument(text):
            return
        if match is None:
            allowed = "allowed: joints(NAME,NAME) or link(NAME)"
            self._faults.add(where, f"group '{group}': projection_evaluator is '{text}'; {allowed}; correct it")
            return
        names = [word.strip() for word in match[2].split(",")]
        known = self._semantics.groups.get(group)
        if match[1] == "link":
            allowed_names = list(self._tree.links)
        else:
            allowed_names = list(known.active) if known else [item.name for item in self._tree.robot.movable_joints()]
            allowed_names += sorted(self._semantics.virtual_joints)
        for name in names:
            if name.partition("/")[0] not in allowed_names:
                what = f"group '{group}': projection_evaluator: {match[1].removesuffix('s')}"
                self._faults.add_unknown(where, what, name, allowed_names)

    def _check_stomp(self, node: Node | None) -> None:
        """Checks the groups of MoveIt 1's stomp_planning.yaml."""
        for _, _, entry in mappings(node):
            for group, where in texts(entry.entries.get("group_name")):
                if group not in self._semantics.groups and not has_argument(group):
                    self._faults.add_unknown(where, "group_name: group", group, self._semantics.groups)
