# SPDX-License-Identifier: BSD-3-Clause
"""Keeps the allowed collision matrix of links and objects; a request changes no other pairs than its own.

The reference matrix comes from the planning scene. Objects that appear later are added to it; the manipulator may then
be allowed to touch itself or some objects. Forbidding again restores the reference.
"""

from __future__ import annotations

import threading
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field

from modular_framework_core.files.faults import nearest
from modular_framework_core.managers.collision_matrix import AcmError, CollisionMatrix, MutableMatrix
from modular_framework_core.task_runner.manipulator_links import manipulator_links

LINK_SEPARATOR = "__"
DEFAULT_LINK = "link"


@dataclass(frozen=True, slots=True)
class AcmAnswer:
    """A matrix with warnings for the requester.

    Attributes:
        matrix: Pairs that may touch from now on.
        warnings: Parts of the request that had no effect.
    """

    matrix: CollisionMatrix
    warnings: tuple[str, ...] = ()


@dataclass(slots=True)
class AcmManager:
    """Keeps the reference matrix, the objects added since and the permissions given.

    Objects may be added before the reference matrix is known; they join it when it arrives.
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
        """Takes a new reference matrix and drops every permission given so far.

        Args:
            matrix: Matrix of the planning scene.
            manipulator_indices: Positions of the manipulator's links in ``matrix.names``.
            manipulator_prefix: Texts separated by spaces, one of which is in the name of each link of the manipulator;
                used when no index is given.

        Returns:
            True when an earlier reference was replaced.

        Raises:
            AcmError: An index points outside the matrix.
        """
        outside = [index for index in manipulator_indices if not 0 <= index < len(matrix.names)]
        if outside:
            raise AcmError(
                f"manipulator_links_indices holds {outside}, the matrix has {len(matrix.names)} entries "
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
        """Ids of the objects added so far."""
        with self._lock:
            return tuple(self._objects)

    def add_object(self, entry_name: str) -> str:
        """Adds an object that may touch nothing yet.

        Args:
            entry_name: Name of the model, or the full ``<model>__<link>`` id of one of its links.

        Returns:
            A warning when the object is known already, else an empty text.

        Raises:
            AcmError: The name is empty.
        """
        name = object_id(entry_name)
        with self._lock:
            if name in self._objects:
                return f"'{name}' is in the collision matrix already; nothing was added."
            self._objects.append(name)
            if self._table is not None and name not in self._table.names:
                self._table.add(name)
            return ""

    def follow(self, models: Collection[str]) -> list[str]:
        """Removes the objects that were in the simulation and are not any more.

        Args:
            models: Names of the models that are in the simulation now.

        Returns:
            Ids of the objects that were removed.
        """
        with self._lock:
            gone = [name for name in self._objects if name in self._simulated and _model_of(name) not in models]
            for name in gone:
                self.delete_object(name)
            self._simulated = {name for name in self._objects if _model_of(name) in models}
            return gone

    def delete_object(self, entry_name: str) -> str:
        """Removes an object.

        Args:
            entry_name: As given to :meth:`add_object`.

        Returns:
            A warning when there is no such object, else an empty text.

        Raises:
            AcmError: The name is empty, or names a link of the reference matrix.
        """
        name = object_id(entry_name)
        with self._lock:
            if name not in self._objects:
                known = ", ".join(self._objects) or "none"
                return f"'{name}' is not among the objects of the collision matrix ({known}); nothing was removed."
            self._objects.remove(name)
            in_reference = self._initial is not None and name in self._initial.names
            if self._table is not None and name in self._table.names and not in_reference:
                self._table.delete(name)
            return ""

    def reinitialise(self) -> None:
        """Drops every permission given so far; the objects stay in the matrix.

        Raises:
            AcmError: There is no reference matrix.
        """
        with self._lock:
            self._require_initial()
            self._restore()

    def current(self) -> AcmAnswer:
        """Returns the matrix as it stands.

        Raises:
            AcmError: There is no reference matrix.
        """
        with self._lock:
            return AcmAnswer(self._matrix())

    def allow_self_collision(self, allow: bool, links: Sequence[str] = ()) -> AcmAnswer:
        """Lets links touch each other, or restores the reference.

        Args:
            allow: False restores the reference.
            links: Names of the links; none means those of the manipulator.

        Returns:
            The new matrix.

        Raises:
            AcmError: There is no reference matrix, or it has no such link.
        """
        with self._lock:
            initial, table = self._require_initial()
            chosen = self._chosen(links)
            for position, first in enumerate(chosen):
                for second in chosen[position + 1 :]:
                    table.set(first, second, allow or bool(initial.allowed(first, second)))
            return AcmAnswer(self._matrix(), _link_warnings(chosen))

    def allow_object_collision(self, objects: Iterable[str], allow: bool, links: Sequence[str] = ()) -> AcmAnswer:
        """Lets links touch objects, or restores the reference.

        Args:
            objects: Models or ids; none means every object added so far.
            allow: False restores the reference.
            links: Names of the links; none means those of the manipulator.

        Returns:
            The new matrix, with a warning for every name that matches nothing.

        Raises:
            AcmError: There is no reference matrix, or it has no such link.
        """
        with self._lock:
            initial, table = self._require_initial()
            chosen, wanted = self._chosen(links), list(objects)
            targets, unknown = _match(wanted, table, chosen) if wanted else (list(self._objects), [])
            warnings = [
                f"No entry of the collision matrix belongs to the object '{name}'; add it first." for name in unknown
            ]
            if not wanted and not targets:
                warnings.append("No object was added to the collision matrix; the manipulator may touch none.")
            for target in targets:
                for link in chosen:
                    if link != target:
                        table.set(link, target, allow or bool(initial.allowed(link, target)))
            return AcmAnswer(self._matrix(), (*warnings, *_link_warnings(chosen)))

    def permissions(self) -> frozenset[frozenset[str]]:
        """Returns the pairs that may touch now and may not by the reference."""
        with self._lock:
            if self._initial is None or self._table is None:
                return frozenset()
            names, reference = self._table.names, self._initial.rows  # its entries come first, objects after them
            return frozenset(
                frozenset((names[i], names[j]))
                for i, row in enumerate(self._table.rows)
                for j in range(i)
                if row[j] and not (i < len(reference) and reference[i][j])
            )

    def _chosen(self, links: Sequence[str]) -> tuple[str, ...]:
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
    """Completes a model's name to the id of its default link; an id that names a link stays.

    Args:
        entry_name: ``box`` or ``box__body``.

    Returns:
        ``box__link`` or ``box__body``.

    Raises:
        AcmError: The name is empty.
    """
    if not entry_name:
        raise AcmError("entry_name is empty; give the name of the object.")
    return entry_name if LINK_SEPARATOR in entry_name else f"{entry_name}{LINK_SEPARATOR}{DEFAULT_LINK}"


def _match(wanted: Sequence[str], table: MutableMatrix, links: Sequence[str]) -> tuple[list[str], list[str]]:
    """Finds the entries of objects, and the names that have none."""
    candidates = [name for name in table.names if name not in links]
    found: list[str] = []
    unknown: list[str] = []
    for name in wanted:
        hits = [entry for entry in candidates if entry == name or entry.startswith(name + LINK_SEPARATOR)]
        found.extend(hits)
        if not hits:
            unknown.append(name)
    return list(dict.fromkeys(found)), unknown


def _link_warnings(links: Sequence[str]) -> tuple[str, ...]:
    if links:
        return ()
    return (
        "No link of the manipulator is known; set manipulator_links_indices or manipulator_prefix "
        "and send the reference matrix again.",
    )
