# SPDX-License-Identifier: BSD-3-Clause
"""Loads Python files by path: states outside of importable packages, and state machine modules."""

from __future__ import annotations

import hashlib
import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import smach


class LoadingError(Exception):
    """A file cannot be loaded or lacks the requested definition."""


def load_module(file: str | Path) -> ModuleType:
    """Imports a Python file by path. A second call returns the same module.

    No bytecode is cached, because Python's cache misses a regenerated file of equal size within the same second.

    Raises:
        LoadingError: The file does not exist or raises an exception during import.
    """
    path = Path(file).resolve()
    name = f"modular_framework_loaded_{path.stem}_{hashlib.sha256(str(path).encode()).hexdigest()[:8]}"
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None or not path.is_file():
        raise LoadingError(f"{path} is not a Python file that can be loaded")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        exec(compile(path.read_bytes(), str(path), "exec"), module.__dict__)
    except Exception as error:
        del sys.modules[name]
        raise LoadingError(f"{path} raised {type(error).__name__} while it was imported: {error}") from error
    return module


def load_state_class(file: str, class_name: str) -> Any:
    """Returns a state class defined in a file."""
    module = load_module(file)
    if not hasattr(module, class_name):
        raise LoadingError(f"{file} does not define the class {class_name}")
    return getattr(module, class_name)


def machine_factory(module: ModuleType) -> Callable[[], smach.Container]:
    """Returns the function that creates a module's state machine.

    This is ``create_state_machine``, or else the last container class that the module defines.

    Raises:
        LoadingError: The module has neither.
    """
    factory = getattr(module, "create_state_machine", None)
    if callable(factory):
        return factory  # type: ignore[no-any-return]
    classes = [
        value
        for value in vars(module).values()
        if isinstance(value, type) and issubclass(value, smach.Container) and value.__module__ == module.__name__
    ]
    if not classes:
        raise LoadingError(
            f"{module.__file__} defines neither a function create_state_machine() nor a class derived from "
            "smach.StateMachine or smach.Concurrence"
        )
    return classes[-1]
