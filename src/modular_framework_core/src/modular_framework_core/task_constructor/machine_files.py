# SPDX-License-Identifier: BSD-3-Clause
"""Reads machines that are written in a file of their own, so that several tasks share them.

For example::

    - Pick:
        source: machines/pick.yaml       # path from the folder of this file
        params: {attempts: 3}            # overrides the params of the file
        transitions: {picked: Place, retry: RefreshGrasps, failed: quit_pipeline}
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

from modular_framework_core.files import located_yaml
from modular_framework_core.files.faults import FaultList, TaskFault
from modular_framework_core.files.located_yaml import Mapping, Node, Scalar, Sequence, kind_of
from modular_framework_core.task_constructor.key_spelling import corrected_keys

SUFFIX = ".yaml"
KEYS = ("source", "params", "transitions", "remapping")
"""Keys of a machine whose other keys are in a file."""


def machine_file(body: Mapping) -> Path | None:
    """Returns the file with the machine that a child of a machine names, or None for any other child.

    Args:
        body: Keys of the child.
    """
    source = body.entries.get("source")
    if not isinstance(source, Scalar) or not str(source.value).endswith(SUFFIX):
        return None
    return (Path(source.location.file).parent / Path(str(source.value)).expanduser()).resolve()


def with_machine_file(label: str, body: Mapping, file: Path, faults: FaultList) -> Mapping | None:
    """Returns a machine with the keys of its file; params and transitions of the task take precedence.

    Args:
        label: Label of the machine, for faults.
        body: Keys of the machine in the task.
        file: File of the machine.
        faults: Receives the faults.

    Returns:
        Keys of the machine, or None after a fault.
    """
    own = corrected_keys(body, KEYS, f"'{label}' (machine of {file.name}): key", faults)
    try:
        root = located_yaml.load(file, faults)
    except TaskFault as error:
        for fault in error.faults:
            faults.add(body.entries["source"].location, f"the machine cannot be read: {fault}")
        return None
    if not isinstance(root, Mapping):
        faults.add(root.location, f"a machine must be a mapping, found {kind_of(root)}")
        return None
    entries, keys = dict(root.entries), dict(root.keys)
    for key in own:
        if key == "params":
            entries[key] = _merge_params(root.entries.get(key), own.entries[key])
        elif key != "source":
            entries[key] = own.entries[key]
        keys.setdefault(key, own.keys[key])
    return Mapping(entries, keys, root.location)


def _merge_params(defaults: Node | None, params: Node) -> Node:
    if not isinstance(defaults, Mapping) or not isinstance(params, Mapping):
        return params
    return Mapping({**defaults.entries, **params.entries}, {**defaults.keys, **params.keys}, params.location)


@lru_cache(maxsize=64)
def machine_files(script: Path) -> tuple[Path, ...]:
    """Returns the files with machines that a task uses, also indirectly; unreadable files use none.

    The cache assumes that the files do not change while an experiment is read or run.

    Args:
        script: Path of the task.
    """
    files: dict[Path, None] = {}
    pending = [script]
    while pending:
        try:
            root = located_yaml.load(pending.pop(), FaultList())
        except TaskFault:
            continue
        bodies = (node for node in _nodes(root) if isinstance(node, Mapping))
        new = [file for body in bodies if (file := machine_file(body)) is not None and file not in files]
        files |= dict.fromkeys(new)
        pending += new
    return tuple(files)


@lru_cache(maxsize=64)
def task_texts(file: Path) -> tuple[tuple[str, ...], ...]:
    """Returns the texts in a task or a machine, such as the command of a policy; none if it is unreadable.

    Each list and each single value of a key is an entry.

    The cache makes the same assumption as the cache of `machine_files`.

    Args:
        file: Path of the task or machine.
    """
    try:
        root = located_yaml.load(file, FaultList())
    except TaskFault:
        return ()
    entries: list[tuple[Node, ...]] = []
    for node in _nodes(root):
        if isinstance(node, Sequence):
            entries.append(node.items)
        elif isinstance(node, Mapping):
            entries += [(value,) for value in node.entries.values()]
    return tuple(tuple(str(item.value) for item in items if isinstance(item, Scalar)) for items in entries)


def _nodes(node: Node) -> Iterator[Node]:
    """Yields a node and all nodes in it."""
    yield node
    match node:
        case Mapping(entries=entries):
            for value in entries.values():
                yield from _nodes(value)
        case Sequence(items=items):
            for item in items:
                yield from _nodes(item)
