# SPDX-License-Identifier: BSD-3-Clause
"""Builds a ``TaskSpec`` from the YAML of a task and collects all faults before any code is generated."""

from __future__ import annotations

import builtins
from pathlib import Path

from modular_framework_core.files import located_yaml
from modular_framework_core.files.faults import FaultList, SourceLocation
from modular_framework_core.files.located_yaml import Mapping, Node, Scalar, Sequence, kind_of
from modular_framework_core.task_constructor import header_fields, machine_checks, userdata_checks
from modular_framework_core.task_constructor.key_spelling import intended_key, value_of
from modular_framework_core.task_constructor.known_names import KnownNames
from modular_framework_core.task_constructor.machine_checks import ChildLinks
from modular_framework_core.task_constructor.machine_files import machine_file, with_machine_file
from modular_framework_core.task_constructor.machine_header import HeaderReader
from modular_framework_core.task_constructor.machine_keys import UNREAD, root_keys
from modular_framework_core.task_constructor.option_use_checks import check_uses
from modular_framework_core.task_constructor.params_scope import ParamsScope, params_of
from modular_framework_core.task_constructor.state_builder import StateBuilder, plain_remapping, plain_transitions
from modular_framework_core.task_constructor.state_catalogue import StateCatalogue, class_name_of
from modular_framework_core.task_constructor.task_spec import ChildSpec, MachineSpec, TaskSpec
from modular_framework_core.task_constructor.template_catalogue import TemplateCatalogue


def load_task(
    script: Path, states: StateCatalogue, templates: TemplateCatalogue, known: KnownNames | None = None
) -> TaskSpec:
    """Reads and checks a task.

    Args:
        script: Path of the task's YAML file.
        states: Available states.
        templates: Available templates.
        known: Known names of messages, postures and planning groups.

    Raises:
        TaskFault: The task has faults; the exception carries all of them.
    """
    faults = FaultList()
    document = located_yaml.load(script, faults)
    return TaskBuilder(states, templates, faults, known).build(document, str(script))


class TaskBuilder:
    """Builds one task from its YAML, outermost machine first."""

    def __init__(
        self, states: StateCatalogue, templates: TemplateCatalogue, faults: FaultList, known: KnownNames | None = None
    ) -> None:
        """Stores the catalogues.

        Args:
            states: Available states.
            templates: Available templates.
            faults: Receives all faults.
            known: Known names of messages, postures and planning groups.
        """
        self._templates = templates
        self._faults = faults
        self._known = known or KnownNames()
        self._headers = HeaderReader(states, templates, faults)
        self._state_builder = StateBuilder(states, faults)
        self._open_files: list[Path] = []
        self._used_type_names = {class_name_of(name) for name in states.names()} | set(dir(builtins))

    def build(self, document: Node, script: str) -> TaskSpec:
        """Returns the task, or raises ``TaskFault`` with all faults."""
        if not isinstance(document, Mapping):
            self._faults.add(
                document.location,
                f"a task must be a mapping, found {kind_of(document)}; its keys: {', '.join(root_keys())}",
            )
            self._faults.raise_if_any()
        assert isinstance(document, Mapping)
        self._faults.harmless = len(self._faults)
        scope = ParamsScope().inner(params_of(value_of(document, "params"), self._faults), self._faults)
        name = "task"
        name_node = value_of(document, "name")
        label = str(name_node.value) if isinstance(name_node, Scalar) else name
        header = self._headers.with_known_keys(
            self._resolve_references(document, scope, is_machine=True), label, is_root=True
        )
        if "name" in header.entries:
            name = header_fields.identifier(header.entries["name"], "name", self._faults) or name
        node_name = name
        if "node_name" in header.entries:
            node_name = header_fields.node_name(header.entries["node_name"], self._faults) or name
        root = self._machine(name, header, scope, None)
        external = self._headers.external_names(header)
        if root is not None:
            complete = len(self._faults) == self._faults.harmless
            check_uses(root, self._known.with_names(external), self._faults, complete=complete)
            if complete:
                userdata_checks.check_userdata(root, self._provided_by(), self._faults)
        self._faults.raise_if_any()
        assert root is not None, "a machine that cannot be built adds a fault"
        return TaskSpec(name, node_name, script, root, external)

    # ---- machines ------------------------------------------------------------------------------------------
    def _machine(self, label: str, header: Mapping, scope: ParamsScope, parent: str | None) -> MachineSpec | None:
        """Builds a machine from its header.

        Args:
            label: Name in the enclosing machine.
            header: Header fields with references resolved.
            scope: Params visible inside the machine.
            parent: Class name of the enclosing machine; None for the root.
        """
        headers = self._headers
        template = headers.template(header, label)
        known_outcomes = headers.outcomes(header)
        outcomes = known_outcomes or ()
        type_name = self._unique_type(header, label, parent)
        entries, labels = self._child_entries(header)
        children, links = self._children(entries, scope, type_name, outcomes)
        initial_state = headers.initial_state(header, labels)
        if template is None:
            return None
        outcomes_location = headers.location_of(header, "outcomes")
        faults_before = len(self._faults)
        if template.concurrent:
            machine_checks.check_concurrent(links, self._faults)
        else:
            first = [initial_state] if initial_state else labels[:1]
            machine = machine_checks.MachineLinks(
                children=links, labels=labels, first=first, outcomes=known_outcomes, location=outcomes_location
            )
            machine_checks.check_sequential(machine, self._faults)
        faults_before_map = len(self._faults)
        default_outcome = headers.default_outcome(header, template, outcomes)
        outcome_map = headers.outcome_map(header, template, outcomes, links)
        if template.concurrent and known_outcomes and links and len(self._faults) == faults_before_map:
            machine_checks.check_outcomes_produced(
                outcomes, {*outcome_map, default_outcome}, outcomes_location, self._faults
            )
        self._faults.harmless += len(self._faults) - faults_before
        return MachineSpec(
            label=label,
            template=template,
            type=type_name,
            outcomes=outcomes,
            states=tuple(children),
            transitions=plain_transitions(header),
            remapping=plain_remapping(header),
            shares_userdata=headers.shares_userdata(header),
            default_outcome=default_outcome,
            outcome_map=outcome_map,
            input_keys=headers.key_names(header, "input_keys"),
            output_keys=headers.key_names(header, "output_keys"),
            initial_state=initial_state,
            options={key: header.entries[key].plain() for key in template.options if key in header.entries},
            location=header.location,
        )

    def _resolve_references(self, node: Mapping, scope: ParamsScope, *, is_machine: bool) -> Mapping:
        """Resolves the references of a header or state, except in ``UNREAD`` keys."""
        unread = {key for key in node.entries if key in UNREAD or (is_machine and intended_key(key, UNREAD))}
        entries = {
            key: value if key in unread else scope.resolve(value, self._faults) for key, value in node.entries.items()
        }
        return Mapping(entries, node.keys, node.location)

    def _unique_type(self, header: Mapping, label: str, parent_type: str | None) -> str:
        """Returns a class name that no state and no other machine of the task uses."""
        base = label
        if parent_type is not None and "name" in header.entries:
            base = header_fields.identifier(header.entries["name"], "name", self._faults) or label
        words = base.replace("-", "_").split("_")
        camel_case = "".join(word[:1].upper() + word[1:] for word in words) or "Machine"
        candidate = camel_case
        if candidate in self._used_type_names and parent_type is not None:
            candidate = parent_type + camel_case
        suffix = 2
        while candidate in self._used_type_names:
            candidate, suffix = f"{camel_case}{suffix}", suffix + 1
        self._used_type_names.add(candidate)
        return candidate

    # ---- children ------------------------------------------------------------------------------------------
    def _children(
        self,
        entries: list[tuple[str, SourceLocation, Mapping]],
        scope: ParamsScope,
        parent_type: str,
        outcomes: tuple[str, ...],
    ) -> tuple[list[ChildSpec], list[ChildLinks]]:
        specs: list[ChildSpec] = []
        links: list[ChildLinks] = []
        first_lines: dict[str, int] = {}
        for label, location, body in entries:
            header_fields.label(label, location, self._faults)
            if label in outcomes:
                self._faults.add(location, f"the label '{label}' is also an outcome of the machine; rename one of them")
            spec, link = self._child(label, location, body, scope, parent_type)
            if label in first_lines:
                self._faults.add(location, f"the label '{label}' is given twice; first in line {first_lines[label]}")
                continue
            first_lines[label] = location.line
            links.append(link)
            if spec is not None:
                specs.append(spec)
        return specs, links

    def _child_entries(self, header: Mapping) -> tuple[list[tuple[str, SourceLocation, Mapping]], list[str]]:
        """Returns (label, location, fields) of each readable entry of ``states``, and the labels of all entries."""
        node = header.entries.get("states")
        if node is None:
            return [], []
        if not isinstance(node, Sequence) or not node.items:
            kind = "an empty list" if isinstance(node, Sequence) else kind_of(node)
            self._faults.add(node.location, f"states must be a list of '- Label: {{source: ...}}', found {kind}")
            return [], []
        entries: list[tuple[str, SourceLocation, Mapping]] = []
        labels: list[str] = []
        for item in node.items:
            if not isinstance(item, Mapping):
                self._faults.add(item.location, f"a state must be '- Label: {{source: ...}}', found {kind_of(item)}")
                continue
            if len(item.entries) != 1:
                self._faults.add(
                    item.location,
                    f"one entry of states has the labels {', '.join(item.entries)}; each state needs its own '-', "
                    "and its options are indented below the label",
                )
            for label, body in item.entries.items():
                labels.append(label)
                if isinstance(body, Mapping) and (len(item.entries) == 1 or "source" in body.entries):
                    entries.append((label, item.keys[label], body))
                elif len(item.entries) == 1:
                    message = f"state '{label}' must be a mapping with 'source', found {kind_of(body)}"
                    self._faults.add(item.keys[label], message)
        return entries, labels

    def _child(
        self, label: str, location: SourceLocation, body: Mapping, outer_scope: ParamsScope, parent_type: str
    ) -> tuple[ChildSpec | None, ChildLinks]:
        file = machine_file(body)
        if file is None:
            return self._own_child(label, location, body, outer_scope, parent_type)
        complete = None
        if file in self._open_files:
            self._faults.add(body.entries["source"].location, f"the machine of {file.name} contains itself")
        else:
            complete = with_machine_file(label, body, file, self._faults)
        if complete is None:
            return None, ChildLinks(label, None, None, {}, location)
        self._open_files.append(file)
        try:
            return self._own_child(label, location, complete, outer_scope, parent_type)
        finally:
            self._open_files.pop()

    def _own_child(
        self, label: str, location: SourceLocation, body: Mapping, outer_scope: ParamsScope, parent_type: str
    ) -> tuple[ChildSpec | None, ChildLinks]:
        is_machine = "states" in body.entries or bool(self._headers.template_named(value_of(body, "source")))
        params = value_of(body, "params") if is_machine else body.entries.get("params")
        scope = outer_scope.inner(params_of(params, self._faults), self._faults)
        body = self._resolve_references(body, scope, is_machine=is_machine)
        spec: ChildSpec | None
        outcomes: tuple[str, ...] | None
        if is_machine or self._headers.template_named(value_of(body, "source")):
            body = self._headers.with_known_keys(body, label, is_root=False)
            spec = self._machine(label, body, scope, parent_type)
            outcomes = None if spec is None else spec.outcomes
        else:
            body = self._state_builder.with_known_keys(label, body)
            spec, outcomes = self._state_builder.build(label, location, body, scope)
        if spec is not None:
            userdata_checks.check_remapping(spec, body.entries.get("remapping"), self._faults)
        transitions: dict[str, Scalar] | None = {}
        keys: dict[str, SourceLocation] = {}
        node = body.entries.get("transitions")
        if node is not None:
            transitions = header_fields.name_map(node, f"state '{label}': transitions", self._faults)
            keys = node.keys if isinstance(node, Mapping) else {}
        return spec, ChildLinks(label, outcomes, transitions, keys, location)

    def _provided_by(self) -> dict[str, str]:
        """Returns userdata key -> name of the template that provides the key."""
        providers: dict[str, str] = {}
        for name in self._templates.names():
            template = self._templates.get(name)
            for key in (template.userdata or ()) if template else ():
                providers.setdefault(key, name)
        return providers
