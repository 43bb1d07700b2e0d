# SPDX-License-Identifier: BSD-3-Clause
"""Sources of launch files in Python, with `generate_launch_description()`, and in roslaunch's XML."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

from launch.actions.launch_description import LaunchDescription
from launch.actions.launch_description_source import LaunchDescriptionSource
from launch.core.errors import InvalidLaunchFileError, LaunchError, hint

PYTHON_ENDINGS = (".py",)
XML_ENDINGS = (".launch", ".xml", ".test")
FUNCTION = "generate_launch_description"


def load_python_launch_file_as_module(python_launch_file_path: str) -> ModuleType:
    """Imports a Python launch file as a module.

    Raises:
        InvalidLaunchFileError: The file does not exist or raised an exception; the message contains file and line.
    """
    path = _existing(python_launch_file_path)
    name = f"python_launch_file_{re.sub(r'[^0-9A-Za-z_]', '_', path.name)}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise InvalidLaunchFileError(f"{path}: is not a Python file; allowed: a name that ends in .py")
    module = importlib.util.module_from_spec(spec)
    write_bytecode, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    try:
        spec.loader.exec_module(module)
    except LaunchError:
        raise
    except Exception as error:  # a launch file may raise anything
        raise _launch_file_error(path, error) from error
    finally:
        sys.dont_write_bytecode = write_bytecode
    return module


def get_launch_description_from_python_launch_file(python_launch_file_path: str) -> LaunchDescription:
    """Returns the description of a Python launch file.

    Raises:
        InvalidLaunchFileError: The file has no function that returns a launch description.
    """
    path = Path(python_launch_file_path)
    module = load_python_launch_file_as_module(python_launch_file_path)
    function = getattr(module, FUNCTION, None)
    if not callable(function):
        functions = [name for name, value in vars(module).items() if callable(value)]
        raise InvalidLaunchFileError(
            f"{path}: has no function {FUNCTION}(){hint(FUNCTION, functions)}; define this function, which returns "
            "a LaunchDescription"
        )
    try:
        description: Any = function()
    except LaunchError:
        raise
    except Exception as error:  # a launch file may raise anything
        raise _launch_file_error(path, error) from error
    if not isinstance(description, LaunchDescription):
        raise InvalidLaunchFileError(f"{path}: {FUNCTION}() returned {description!r}; allowed: a LaunchDescription")
    return description


def _existing(path_text: str) -> Path:
    path = Path(path_text)
    if path.is_file():
        return path
    beside = sorted(each.name for each in path.parent.iterdir()) if path.parent.is_dir() else []
    content = f"{path.parent} contains: {', '.join(beside)}" if beside else f"folder {path.parent} does not exist"
    raise InvalidLaunchFileError(f"{path}: there is no such file{hint(path.name, beside)}; {content}; correct the path")


def _launch_file_error(path: Path, error: Exception) -> InvalidLaunchFileError:
    """Returns the error of a launch file that raised an exception, with the line in the file."""
    where, traceback = str(path), error.__traceback__
    if isinstance(error, SyntaxError) and error.lineno is not None:
        where = f"{error.filename}:{error.lineno}"
    while traceback is not None:
        if Path(traceback.tb_frame.f_code.co_filename) == path:
            where = f"{path}:{traceback.tb_lineno}"
        traceback = traceback.tb_next
    failed = InvalidLaunchFileError(f"{type(error).__name__}: {error}")
    failed.where = where
    return failed


class _LaunchFile(LaunchDescriptionSource):
    """Base class of sources that read a launch file.

    Args:
        launch_file_path: Path of the file.
    """

    def __init__(self, launch_file_path: Any) -> None:
        super().__init__(None, str(launch_file_path) if isinstance(launch_file_path, Path) else launch_file_path)


class PythonLaunchDescriptionSource(_LaunchFile):
    """Source of a Python launch file.

    Args:
        launch_file_path: Path of the file.
    """

    def load(self, path: str) -> LaunchDescription:
        return get_launch_description_from_python_launch_file(path)


class XMLLaunchDescriptionSource(_LaunchFile):
    """Source of an XML launch file of roslaunch.

    Args:
        launch_file_path: Path of the file.
    """

    def load(self, path: str) -> LaunchDescription:
        from launch.actions.ros_xml_files import describe_xml_file

        return describe_xml_file(str(_existing(path)))


class AnyLaunchDescriptionSource(_LaunchFile):
    """Source of a launch file whose format is given by the end of its name.

    Args:
        launch_file_path: Path of the file.
    """

    def load(self, path: str) -> LaunchDescription:
        return get_launch_description_from_any_launch_file(path)


FrontendLaunchDescriptionSource = XMLLaunchDescriptionSource


def get_launch_description_from_any_launch_file(launch_file_path: str) -> LaunchDescription:
    """Returns the description of a launch file.

    Raises:
        InvalidLaunchFileError: The format of the file is unknown.
    """
    if launch_file_path.endswith(PYTHON_ENDINGS):
        return get_launch_description_from_python_launch_file(launch_file_path)
    if launch_file_path.endswith(XML_ENDINGS):
        return XMLLaunchDescriptionSource(launch_file_path).load(launch_file_path)
    _existing(launch_file_path)
    allowed = ", ".join((*PYTHON_ENDINGS, *XML_ENDINGS))
    raise InvalidLaunchFileError(f"{launch_file_path}: unknown format; allowed: names that end in {allowed}")
