# SPDX-License-Identifier: BSD-3-Clause
"""Finds the files of a config package in the layout of the MoveIt Setup Assistant, of MoveIt 1 or MoveIt 2."""

from __future__ import annotations

import functools
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import rospkg

from modular_framework_core.files.faults import FaultList, SourceLocation, closest, nearest
from modular_framework_core.files.located_yaml import Mapping as YamlMapping
from modular_framework_core.files.located_yaml import Scalar
from modular_framework_setup.config_files.yaml_files import load_yaml
from modular_framework_setup.errors import NoConfigPackageError
from modular_framework_urdf import xml_text
from modular_framework_urdf.launch_arguments import command_words, known_arguments, launch_files, xacro_arguments

SETTINGS = ".setup_assistant"
SETTINGS_KEY = "moveit_setup_assistant_config"


@dataclass(frozen=True, slots=True)
class ConfigPackage:
    """A config package.

    Attributes:
        folder: where it is.
        name: of the ROS package; that of the folder where there is no package.xml.
        urdf: file of the robot description, which may be xacro; None when none was found.
        srdf: file of the semantic description, which may be xacro; None when none was found.
        xacro_arguments: of the robot description, from `.setup_assistant`.
        urdf_package: folder of the package that has the robot description; None for this one.
    """

    folder: Path
    name: str
    urdf: Path | None
    srdf: Path | None
    xacro_arguments: Mapping[str, str] = field(default_factory=dict)
    urdf_package: Path | None = None

    def yaml_files(self) -> list[Path]:
        """Returns the YAML files of its folder config, and the controllers of the robot's own package."""
        files = _yaml_files(self.folder / "config")
        if self.urdf_package is not None:
            files += _yaml_files(self.urdf_package / "controllers")
        return files

    def launch_files(self) -> list[Path]:
        """Returns its launch files of ROS 1, those that load the robot first."""
        return launch_files(self.folder)

    def launch_arguments(self) -> dict[str, str]:
        """Returns the defaults of the launch files' arguments, as far as they are plain text."""
        found: dict[str, str] = {}
        for item in (argument for root in self._launch_roots() for argument in root.iter("arg")):
            value = item.get("default") or item.get("value") or ""
            if value and "$(" not in value:
                found.setdefault(item.get("name", ""), value)
        return found

    def launch_mappings(self, file_name: str) -> dict[str, str]:
        """Returns the xacro arguments that the launch files give a description, those whose values are known here."""
        return xacro_arguments(self._launch_roots(), file_name, self.launch_arguments())

    def _launch_roots(self) -> Iterator[xml_text.Element]:
        for path in self.launch_files():
            with suppress(OSError, xml_text.XmlError):  # the check of launch files says so
                yield xml_text.read(path)


def _yaml_files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.glob("*") if path.suffix in (".yaml", ".yml"))


def folder_of(name: str) -> Path:
    """Returns the folder of a config package.

    Args:
        name: a folder, or a ROS package on ROS_PACKAGE_PATH.

    Raises:
        NoConfigPackageError: it is neither.
    """
    if Path(name).is_dir():
        return Path(name)
    packages = rospkg.RosPack()
    try:
        return Path(packages.get_path(name))
    except rospkg.ResourceNotFound as error:
        known = [item for item in packages.list() if item.endswith("_config")]
        raise NoConfigPackageError(
            f"'{name}' is no folder and no ROS package; allowed: a folder, or a package on ROS_PACKAGE_PATH (config "
            f"packages there: {', '.join(known) or 'none'}){nearest(name, packages.list())}; "
            "correct the name, or source the setup.bash of the workspace that has it"
        ) from error


@contextmanager
def packages_beside(folder: Path) -> Iterator[None]:
    """Also finds the package around a folder and those beside it, for as long as the context lasts.

    They need not be built. The packages beside it lie in the same folder, or in a folder of that one.
    """
    own = next((place for place in (folder, *folder.parents) if (place / "package.xml").is_file()), folder).resolve()
    before = os.environ.get("ROS_PACKAGE_PATH")
    known = {Path(path).resolve() for path in _package_paths()}
    if own in known:
        yield
        return
    found = [own, *(file.parent for depth in ("*", "*/*") for file in own.parent.glob(f"{depth}/package.xml"))]
    os.environ["ROS_PACKAGE_PATH"] = os.pathsep.join([*map(str, found), *([before] if before else [])])
    try:
        yield
    finally:
        if before is None:
            del os.environ["ROS_PACKAGE_PATH"]
        else:
            os.environ["ROS_PACKAGE_PATH"] = before


@functools.cache
def _packages_on(paths: tuple[str, ...]) -> rospkg.RosPack:
    """Returns the packages on search paths; cached, because each RosPack walks through all folders once."""
    return rospkg.RosPack(list(paths))


def _packages() -> rospkg.RosPack:
    return _packages_on(tuple(rospkg.get_ros_paths()))


def _package_paths() -> list[str]:
    packages = _packages()
    return [packages.get_path(name) for name in packages.list()]


def find_package(name: str) -> str:
    """Returns the folder of a ROS package; raises KeyError naming the nearest one when it is not there."""
    packages = _packages()
    try:
        return str(packages.get_path(name))
    except rospkg.ResourceNotFound:
        other = closest(name, packages.list())
        raise KeyError(f"not on ROS_PACKAGE_PATH{f', did you mean {other}?' if other else ''}") from None


def package_name(folder: Path) -> str:
    """Returns the name in a folder's package.xml, else the folder's."""
    try:
        name = xml_text.read(folder / "package.xml").findtext("name")
    except (OSError, xml_text.XmlError):
        name = None
    return (name or "").strip() or folder.resolve().name


def read_config_package(folder: Path, faults: FaultList) -> ConfigPackage:
    """Finds the files of a config package; notes what is missing.

    The robot description is config/ROBOT.urdf.xacro where there is one, ROBOT being the package's name without
    `_moveit_config`; else the one `.setup_assistant` names; else the only one in the folder config. The semantic
    description is the one `.setup_assistant` names, else the only one in the folder config.
    """
    name = package_name(folder)
    settings = _Settings(folder, faults)
    own = folder / "config" / f"{name.removesuffix('_moveit_config')}.urdf.xacro"
    urdf, urdf_package = (own, None) if own.is_file() else settings.urdf()
    srdf = settings.srdf()
    if urdf is None and not settings.names_urdf:
        urdf = _only(folder, ("*.urdf.xacro", "*.urdf"), "robot description", faults)
    if srdf is None and not settings.names_srdf:
        srdf = _only(folder, ("*.srdf", "*.srdf.xacro"), "semantic description", faults)
    package = ConfigPackage(folder, name, urdf, srdf, urdf_package=urdf_package)
    return replace(package, xacro_arguments=settings.xacro_arguments(package.launch_arguments()))


def _only(folder: Path, patterns: tuple[str, ...], what: str, faults: FaultList) -> Path | None:
    found = sorted(path for pattern in patterns for path in (folder / "config").glob(pattern))
    if len(found) == 1:
        return found[0]
    faults.add(
        SourceLocation(str(folder / "config"), 1, 1),
        f"{len(found)} files may be the {what} ({', '.join(path.name for path in found) or 'none is there'}); needed "
        f"is one {' or '.join(patterns)}; name it in {SETTINGS}",
    )
    return None


class _Settings:
    """The file `.setup_assistant`, which may be missing."""

    def __init__(self, folder: Path, faults: FaultList) -> None:
        self._folder, self._path, self._faults = folder, folder / SETTINGS, faults
        top = load_yaml(self._path, faults) if self._path.is_file() else None
        section = top.entries.get(SETTINGS_KEY) if top else None
        self._section = section if isinstance(section, YamlMapping) else None
        if top is not None and self._section is None:
            faults.add(top.location, f"has no mapping '{SETTINGS_KEY}'; write it, with URDF and SRDF in it")

    def _entry(self, part: str, key: str) -> Scalar | None:
        entries = self._section.entries if self._section else {}
        section = entries.get(part, entries.get(part.lower()))
        value = section.entries.get(key) if isinstance(section, YamlMapping) else None
        return value if isinstance(value, Scalar) and value.value else None

    @property
    def names_urdf(self) -> bool:
        return self._entry("URDF", "relative_path") is not None

    @property
    def names_srdf(self) -> bool:
        return self._entry("SRDF", "relative_path") is not None

    def xacro_arguments(self, values: Mapping[str, str]) -> dict[str, str]:
        """Returns the arguments, with `$(arg NAME)` as the launch files' arguments are by default."""
        given = self._entry("URDF", "xacro_args")
        return known_arguments(command_words(str(given.value), values)) if given else {}

    def urdf(self) -> tuple[Path | None, Path | None]:
        """Returns the robot description, and the folder of its package when that is another one."""
        path, package = self._entry("URDF", "relative_path"), self._entry("URDF", "package")
        if path is None:
            return None, None
        if package is None:
            return self._existing(self._folder, path), None
        try:
            folder = Path(find_package(str(package.value)))
        except KeyError as error:
            self._faults.add(
                package.location,
                f"package '{package.value}' of the robot description is not found ({error.args[0]}); install it, or "
                "correct the name",
            )
            return None, None
        return self._existing(folder, path), folder if folder.resolve() != self._folder.resolve() else None

    def srdf(self) -> Path | None:
        path = self._entry("SRDF", "relative_path")
        return None if path is None else self._existing(self._folder, path)

    def _existing(self, folder: Path, relative: Scalar) -> Path | None:
        path = folder / str(relative.value)
        if path.is_file():
            return path
        there = [str(item.relative_to(folder)) for item in path.parent.glob("*") if item.is_file()]
        self._faults.add_unknown(relative.location, f"in {folder} the file", str(relative.value), there)
        return None
