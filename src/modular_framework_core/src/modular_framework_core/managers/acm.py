# SPDX-License-Identifier: BSD-3-Clause
"""Keeps the allowed collision matrix of links and objects. A request changes only its own pairs.

The reference matrix comes from the planning scene. New objects are added later, and collisions of the manipulator with
itself or with objects can be allowed. Disallowing these collisions restores the reference.
"""

from __future__ import annotations

import threading
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field

from modular_framework_core.managers.collision_matrix import AcmError, CollisionMatrix, MutableMatrix
from modular_framework_core.task_runner.manipulator_links import manipulator_links
from modular_framework_ros.allowed_names import nearest

LINK_SEPARATOR = "__"
DEFAULT_LINK = "link"


@dataclass(frozen=True, slots=True)
class AcmResult:
    """Result of a request.

    Attributes:
        matrix: Allowed collision matrix after the request.
        warnings: Parts of the request without effect.
    """

    matrix: CollisionMatrix
    warnings: tuple[str, ...] = ()


@dataclass(slots=True)
class AcmManager:
    """Keeps the reference matrix, the added objects and the allowed collisions.

    Objects may be added before the reference matrix is set.
    """

    _initial: CollisionMatrix | None = None
    _table: MutableMatrix | None = None
    _objects: list[str] = field(default_factory=list)
    _simulated: set[str] = field(default_factory=set)
    _manipulator_links: tuple[str, ...] = ()
    _lock: threading.RLock = field(default_factory=threading.RLock)

    def set_initial(
        self, matrix: CollisionMatrix, manipulator_indices: Sequence[int] = (), manipulator_prefix: str = ""
    ) -> bool:
        """Sets the reference matrix and resets all allowed collisions.

        Args:
            matrix: Matrix of the planning scene.
            manipulator_indices: Indices of the manipulator's links in ``matrix.names``.
            manipulator_prefix: Texts separated by spaces. A link whose name contains one of the texts belongs to the
                manipulator. Ignored if indices are given.

        Returns:
            Whether an earlier reference was replaced.

        Raises:
            AcmError: An index is out of range.
        """
        outside = [index for index in manipulator_indices if not 0 <= index < len(matrix.names)]
        if outside:
            raise AcmError(
                f"manipulator_links_indices contains {outside}, the matrix has {len(matrix.names)} entries "
                f"(0 to {len(matrix.names) - 1}); compute the indices from the matrix that is sent."
            )
        links = [matrix.names[index] for index in manipulator_indices]
        if not links:
            links = [matrix.names[index] for index in manipulator_links(matrix.names, manipulator_prefix)]
        with self._lock:
            replaced = self._initial is not None
            self._initial = matrix
            self._manipulator_links = tuple(dict.fromkeys(links))
            self._restore()
            return replaced

    @property
    def objects(self) -> tuple[str, ...]:
        """IDs of the added objects."""
        with self._lock:
            return tuple(self._objects)

    def add_object(self, entry_name: str) -> str:
        """Adds an object without allowed collisions.

        Args:
            entry_name: Model name, or ``<model>__<link>`` for one link of the model.

        Returns:
            Warning if the object exists already, else "".

        Raises:
            AcmError: The name is empty.
        """
        name = object_id(entry_name)
        with self._lock:
            if name in self._objects:
                return f"'{name}' is already in the collision matrix; nothing was added."
            self._objects.append(name)
            if self._table is not None and name not in self._table.names:
                self._table.add(name)
            return ""

    def remove_missing(self, models: Collection[str]) -> list[str]:
        """Removes the objects that have disappeared from the simulation.

        Args:
            models: Names of all models in the simulation.

        Returns:
            IDs of the removed objects.
        """
        with self._lock:
            removed = [name for name in self._objects if name in self._simulated and _model_of(name) not in models]
            for name in removed:
                self.delete_object(name)
            self._simulated = {name for name in self._objects if _model_of(name) in models}
            return removed

    def delete_object(self, entry_name: str) -> str:
        """Removes an object.

        Args:
            entry_name: Name as in :meth:`add_object`.

        Returns:
            Warning if the object is unknown, else "".

        Raises:
            AcmError: The name is empty.
        """
        name = object_id(entry_name)
        with self._lock:
            if name not in self._objects:
                known_objects = ", ".join(self._objects) or "none"
                return (
                    f"'{name}' is not among the objects of the collision matrix ({known_objects}); nothing was removed."
                )
            self._objects.remove(name)
            in_reference = self._initial is not None and name in self._initial.names
            if self._table is not None and name in self._table.names and not in_reference:
                self._table.delete(name)
            return ""

    def reinitialise(self) -> None:
        """Resets all allowed collisions to the reference; the objects stay in the matrix.

        Raises:
            AcmError: There is no reference matrix.
        """
        with self._lock:
            self._require_initial()
            self._restore()

    def current(self) -> AcmResult:
        """Returns the current matrix.

        Raises:
            AcmError: There is no reference matrix.
        """
        with self._lock:
            return AcmResult(self._matrix())

    def allow_self_collision(self, allow: bool, links: Sequence[str] = ()) -> AcmResult:
        """Allows collisions between links, or restores the reference.

        Args:
            allow: Whether to allow the collisions; False restores the reference.
            links: Link names; empty for the manipulator's links.

        Raises:
            AcmError: There is no reference matrix, or a link is unknown.
        """
        with self._lock:
            initial, table = self._require_initial()
            selected_links = self._selected_links(links)
            for index, first in enumerate(selected_links):
                for second in selected_links[index + 1 :]:
                    table.set(first, second, allow or bool(initial.is_allowed(first, second)))
            return AcmResult(self._matrix(), _link_warnings(selected_links))

    def allow_object_collision(self, objects: Iterable[str], allow: bool, links: Sequence[str] = ()) -> AcmResult:
        """Allows collisions between links and objects, or restores the reference.

        Args:
            objects: Model names or object IDs; empty for all added objects.
            allow: Whether to allow the collisions; False restores the reference.
            links: Link names; empty for the manipulator's links.

        Returns:
            The new matrix, with a warning for every unknown object.

        Raises:
            AcmError: There is no reference matrix, or a link is unknown.
        """
        with self._lock:
            initial, table = self._require_initial()
            selected_links, requested = self._selected_links(links), list(objects)
            targets, unknown = _match(requested, table, selected_links) if requested else (list(self._objects), [])
            warnings = [
                f"No entry of the collision matrix belongs to the object '{name}'; add it first." for name in unknown
            ]
            if not requested and not targets:
                warnings.append("No object was added to the collision matrix; the manipulator may touch none.")
            for target in targets:
                for link in selected_links:
                    if link != target:
                        table.set(link, target, allow or bool(initial.is_allowed(link, target)))
            return AcmResult(self._matrix(), (*warnings, *_link_warnings(selected_links)))

    def permissions(self) -> frozenset[frozenset[str]]:
        """Returns the pairs that are allowed now but not in the reference."""
        with self._lock:
            if self._initial is None or self._table is None:
                return frozenset()
            names, reference = self._table.names, self._initial.rows  # the table begins with the reference entries
            return frozenset(
                frozenset((names[i], names[j]))
                for i, row in enumerate(self._table.rows)
                for j in range(i)
                if row[j] and not (i < len(reference) and reference[i][j])
            )

    def _selected_links(self, links: Sequence[str]) -> tuple[str, ...]:
        initial, _ = self._require_initial()
        for link in links:
            if link not in initial.names:
                raise AcmError(
                    f"The collision matrix has no link '{link}'; it has {', '.join(initial.names)}"
                    f"{nearest(link, initial.names)}"
                )
        return tuple(dict.fromkeys(links)) or self._manipulator_links

    def _require_initial(self) -> tuple[CollisionMatrix, MutableMatrix]:
        if self._initial is None or self._table is None:
            raise AcmError("There is no reference collision matrix yet; call set_init_acm first.")
        return self._initial, self._table

    def _restore(self) -> None:
        if self._initial is None:
            return
        self._table = MutableMatrix.of(self._initial)
        for name in self._objects:
            if name not in self._table.names:
                self._table.add(name)

    def _matrix(self) -> CollisionMatrix:
        initial, table = self._require_initial()
        return CollisionMatrix(
            tuple(table.names), tuple(tuple(row) for row in table.rows), initial.default_names, initial.default_values
        )


def _model_of(object_name: str) -> str:
    return object_name.rpartition(LINK_SEPARATOR)[0]


def object_id(entry_name: str) -> str:
    """Returns the object ID of a model's default link: ``box`` -> ``box__link``. An ID with link is unchanged.

    Raises:
        AcmError: The name is empty.
    """
    if not entry_name:
        raise AcmError("entry_name is empty; give the name of the object.")
    return entry_name if LINK_SEPARATOR in entry_name else f"{entry_name}{LINK_SEPARATOR}{DEFAULT_LINK}"


def _match(requested: Sequence[str], table: MutableMatrix, links: Sequence[str]) -> tuple[list[str], list[str]]:
    """Returns the matrix entries of the requested objects, and the requested names without entry."""
    candidates = [name for name in table.names if name not in links]
    matches: list[str] = []
    unknown: list[str] = []
    for name in requested:
        entries = [entry for entry in candidates if entry == name or entry.startswith(name + LINK_SEPARATOR)]
        matches.extend(entries)
        if not entries:
            unknown.append(name)
    return list(dict.fromkeys(matches)), unknown


def _link_warnings(links: Sequence[str]) -> tuple[str, ...]:
    if links:
        return ()
    return (
        "No link of the manipulator is known; set manipulator_links_indices or manipulator_prefix "
        "and send the reference matrix again.",
    )
