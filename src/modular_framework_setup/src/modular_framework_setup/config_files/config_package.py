# SPDX-License-Identifier: BSD-3-Clause
"""Finds the files of a MoveIt 1 or MoveIt 2 config package in the layout of the MoveIt Setup Assistant."""

from __future__ import annotations

import functools
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import rospkg

from modular_framework_core.files.faults import FaultList, SourceLocation
from modular_framework_core.files.located_yaml import Mapping as YamlMapping
from modular_framework_core.files.located_yaml import Scalar
from modular_framework_ros.allowed_names import closest, nearest
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
        folder: Folder of the package.
        name: Name of the ROS package, or of the folder if there is no package.xml.
        urdf: URDF or xacro file of the robot; None if not found.
        srdf: SRDF or xacro file of the semantics; None if not found.
        xacro_arguments: Xacro arguments of the URDF, from `.setup_assistant`.
        urdf_package: Folder of the package with the URDF; None for this package.
    """

    folder: Path
    name: str
    urdf: Path | None
    srdf: Path | None
    xacro_arguments: Mapping[str, str] = field(default_factory=dict)
    urdf_package: Path | None = None

    def yaml_files(self) -> list[Path]:
        """Returns the YAML files in the folder config and the controller files of the robot's package."""
        files = _yaml_files(self.folder / "config")
        if self.urdf_package is not None:
            files += _yaml_files(self.urdf_package / "controllers")
        return files

    def launch_files(self) -> list[Path]:
        """Returns the ROS 1 launch files; files that load the robot come first."""
        return launch_files(self.folder)

    def launch_arguments(self) -> dict[str, str]:
        """Returns the plain-text defaults of the launch files' arguments."""
        defaults: dict[str, str] = {}
        for item in (argument for root in self._launch_roots() for argument in root.iter("arg")):
            value = item.get("default") or item.get("value") or ""
            if value and "$(" not in value:
                defaults.setdefault(item.get("name", ""), value)
        return defaults

    def launch_mappings(self, file_name: str) -> dict[str, str]:
        """Returns the xacro arguments with known values that the launch files pass to a description file."""
        return xacro_arguments(self._launch_roots(), file_name, self.launch_arguments())

    def _launch_roots(self) -> Iterator[xml_text.Element]:
        for path in self.launch_files():
            with suppress(OSError, xml_text.XmlError):  # reported by the check of launch files
                yield xml_text.read(path)


def _yaml_files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.glob("*") if path.suffix in (".yaml", ".yml"))


def folder_of(name: str) -> Path:
    """Returns the folder of a config package.

    Args:
        name: Folder, or ROS package on ROS_PACKAGE_PATH.

    Raises:
        NoConfigPackageError: The name is neither a folder nor a ROS package.
    """
    if Path(name).is_dir():
        return Path(name)
    packages = rospkg.RosPack()
    try:
        return Path(packages.get_path(name))
    except rospkg.ResourceNotFound as error:
        config_packages = [item for item in packages.list() if item.endswith("_config")]
        raise NoConfigPackageError(
            f"'{name}' is neither a folder nor a ROS package; allowed: a folder, or a package on ROS_PACKAGE_PATH "
            f"(config packages there: {', '.join(config_packages) or 'none'}){nearest(name, packages.list())}; "
            "correct the name, or source the setup.bash of the package's workspace"
        ) from error


@contextmanager
def packages_beside(folder: Path) -> Iterator[None]:
    """Context manager that adds the package of a folder and its sibling packages to ROS_PACKAGE_PATH.

    The packages need not be built. Siblings are in the package's parent folder or one level below it.
    """
    own_folder = next(
        (parent for parent in (folder, *folder.parents) if (parent / "package.xml").is_file()), folder
    ).resolve()
    old_path = os.environ.get("ROS_PACKAGE_PATH")
    known_folders = {Path(path).resolve() for path in _package_paths()}
    if own_folder in known_folders:
        yield
        return
    added = [
        own_folder,
        *(file.parent for depth in ("*", "*/*") for file in own_folder.parent.glob(f"{depth}/package.xml")),
    ]
    os.environ["ROS_PACKAGE_PATH"] = os.pathsep.join([*map(str, added), *([old_path] if old_path else [])])
    try:
        yield
    finally:
        if old_path is None:
            del os.environ["ROS_PACKAGE_PATH"]
        else:
            os.environ["ROS_PACKAGE_PATH"] = old_path


@functools.cache
def _packages_on(paths: tuple[str, ...]) -> rospkg.RosPack:
    """Returns the packages on search paths; cached, because each RosPack crawls all folders."""
    return rospkg.RosPack(list(paths))


def _packages() -> rospkg.RosPack:
    return _packages_on(tuple(rospkg.get_ros_paths()))


def _package_paths() -> list[str]:
    packages = _packages()
    return [packages.get_path(name) for name in packages.list()]


def find_package(name: str) -> str:
    """Returns the folder of a ROS package.

    Raises:
        KeyError: The package is not found; the message names the closest package.
    """
    packages = _packages()
    try:
        return str(packages.get_path(name))
    except rospkg.ResourceNotFound:
        other = closest(name, packages.list())
        raise KeyError(f"not on ROS_PACKAGE_PATH{f', did you mean {other}?' if other else ''}") from None


def package_name(folder: Path) -> str:
    """Returns the name in a folder's package.xml, or the folder name."""
    try:
        name = xml_text.read(folder / "package.xml").findtext("name")
    except (OSError, xml_text.XmlError):
        name = None
    return (name or "").strip() or folder.resolve().name


def read_config_package(folder: Path, faults: FaultList) -> ConfigPackage:
    """Finds the files of a config package. Missing files add faults.

    The URDF is config/ROBOT.urdf.xacro, with ROBOT the package name without `_moveit_config`, or else the file named in
    `.setup_assistant`, or else the only URDF in the folder config. The SRDF is the file named in `.setup_assistant`, or
    else the only SRDF in the folder config.
    """
    name = package_name(folder)
    settings = _Settings(folder, faults)
    default_urdf = folder / "config" / f"{name.removesuffix('_moveit_config')}.urdf.xacro"
    urdf, urdf_package = (default_urdf, None) if default_urdf.is_file() else settings.urdf()
    srdf = settings.srdf()
    if urdf is None and not settings.names_urdf:
        urdf = _only(folder, ("*.urdf.xacro", "*.urdf"), "robot description", faults)
    if srdf is None and not settings.names_srdf:
        srdf = _only(folder, ("*.srdf", "*.srdf.xacro"), "semantic description", faults)
    package = ConfigPackage(folder, name, urdf, srdf, urdf_package=urdf_package)
    return replace(package, xacro_arguments=settings.xacro_arguments(package.launch_arguments()))


def _only(folder: Path, patterns: tuple[str, ...], noun: str, faults: FaultList) -> Path | None:
    files = sorted(path for pattern in patterns for path in (folder / "config").glob(pattern))
    if len(files) == 1:
        return files[0]
    faults.add(
        SourceLocation(str(folder / "config"), 1, 1),
        f"{len(files)} files may be the {noun} ({', '.join(path.name for path in files) or 'none is there'}); exactly "
        f"one {' or '.join(patterns)} is required; name it in {SETTINGS}",
    )
    return None


class _Settings:
    """Content of the optional file `.setup_assistant`."""

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
        """Returns the xacro arguments, with `$(arg NAME)` replaced by the given values."""
        entry = self._entry("URDF", "xacro_args")
        return known_arguments(command_words(str(entry.value), values)) if entry else {}

    def urdf(self) -> tuple[Path | None, Path | None]:
        """Returns the URDF file, and the folder of its package if that is not this package."""
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
        files = [str(item.relative_to(folder)) for item in path.parent.glob("*") if item.is_file()]
        self._faults.add_unknown(relative.location, f"in {folder} the file", str(relative.value), files)
        return None
