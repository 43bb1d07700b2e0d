# SPDX-License-Identifier: BSD-3-Clause
"""Checks a whole config package and returns all faults at once."""

from __future__ import annotations

import re
from collections.abc import Mapping as Values
from dataclasses import dataclass
from pathlib import Path

from modular_framework_core.files.faults import Fault, FaultList, SourceLocation
from modular_framework_core.files.located_yaml import Mapping, Scalar, Sequence, kind_of
from modular_framework_planning.perception.sensor_settings import read_sensors
from modular_framework_ros.allowed_names import nearest
from modular_framework_setup.checks.controller_checks import ControllerChecker
from modular_framework_setup.checks.joint_limit_checks import check_cartesian_limits, check_joint_limits
from modular_framework_setup.checks.kinematics_checks import check_kinematics
from modular_framework_setup.checks.pipeline_checks import check_planners
from modular_framework_setup.checks.posture_checks import check_postures
from modular_framework_setup.checks.srdf_checks import check_srdf
from modular_framework_setup.checks.urdf_checks import check_urdf
from modular_framework_setup.config_files.config_package import (
    ConfigPackage,
    find_package,
    packages_beside,
    read_config_package,
)
from modular_framework_setup.config_files.description_files import (
    XmlDocument,
    add_xml_error,
    package_document,
    parse_document,
)
from modular_framework_setup.config_files.robot_tree import RobotTree, Semantics
from modular_framework_setup.config_files.yaml_files import has_argument, load_yaml, parameters_of
from modular_framework_urdf import xml_text
from modular_framework_urdf.mesh_paths import mesh_path
from modular_framework_urdf.srdf_reader import SemanticDescription, read_srdf
from modular_framework_urdf.xml_text import XmlError


@dataclass(frozen=True, slots=True)
class CheckedPackage:
    """A config package with its faults.

    Attributes:
        package: Files of the package.
        tree: Kinematic tree of the robot; None if the URDF is unreadable.
        semantics: Groups and states of the SRDF; None if unreadable.
        srdf: Content of the SRDF; None if unreadable.
        files: Contents of the YAML files, by file name without suffix.
        faults: Faults sorted by file and line.
    """

    package: ConfigPackage
    tree: RobotTree | None
    semantics: Semantics | None
    srdf: SemanticDescription | None
    files: Values[str, Mapping]
    faults: tuple[Fault, ...]


def check_package(folder: Path) -> tuple[Fault, ...]:
    """Returns the faults of a config package, sorted by file and line.

    Args:
        folder: Folder of the package, which need not be built.
    """
    return read_and_check(folder).faults


def read_and_check(folder: Path) -> CheckedPackage:
    """Reads and checks the config package in a folder, which need not be built."""
    faults = FaultList()
    with packages_beside(folder):
        package = read_config_package(folder, faults)
        urdf = package_document(package, package.urdf, faults)
        tree = check_urdf(urdf, faults) if urdf else None
        document = package_document(package, package.srdf, faults)
        root = parse_document(document, faults) if document else None
        semantics = check_srdf(root, document.where, tree, faults) if document and root is not None and tree else None
        if urdf and tree and document and root is not None:
            check_postures(urdf, document, root, lambda uri: str(mesh_path(uri, find_package)), faults)
        files = _check_yaml_files(package, tree, semantics, faults)
        check_launch_files(package, faults)
    return CheckedPackage(package, tree, semantics, _semantic_description(document), files, faults.sorted_faults())


def _semantic_description(document: XmlDocument | None) -> SemanticDescription | None:
    """Returns the SRDF as read at run time, or None if invalid, which is reported elsewhere."""
    try:
        return read_srdf(document.text, document.where) if document else None
    except XmlError:
        return None


def _check_yaml_files(
    package: ConfigPackage, tree: RobotTree | None, semantics: Semantics | None, faults: FaultList
) -> dict[str, Mapping]:
    """Checks each YAML file according to its name. Files of unknown names only need valid YAML."""
    files = {}
    arguments = {**package.launch_arguments(), **package.xacro_arguments}
    controllers = ControllerChecker(tree, semantics, faults) if tree else None
    for path in package.yaml_files():
        top = load_yaml(path, faults, arguments)
        if top is None:
            continue
        files[path.stem] = top
        if "controllers" in path.stem or path.parent.name == "controllers":
            if controllers:
                controllers.add_file(path.name, top)
        else:
            _check_file(path, top, tree, semantics, faults)
    if controllers:
        controllers.check_together()
    return files


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
        if isinstance(positions, Mapping) and name not in tree.joints and not has_argument(name):
            movable = [joint.name for joint in tree.robot.movable_joints()]
            faults.add_unknown(positions.keys[name], "initial_positions: joint", name, movable)


_INDEX_PREFIX = re.compile(r"sensors\[\d+\]: ")


def check_sensors(top: Mapping, faults: FaultList) -> None:
    """Checks sensors_3d.yaml: a list of sensors or, in ROS 2, a list of names of sensors in the same file."""
    top = parameters_of(top)
    sensors = top.entries.get("sensors")
    if not isinstance(sensors, Sequence):
        kind = "nothing" if sensors is None else kind_of(sensors)
        faults.add(sensors.location if sensors else top.location, f"sensors is {kind}; expected a list of sensors")
        return
    for item in sensors.items:
        entry = item
        if isinstance(item, Scalar) and isinstance(item.value, str) and item.value:
            if item.value not in top.entries:
                faults.add_unknown(item.location, "sensors: sensor", item.value, [k for k in top if k != "sensors"])
                continue
            entry = top.entries[item.value]
        if isinstance(entry, Mapping) and any(isinstance(v, str) and has_argument(v) for v in entry.plain().values()):
            continue
        for text in read_sensors([entry.plain()], None)[1]:
            faults.add(entry.location, f"sensor: {_INDEX_PREFIX.sub('', text)}; correct it")


INPUTS = (".yaml", ".yml", ".rviz", ".launch", ".xml", ".srdf", ".urdf", ".xacro")
_OWN_FILE = re.compile(r"^\$\((?P<base>find [\w-]+|dirname)\)(?P<path>/[^$\s]+)$")


def check_launch_files(package: ConfigPackage, faults: FaultList) -> None:
    """Reports launch files that are not XML, and references to missing files of the package.

    Paths with arguments and files of other packages are not checked.
    """
    for path in package.launch_files():
        try:
            root = xml_text.read(path)
        except XmlError as error:
            add_xml_error(error, faults)
            continue
        for element in root.iter():
            for key, value in element.attrib.items():
                file = _named_file(value, path, package) if _names_input(key, value) else None
                if file is not None and not file.exists():
                    names = sorted(item.name for item in file.parent.glob("*")) if file.parent.is_dir() else []
                    faults.add(
                        SourceLocation(str(path), element.sourceline, 1),
                        f"<{element.tag}> names {value}, but there is no such file{nearest(file.name, names)}; "
                        "correct the name, or add the file",
                    )


def _names_input(key: str, value: str) -> bool:
    """Returns whether an attribute names an input file; arguments may also name output files and folders."""
    return key in ("file", "textfile") or (key in ("default", "value") and value.endswith(INPUTS))


def _named_file(value: str, launch_file: Path, package: ConfigPackage) -> Path | None:
    match = _OWN_FILE.match(value)
    if match is None:
        return None
    if match["base"] == "dirname":
        return launch_file.parent / match["path"].lstrip("/")
    return package.folder / match["path"].lstrip("/") if match["base"] == f"find {package.name}" else None
