# SPDX-License-Identifier: BSD-3-Clause
"""Checks a whole config package, and returns everything that is inconsistent at once."""

from __future__ import annotations

from pathlib import Path

from modular_framework_core.files.faults import Fault, FaultList
from modular_framework_core.files.located_yaml import Mapping
from modular_framework_setup.checks.controller_checks import ControllerChecker
from modular_framework_setup.checks.joint_limit_checks import check_cartesian_limits, check_joint_limits
from modular_framework_setup.checks.kinematics_checks import check_kinematics
from modular_framework_setup.checks.launch_checks import check_launch_files
from modular_framework_setup.checks.pipeline_checks import check_planners
from modular_framework_setup.checks.sensor_checks import check_sensors
from modular_framework_setup.checks.srdf_checks import check_srdf
from modular_framework_setup.checks.urdf_checks import check_urdf
from modular_framework_setup.config_files.config_package import ConfigPackage, packages_beside, read_config_package
from modular_framework_setup.config_files.description_files import parse_document, read_document
from modular_framework_setup.config_files.robot_tree import RobotTree, Semantics
from modular_framework_setup.config_files.yaml_files import is_open, load_yaml


def check_package(folder: Path) -> tuple[Fault, ...]:
    """Checks a config package.

    Args:
        folder: of the package; it need not be built.

    Returns:
        All its faults by file and line; none when it is consistent.
    """
    faults = FaultList()
    with packages_beside(folder):
        package = read_config_package(folder, faults)
        tree = _read_robot(package, faults)
        semantics = _read_semantics(package, tree, faults) if tree else None
        _check_yaml_files(package, tree, semantics, faults)
        check_launch_files(package, faults)
    return faults.sorted()


def _read_robot(package: ConfigPackage, faults: FaultList) -> RobotTree | None:
    if package.urdf is None:
        return None
    arguments = {**package.launch_mappings(package.urdf.name), **package.xacro_arguments}
    document = read_document(package.urdf, arguments, faults)
    return check_urdf(document, faults) if document else None


def _read_semantics(package: ConfigPackage, tree: RobotTree, faults: FaultList) -> Semantics | None:
    if package.srdf is None:
        return None
    document = read_document(package.srdf, package.launch_mappings(package.srdf.name), faults)
    root = parse_document(document, faults) if document else None
    return None if document is None or root is None else check_srdf(root, document.where, tree, faults)


def _check_yaml_files(
    package: ConfigPackage, tree: RobotTree | None, semantics: Semantics | None, faults: FaultList
) -> None:
    """Checks each file by what its name says it is; files of other names must be YAML, that is all."""
    arguments = {**package.launch_arguments(), **package.xacro_arguments}
    controllers = ControllerChecker(tree, semantics, faults) if tree else None
    for path in package.yaml_files():
        top = load_yaml(path, faults, arguments)
        if top is None:
            continue
        if "controllers" in path.stem or path.parent.name == "controllers":
            if controllers:
                controllers.add_file(path.name, top)
        else:
            _check_file(path, top, tree, semantics, faults)
    if controllers:
        controllers.check_together()


def _check_file(
    path: Path, top: Mapping, tree: RobotTree | None, semantics: Semantics | None, faults: FaultList
) -> None:
    match path.stem:
        case "cartesian_limits" | "pilz_cartesian_limits":
            check_cartesian_limits(top, faults)
        case "sensors_3d":
            check_sensors(top, faults)
        case "joint_limits" if tree:
            check_joint_limits(top, tree, faults)
        case "initial_positions" if tree:
            _check_initial_positions(top, tree, faults)
        case "kinematics" if semantics:
            check_kinematics(top, semantics, faults)
        case stem if tree and semantics and stem.endswith("_planning"):
            check_planners(top, tree, semantics, faults)


def _check_initial_positions(top: Mapping, tree: RobotTree, faults: FaultList) -> None:
    positions = top.entries.get("initial_positions")
    for name in positions if isinstance(positions, Mapping) else ():
        if isinstance(positions, Mapping) and name not in tree.joints and not is_open(name):
            movable = [joint.name for joint in tree.robot.movable_joints()]
            faults.add_unknown(positions.keys[name], "initial_positions: joint", name, movable)
