# SPDX-License-Identifier: BSD-3-Clause
"""Stores which model each simulated object was made from."""

from __future__ import annotations

import threading
from collections.abc import Collection


class ObjectTypeError(LookupError):
    """A mapping of object names to types was refused; the text says why."""


class ObjectTypes:
    """Thread-safe map of object name to object type (a model's name or an SDF file)."""

    def __init__(self) -> None:
        self._types: dict[str, str] = {}
        self._simulated: set[str] = set()
        self._lock = threading.Lock()

    def follow(self, models: Collection[str]) -> list[str]:
        """Forgets the objects that were in the simulation and are not any more.

        An object that was never there stays: it may be about to be spawned.

        Args:
            models: Names of the models that are in the simulation now.

        Returns:
            Names of the objects that were forgotten.
        """
        with self._lock:
            gone = sorted(self._simulated.difference(models))
            for name in gone:
                del self._types[name]
            self._simulated = self._types.keys() & set(models)
            return gone

    def add(self, object_name: str, object_type: str) -> None:
        """Registers an object.

        Raises:
            ObjectTypeError: The name is empty or in use; the earlier type is kept.
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
            ObjectTypeError: No such object.
        """
        with self._lock:
            return self._types[self._known(object_name)]

    def delete(self, object_name: str) -> None:
        """Removes an object.

        Raises:
            ObjectTypeError: No such object.
        """
        with self._lock:
            del self._types[self._known(object_name)]
            self._simulated.discard(object_name)

    def _known(self, object_name: str) -> str:
        if object_name not in self._types:
            known = ", ".join(sorted(self._types)) or "none"
            raise ObjectTypeError(f"No object named '{object_name}' is registered. Registered: {known}.")
        return object_name
