# SPDX-License-Identifier: BSD-3-Clause
"""Builds the states of a task and checks their sources, options and outcomes."""

from __future__ import annotations

import keyword
from typing import Any

from modular_framework_core.files.faults import FaultList, SourceLocation
from modular_framework_core.files.located_yaml import Mapping, Node, Scalar
from modular_framework_core.state_api.constructor_keys import STATE_KEYS
from modular_framework_core.state_api.option_types import option_fault
from modular_framework_core.task_constructor import header_fields
from modular_framework_core.task_constructor.key_spelling import corrected_keys, intended_key, value_of
from modular_framework_core.task_constructor.params_scope import ParamsScope
from modular_framework_core.task_constructor.state_catalogue import StateCatalogue, StateSource, StateSourceError
from modular_framework_core.task_constructor.task_spec import StateSpec

_RESERVED = ("source", "transitions", "remapping", "params")
"""Keys of a state that are not options."""


def _is_argument(key: str) -> bool:
    """Returns whether a key can be passed to a constructor as a keyword argument."""
    return key.isidentifier() and not keyword.iskeyword(key) and key != "self"


class StateBuilder:
    """Builds the states of one task and collects their faults."""

    def __init__(self, states: StateCatalogue, faults: FaultList) -> None:
        """Stores the catalogue and the fault list."""
        self._states = states
        self._faults = faults
        self._imports_checked: set[str] = set()

    def with_known_keys(self, label: str, body: Mapping) -> Mapping:
        """Returns the fields of a state with known keys only. Unknown keys and a missing source add faults."""
        source = self._source_without_faults(value_of(body, "source"))
        if source is None:  # unknown options
            other_keys = [key for key in body.entries if key == "source" or intended_key(key, ["source"]) is None]
            body = corrected_keys(body, [*_RESERVED, *other_keys], f"state '{label}': key", self._faults)
        else:
            free = [key for key in body.entries if source.takes_any_option and _is_argument(key)]
            noun = f"state '{label}' ({source.name}): key"
            body = corrected_keys(body, [*_RESERVED, *source.options, *free], noun, self._faults)
        if "source" not in body.entries:
            self._faults.add(
                body.location, f"state '{label}' has no 'source'; add it: the name of a state's file, or of a template"
            )
        return body

    def _source_without_faults(self, node: Node | None) -> StateSource | None:
        """Returns the state that ``source`` names, or None, without a fault, if the state is unusable."""
        name = self._states.resolve(node.value) if isinstance(node, Scalar) and isinstance(node.value, str) else None
        try:
            return None if name is None else self._states.get(name)
        except StateSourceError:
            return None

    def build(
        self, label: str, location: SourceLocation, body: Mapping, scope: ParamsScope
    ) -> tuple[StateSpec | None, tuple[str, ...] | None]:
        """Builds and checks a state.

        Args:
            label: Name of the state.
            location: Position of the definition.
            body: Fields with references resolved.
            scope: Visible params, including the state's own.

        Returns:
            The state, or None if its source is unusable, and its outcomes, or None if unknown.
        """
        source = self._state_source(body, label)
        if source is None:
            return None, None
        own_options = {key: value for key, value in body.entries.items() if key not in _RESERVED}
        options = {**self._options_from_params(label, body, scope, source), **own_options}
        label_text = f"state '{label}' ({source.name}): option"
        faults_before = len(self._faults)
        self._check_imports(label, body, source)
        for option in source.options.values():
            if option.required and option.name not in options:
                self._faults.add(location, f"{label_text} '{option.name}' is missing; it has no default")
            elif option.name in options and option.name not in STATE_KEYS:
                fault = option_fault(option.type, options[option.name])
                if fault is not None:
                    self._faults.add(fault[0].location, f"{label_text} '{option.name}' {fault[1]}")
        self._faults.harmless += len(self._faults) - faults_before
        for key in STATE_KEYS:
            if key in options:
                may_be_empty = key != "outcomes"
                header_fields.names(options[key], f"state '{label}': {key}", self._faults, may_be_empty=may_be_empty)
        outcomes = self._state_outcomes(options, source)
        if "outcomes" in options and outcomes is not None and len(outcomes) < 2 and source.is_framework_state:
            self._faults.add(
                options["outcomes"].location,
                f"state '{label}': outcomes has only '{outcomes[0]}'; it "
                "needs at least two, the first for success and the last for failure, as [success, fail]",
            )
        values: dict[str, Any] = {key: value.plain() for key, value in options.items()}
        return (
            StateSpec(
                label=label,
                source=source,
                type=source.class_name,
                options=values,
                outcomes=outcomes or (),
                transitions=plain_transitions(body),
                location=location,
                remapping=plain_remapping(body),
                nodes=options,
            ),
            outcomes,
        )

    def _check_imports(self, label: str, body: Mapping, source: StateSource) -> None:
        """Adds a fault for each unresolved import of a source, once per source."""
        if source.name not in self._imports_checked:
            self._imports_checked.add(source.name)
            for missing in source.missing_imports:
                self._faults.add(body.entries["source"].location, f"state '{label}': {missing}")

    def _state_source(self, body: Mapping, label: str) -> StateSource | None:
        node = body.entries.get("source")
        name = None if node is None else header_fields.text(node, f"state '{label}': source", self._faults)
        if node is None or name is None:
            return None
        catalogue_name = self._states.resolve(name)
        if catalogue_name is None:
            self._faults.add_unknown(node.location, f"state '{label}': source", name, self._states.names())
            return None
        try:
            return self._states.get(catalogue_name)
        except StateSourceError as error:
            self._faults.add(node.location, f"state '{label}': {error}")
            return None

    def _options_from_params(
        self, label: str, body: Mapping, scope: ParamsScope, source: StateSource
    ) -> dict[str, Node]:
        """Returns the options given in a state's own params. Params that nothing uses add faults."""
        params = body.entries.get("params")
        if not isinstance(params, Mapping):
            return {}
        options: dict[str, Node] = {}
        for key, value in params.entries.items():
            if key in source.options or source.takes_any_option:
                options[key] = scope.resolve(value, FaultList())
            elif key not in scope.used:
                noun = f"state '{label}' ({source.name}): params: option"
                self._faults.add_unknown(params.keys[key], noun, key, source.options, used=body.entries)
        return options

    def _state_outcomes(self, options: dict[str, Node], source: StateSource) -> tuple[str, ...] | None:
        if "outcomes" in options and "outcomes" not in source.own_keys:
            return header_fields.names(options["outcomes"], "outcomes", FaultList())
        return source.default_names("outcomes") or None


def plain_remapping(body: Mapping) -> dict[str, str]:
    """Returns the remapping of a child, own key -> key of the enclosing machine; empty if unreadable."""
    return _plain_names(body.entries.get("remapping"))


def plain_transitions(body: Mapping) -> dict[str, str]:
    """Returns the transitions of a child, outcome -> target; empty if unreadable."""
    return _plain_names(body.entries.get("transitions"))


def _plain_names(node: Node | None) -> dict[str, str]:
    return {} if not isinstance(node, Mapping) else {key: str(value.plain()) for key, value in node.entries.items()}
