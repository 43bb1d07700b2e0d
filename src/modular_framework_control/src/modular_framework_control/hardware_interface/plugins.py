# SPDX-License-Identifier: BSD-3-Clause
"""Plugins: hardware and controller classes of other packages under names `package/Class`.

As for other ROS plugins, an `<export>` tag in the package.xml of a package names a description,

    <export><modular_framework_control plugin="${prefix}/plugins.xml"/></export>

and the description lists the classes of each Python module:

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

from modular_framework_ros.allowed_names import nearest
from modular_framework_urdf import xml_text

EXPORT_TAG = "modular_framework_control"
CPP_EXPORT_TAGS = ("hardware_interface", "controller_interface")
"""Export tags for C++ classes of ros_control."""
ROBOT_HW_BASE = "hardware_interface::RobotHW"
CONTROLLER_BASE = "controller_interface::ControllerBase"


class PluginError(Exception):
    """A class is unknown, cannot be loaded, or has the wrong base class."""


@dataclass(frozen=True, slots=True)
class Plugin:
    """A class in a plugin description.

    Attributes:
        name: Name for users, package/Class.
        base: Base class as in `base_class_type`.
        module: Python module, or library of a C++ class.
        class_name: Name of the class in the module.
        origin: File of the description.
    """

    name: str
    base: str
    module: str
    class_name: str
    origin: Path

    @property
    def is_cpp(self) -> bool:
        """Whether the plugin is a C++ class, under any export tag."""
        return "::" in self.class_name or "/" in self.module or self.module.endswith(".so")


def _packages_of_workspace() -> Mapping[str, Path]:
    # Imported here, because only a search for plugins needs the workspace.
    from modular_framework_control.hardware_interface.workspace_packages import packages_of_workspace

    return packages_of_workspace()


class PluginIndex:
    """The plugins of one base class, searched at the first use.

    Args:
        base: ROBOT_HW_BASE or CONTROLLER_BASE.
        packages: Function that returns package folders by name; by default of the sourced workspace.
    """

    def __init__(self, base: str, packages: Callable[[], Mapping[str, Path]] | None = None) -> None:
        self._base = base
        self._packages = packages if packages is not None else _packages_of_workspace
        self._plugins_by_name: dict[str, Plugin] | None = None
        self._faults: list[str] = []
        self._stale: set[str] = set()

    @property
    def names(self) -> list[str]:
        """Sorted names of the plugins."""
        return sorted(self._plugins())

    @property
    def faults(self) -> list[str]:
        """Faults in plugin descriptions."""
        self._plugins()
        return list(self._faults)

    def __contains__(self, name: str) -> bool:
        return name in self._plugins()

    def load(self, name: str, expected: type[Any]) -> type[Any]:
        """Imports a plugin class.

        Args:
            name: Name of the plugin, package/Class.
            expected: Required base class.

        Raises:
            PluginError: The plugin is unknown (the message lists known plugins and faulty descriptions), the module
                cannot be imported, or the base class is wrong.
        """
        plugin = self._plugins().get(name)
        if plugin is None:
            self._refuse_cpp_class(name, expected)
            faults = f"; faulty descriptions: {'; '.join(self._faults)}" if self._faults else ""
            raise PluginError(
                f"no package of this workspace offers a {self._base} named {name!r}; known: "
                f"{', '.join(self.names) or 'none'}{faults}. A package offers one by "
                f'<export><{EXPORT_TAG} plugin="${{prefix}}/plugins.xml"/></export> in its package.xml'
                f"{nearest(name, self.names)}"
            )
        if plugin.is_cpp:
            raise _cpp_error(plugin, expected)
        location = f"{plugin.class_name} of {plugin.module} (offered as {name} by {plugin.origin})"
        try:
            loaded = getattr(self._module(plugin.module), plugin.class_name)
        except Exception as error:  # a user's module may raise anything when it is imported
            raise PluginError(f"cannot load {location}: {type(error).__name__}: {error}") from error
        if not isinstance(loaded, type) or not issubclass(loaded, expected):
            raise PluginError(
                f"{location} is not a {expected.__name__}; derive it from {expected.__module__}.{expected.__name__}"
            )
        return loaded

    def _refuse_cpp_class(self, name: str, expected: type[Any]) -> None:
        """Raises PluginError if `name` is a C++ class of a package."""
        for package, folder in sorted(self._packages().items()):
            for plugin in self._of_package(package, folder, [], CPP_EXPORT_TAGS):
                if plugin.name == name:
                    raise _cpp_error(plugin, expected)

    def reload(self) -> None:
        """Searches again at the next use, and reimports modules that were changed since their import."""
        self._stale |= {plugin.module for plugin in (self._plugins_by_name or {}).values()}
        self._plugins_by_name = None
        importlib.invalidate_caches()

    def _module(self, name: str) -> ModuleType:
        stale = name in self._stale and name in sys.modules
        self._stale.discard(name)
        return importlib.reload(sys.modules[name]) if stale else importlib.import_module(name)

    def _plugins(self) -> dict[str, Plugin]:
        if self._plugins_by_name is None:
            plugins_by_name: dict[str, Plugin] = {}
            faults: list[str] = []
            for package, folder in sorted(self._packages().items()):
                for plugin in self._of_package(package, folder, faults, (EXPORT_TAG,)):
                    first = plugins_by_name.setdefault(plugin.name, plugin)
                    if first is not plugin:
                        faults.append(f"{plugin.origin}: {plugin.name} is already offered by {first.origin}")
            self._faults, self._plugins_by_name = faults, plugins_by_name
            return plugins_by_name
        return self._plugins_by_name

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
    """Returns the classes in a plugin description.

    Raises:
        PluginError: The file is missing or not XML, or entries are incomplete; the message lists all faults.
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
