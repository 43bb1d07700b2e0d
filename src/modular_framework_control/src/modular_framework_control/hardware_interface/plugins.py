# SPDX-License-Identifier: BSD-3-Clause
"""Finds classes that other packages offer under a name `package/Class`: hardware and controllers of users.

A package offers its classes as ROS packages offer plugins: an `<export>` tag in its package.xml names a description,

    <export><modular_framework_control plugin="${prefix}/plugins.xml"/></export>

and the description names, per Python module, the classes in it:

    <library path="my_package.my_module">
      <class name="my_package/MyHW" type="MyHW" base_class_type="hardware_interface::RobotHW"/>
    </library>
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from modular_framework_urdf import xml_text

EXPORT_TAG = "modular_framework_control"
CPP_EXPORT_TAGS = ("hardware_interface", "controller_interface")
"""Tags under which packages offer C++ classes to ros_control."""
ROBOT_HW_BASE = "hardware_interface::RobotHW"
CONTROLLER_BASE = "controller_interface::ControllerBase"


class PluginError(Exception):
    """A class is not offered by any package, cannot be loaded, or is not what it should be."""


@dataclass(frozen=True, slots=True)
class Plugin:
    """One class that a package offers.

    Attributes:
        name: what users write, package/Class.
        base: its base class, as in `base_class_type`.
        module: Python module it is in, or library of a C++ class.
        class_name: its name in that module.
        origin: the description that offers it.
    """

    name: str
    base: str
    module: str
    class_name: str
    origin: Path

    @property
    def is_cpp(self) -> bool:
        """Whether it is a C++ class of a library, whatever tag offers it."""
        return "::" in self.class_name or "/" in self.module or self.module.endswith(".so")


def _packages_of_workspace() -> Mapping[str, Path]:
    # Imported here, because only a search for plugins needs the workspace.
    from modular_framework_control.hardware_interface.workspace_packages import packages_of_workspace

    return packages_of_workspace()


class PluginIndex:
    """The classes of one base that packages offer; searched once, at the first use.

    Args:
        base: ROBOT_HW_BASE or CONTROLLER_BASE.
        packages: gives the folder of each package by name; those of the sourced workspace when not given.
    """

    def __init__(self, base: str, packages: Callable[[], Mapping[str, Path]] | None = None) -> None:
        self._base = base
        self._packages = packages if packages is not None else _packages_of_workspace
        self._found: dict[str, Plugin] | None = None
        self._faults: list[str] = []
        self._stale: set[str] = set()

    @property
    def names(self) -> list[str]:
        """Names of the classes on offer, sorted."""
        return sorted(self._plugins())

    @property
    def faults(self) -> list[str]:
        """Faults of the descriptions that could not be read in full."""
        self._plugins()
        return list(self._faults)

    def __contains__(self, name: str) -> bool:
        return name in self._plugins()

    def load(self, name: str, expected: type[Any]) -> type[Any]:
        """Imports the class offered under `name`.

        Args:
            name: package/Class.
            expected: class that it must be derived from.

        Raises:
            PluginError: no package offers it (the message lists what is offered and which descriptions are faulty), its
                module cannot be imported, or it is something else.
        """
        plugin = self._plugins().get(name)
        if plugin is None:
            self._refuse_cpp_class(name, expected)
            faults = f"; faulty descriptions: {'; '.join(self._faults)}" if self._faults else ""
            raise PluginError(
                f"no package of this workspace offers a {self._base} named {name!r}; known: "
                f"{', '.join(self.names) or 'none'}{faults}. A package offers one by <export>"
                f'<{EXPORT_TAG} plugin="${{prefix}}/plugins.xml"/></export> in its package.xml'
            )
        if plugin.is_cpp:
            raise _cpp_error(plugin, expected)
        where = f"{plugin.class_name} of {plugin.module} (offered as {name} by {plugin.origin})"
        try:
            loaded = getattr(self._module(plugin.module), plugin.class_name)
        except Exception as error:  # a user's module may raise anything when it is imported
            raise PluginError(f"cannot load {where}: {type(error).__name__}: {error}") from error
        if not isinstance(loaded, type) or not issubclass(loaded, expected):
            raise PluginError(
                f"{where} is no {expected.__name__}; derive it from {expected.__module__}.{expected.__name__}"
            )
        return loaded

    def _refuse_cpp_class(self, name: str, expected: type[Any]) -> None:
        """Raises PluginError if a package offers a C++ class under `name`."""
        for package, folder in sorted(self._packages().items()):
            for plugin in self._of_package(package, folder, [], CPP_EXPORT_TAGS):
                if plugin.name == name:
                    raise _cpp_error(plugin, expected)

    def reload(self) -> None:
        """Makes the next use search again, also for modules that were installed or changed since their import."""
        self._stale |= {plugin.module for plugin in (self._found or {}).values()}
        self._found = None
        importlib.invalidate_caches()

    def _module(self, name: str) -> ModuleType:
        stale = name in self._stale and name in sys.modules
        self._stale.discard(name)
        return importlib.reload(sys.modules[name]) if stale else importlib.import_module(name)

    def _plugins(self) -> dict[str, Plugin]:
        if self._found is None:
            found: dict[str, Plugin] = {}
            faults: list[str] = []
            for package, folder in sorted(self._packages().items()):
                for plugin in self._of_package(package, folder, faults, (EXPORT_TAG,)):
                    first = found.setdefault(plugin.name, plugin)
                    if first is not plugin:
                        faults.append(f"{plugin.origin}: {plugin.name} is already offered by {first.origin}")
            self._faults, self._found = faults, found
            return found
        return self._found

    def _of_package(self, package: str, folder: Path, faults: list[str], tags: Sequence[str]) -> list[Plugin]:
        manifest = folder / "package.xml"
        if not manifest.is_file():
            return []
        text = manifest.read_text(encoding="utf-8", errors="replace")
        if not any(tag in text for tag in tags):
            return []
        plugins: list[Plugin] = []
        for path in _descriptions(package, manifest, faults, tags):
            try:
                plugins += [plugin for plugin in read_description(path) if plugin.base == self._base]
            except PluginError as error:
                faults.append(str(error))
        return plugins


def _cpp_error(plugin: Plugin, expected: type[Any]) -> PluginError:
    return PluginError(
        f"{plugin.name} is a C++ class (library {plugin.module}, offered by {plugin.origin}), and only Python classes "
        f"can be loaded; derive a Python class from {expected.__module__}.{expected.__name__}, as docs/robots.md and "
        "docs/contributing.md show, or keep the C++ code in a node of its own that serves the action of its "
        "controller, which controllers.yaml of the moveit_config package names"
    )


def _descriptions(package: str, manifest: Path, faults: list[str], tags: Sequence[str]) -> list[Path]:
    try:
        root = xml_text.read(manifest)
    except xml_text.XmlError as error:
        faults.append(f"{manifest} of package {package}: {error}")
        return []
    exports = [export for tag in tags for export in root.findall(f"export/{tag}")]
    return [Path(export.get("plugin", "").replace("${prefix}", str(manifest.parent))) for export in exports]


def read_description(path: Path) -> list[Plugin]:
    """The classes a description names.

    Raises:
        PluginError: no such file, not XML, or entries that lack something; all of them are named.
    """
    try:
        root = xml_text.read(path)
    except (OSError, xml_text.XmlError) as error:
        raise PluginError(f"plugin description {path}: {error}") from error
    plugins: list[Plugin] = []
    faults: list[str] = []
    for library in [root] if root.tag == "library" else root.findall("library"):
        for entry in library.findall("class"):
            values = {key: entry.get(key, "") for key in ("name", "type", "base_class_type")}
            values["path (of library)"] = library.get("path", "")
            missing = [key for key, value in values.items() if not value]
            if missing or values["name"].count("/") != 1:
                faults.append(
                    f"class {values['name']!r}: "
                    + (f"no {', '.join(missing)}" if missing else "its name must have the form package/Class")
                )
                continue
            plugins.append(
                Plugin(values["name"], values["base_class_type"], values["path (of library)"], values["type"], path)
            )
    if faults:
        raise PluginError(f"plugin description {path}: {'; '.join(faults)}")
    return plugins
