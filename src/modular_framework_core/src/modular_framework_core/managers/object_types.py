# SPDX-License-Identifier: BSD-3-Clause
"""Stores the model of each simulated object."""

from __future__ import annotations

import threading
from collections.abc import Collection


class ObjectTypeError(LookupError):
    """A request for an object type is invalid."""


class ObjectTypes:
    """Thread-safe map of object names to types, which are model names or SDF files."""

    def __init__(self) -> None:
        self._types: dict[str, str] = {}
        self._simulated: set[str] = set()
        self._lock = threading.Lock()

    def remove_missing(self, models: Collection[str]) -> list[str]:
        """Removes the objects that have disappeared from the simulation; objects not yet spawned stay.

        Args:
            models: Names of all models in the simulation.

        Returns:
            Names of the removed objects.
        """
        with self._lock:
            removed = sorted(self._simulated.difference(models))
            for name in removed:
                del self._types[name]
            self._simulated = self._types.keys() & set(models)
            return removed

    def add(self, object_name: str, object_type: str) -> None:
        """Registers an object.

        Raises:
            ObjectTypeError: The name is empty or already registered.
        """
        with self._lock:
            if not object_name:
                raise ObjectTypeError("An object needs a name, got an empty one.")
            if object_name in self._types:
                raise ObjectTypeError(
                    f"An object named '{object_name}' exists already (type "
                    f"'{self._types[object_name]}'); delete it first or choose another name."
                )
            self._types[object_name] = object_type

    def get(self, object_name: str) -> str:
        """Returns the type of an object.

        Raises:
            ObjectTypeError: The object is not registered.
        """
        with self._lock:
            return self._types[self._checked_name(object_name)]

    def delete(self, object_name: str) -> None:
        """Removes an object.

        Raises:
            ObjectTypeError: The object is not registered.
        """
        with self._lock:
            del self._types[self._checked_name(object_name)]
            self._simulated.discard(object_name)

    def _checked_name(self, object_name: str) -> str:
        if object_name not in self._types:
            known_names = ", ".join(sorted(self._types)) or "none"
            raise ObjectTypeError(f"No object named '{object_name}' is registered. Registered: {known_names}.")
        return object_name
