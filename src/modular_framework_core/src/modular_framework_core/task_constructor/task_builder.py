# SPDX-License-Identifier: BSD-3-Clause
"""Turns the YAML of a task into a ``TaskSpec``; finds everything that is wrong with it before anything is generated."""
from __future__ import annotations

import builtins
from collections.abc import Iterable
from pathlib import Path

from modular_framework_core.task_constructor import header_fields, located_yaml, machine_checks
from modular_framework_core.task_constructor.faults import FaultList, Place, listing, nearest
from modular_framework_core.task_constructor.located_yaml import Mapping, Node, Scalar, Sequence, kind_of
from modular_framework_core.task_constructor.machine_checks import ChildLinks
from modular_framework_core.task_constructor.machine_keys import (
    SHARED_USERDATA,
    machine_keys,
    required_keys,
    root_keys,
)
from modular_framework_core.task_constructor.params_scope import ParamsScope, params_of
from modular_framework_core.task_constructor.state_builder import StateBuilder, plain_transitions
from modular_framework_core.task_constructor.state_catalogue import StateCatalogue, class_name_of
from modular_framework_core.task_constructor.task_spec import ChildSpec, MachineSpec, TaskSpec
from modular_framework_core.task_constructor.template_catalogue import TemplateCatalogue, TemplateSource

DEFAULT_OUTCOMES = ("success", "fail")


def load_task(script: Path, states: StateCatalogue, templates: TemplateCatalogue) -> TaskSpec:
    """Read and check a task.

    Args:
        script: the YAML file.
        states: the states it may use.
        templates: the templates its machines may be written with.

    Raises:
        TaskFault: something is wrong with it; carries all faults.
    """
    return TaskBuilder(states, templates).build(located_yaml.load(script), str(script))


class TaskBuilder:
    """Walks through the YAML of one task, outermost machine first."""

    def __init__(self, states: StateCatalogue, templates: TemplateCatalogue) -> None:
        """Use these states and templates."""
        self._states = states
        self._templates = templates
        self._faults = FaultList()
        self._link_faults = 0
        self._state_builder = StateBuilder(states, templates, self._faults)
        self._taken = {class_name_of(name) for name in states.names()} | set(dir(builtins))

    def build(self, document: Node, script: str) -> TaskSpec:
        """Return the task; raise ``TaskFault`` with everything that is wrong."""
        if not isinstance(document, Mapping):
            self._faults.add(document.place, f"a task must be a mapping, found {kind_of(document)}; its keys: "
                                             f"{', '.join(root_keys())}")
            self._faults.raise_if_any()
        assert isinstance(document, Mapping)
        scope = ParamsScope().inner(params_of(document.entries.get("params"), self._faults), self._faults)
        header = self._resolved_header(document, scope)
        self._require(header, required_keys(is_root=True), "the task")
        name = "task"
        if "name" in header.entries:
            name = header_fields.identifier(header.entries["name"], "name", self._faults) or name
        node = name
        if "node_name" in header.entries:
            node = header_fields.node_name(header.entries["node_name"], self._faults) or name
        root = self._machine(name, header, scope, None)
        if root is not None and len(self._faults) == self._link_faults + self._state_builder.value_faults:
            machine_checks.check_userdata(root, self._provided_by(), self._faults)
        self._faults.raise_if_any()
        assert root is not None, "a machine that could not be built has left a fault"
        return TaskSpec(name, node, script, root)

    # ---- machines ------------------------------------------------------------------------------------------
    def _machine(
        self, label: str, header: Mapping, scope: ParamsScope, parent: str | None
    ) -> MachineSpec | None:
        """Build a machine from its header, whose references are resolved; ``parent`` is the class name around it."""
        template = self._template(header, label)
        known_outcomes = self._outcomes(header)
        outcomes = known_outcomes or ()
        type_name = self._unique_type(header, label, parent)
        entries, labels = self._child_entries(header)
        children, links = self._children(entries, scope, type_name, outcomes)
        if template is None:
            return None
        self._check_header_keys(header, template, is_root=parent is None, label=label)
        outcomes_place = header.entries["outcomes"].place if "outcomes" in header.entries else header.place
        before_links = len(self._faults)
        if template.concurrent:
            machine_checks.check_concurrent(links, self._faults)
        else:
            machine_checks.check_sequential(links, labels, known_outcomes, outcomes_place, self._faults)
        before = len(self._faults)
        default_outcome = self._default_outcome(header, template, outcomes)
        outcome_map = self._outcome_map(header, template, outcomes, links)
        if template.concurrent and known_outcomes and links and len(self._faults) == before:
            machine_checks.check_outcomes_produced(outcomes, {*outcome_map, default_outcome}, outcomes_place,
                                                   self._faults)
        self._link_faults += len(self._faults) - before_links
        return MachineSpec(
            label=label,
            template=template,
            type=type_name,
            outcomes=outcomes,
            states=tuple(children),
            transitions=plain_transitions(header),
            shares_userdata=self._shares_userdata(header),
            default_outcome=default_outcome,
            outcome_map=outcome_map,
            input_keys=self._key_names(header, "input_keys"),
            output_keys=self._key_names(header, "output_keys"),
            options={key: header.entries[key].plain() for key in template.options if key in header.entries},
            place=header.place,
        )

    def _resolved_header(self, node: Mapping, scope: ParamsScope) -> Mapping:
        """Resolve the references of a header, leaving ``params`` and ``states`` for later."""
        entries = {
            key: value if key in ("params", "states") else scope.resolve(value, self._faults)
            for key, value in node.entries.items()
        }
        return Mapping(entries, node.keys, node.place)

    def _require(self, node: Mapping, keys: Iterable[str], what: str) -> None:
        for key in keys:
            if key not in node.entries:
                self._faults.add(node.place, f"{what} has no '{key}'{nearest(key, set(node.entries))}")

    def _template(self, header: Mapping, label: str) -> TemplateSource | None:
        if "source" not in header.entries:
            return None
        node = header.entries["source"]
        name = header_fields.text(node, "source", self._faults)
        if name is None:
            return None
        template = self._templates.get(name)
        if template is None and self._states.resolve(name) is not None:
            self._faults.add(node.place, f"'{label}' contains states, but its source '{name}' is a state; "
                                         f"{listing(self._templates.names())}")
        elif template is None:
            self._faults.add_unknown(node.place, "template", name, self._templates.names())
        return template

    def _outcomes(self, header: Mapping) -> tuple[str, ...] | None:
        """Return the outcomes of a machine; None when they are there and wrong."""
        if "outcomes" not in header.entries:
            return DEFAULT_OUTCOMES
        return header_fields.names(header.entries["outcomes"], "outcomes", self._faults)

    def _unique_type(self, header: Mapping, label: str, parent_type: str | None) -> str:
        """Return a class name no other machine and no state of the task has."""
        base = label
        if parent_type is not None and "name" in header.entries:
            base = header_fields.identifier(header.entries["name"], "name", self._faults) or label
        words = base.replace("-", "_").split("_")
        wanted = "".join(word[:1].upper() + word[1:] for word in words) or "Machine"
        candidate = wanted
        if candidate in self._taken and parent_type is not None:
            candidate = parent_type + wanted
        number = 2
        while candidate in self._taken:
            candidate, number = f"{wanted}{number}", number + 1
        self._taken.add(candidate)
        return candidate

    def _check_header_keys(self, header: Mapping, template: TemplateSource, *, is_root: bool, label: str) -> None:
        known = [key.name for key in machine_keys(template) if (key.at_root if is_root else key.nested)]
        for key in header.entries:
            if key not in known:
                what = f"'{label}' (template {template.name}): key"
                self._faults.add_unknown(header.keys[key], what, key, known)

    def _shares_userdata(self, header: Mapping) -> bool:
        node = header.entries.get("userdata")
        if node is None:
            return False
        if isinstance(node, Scalar) and node.value == SHARED_USERDATA:
            return True
        self._faults.add(node.place, f"userdata can only be {SHARED_USERDATA}, found {kind_of(node)}")
        return False

    def _default_outcome(
        self, header: Mapping, template: TemplateSource, outcomes: tuple[str, ...]
    ) -> str | None:
        node = header.entries.get("default_outcome")
        if not template.concurrent or not outcomes:
            return None
        if node is None:
            return outcomes[-1]
        name = header_fields.text(node, "default_outcome", self._faults)
        if name is not None and name not in outcomes:
            self._faults.add_unknown(node.place, "default_outcome", name, outcomes)
        return name

    def _outcome_map(
        self, header: Mapping, template: TemplateSource, outcomes: tuple[str, ...], links: list[ChildLinks]
    ) -> dict[str, dict[str, str]]:
        node = header.entries.get("outcome_map")
        if not template.concurrent or node is None or not outcomes:
            return {}
        return machine_checks.check_outcome_map(node, outcomes, links, self._faults)

    def _key_names(self, header: Mapping, key: str) -> tuple[str, ...]:
        if key not in header.entries:
            return ()
        return header_fields.names(header.entries[key], key, self._faults, may_be_empty=True) or ()

    # ---- children ------------------------------------------------------------------------------------------
    def _children(
        self, entries: list[tuple[str, Place, Mapping]], scope: ParamsScope, parent_type: str, outcomes: tuple[str, ...]
    ) -> tuple[list[ChildSpec], list[ChildLinks]]:
        specs: list[ChildSpec] = []
        links: list[ChildLinks] = []
        first_lines: dict[str, int] = {}
        for label, place, body in entries:
            header_fields.label(label, place, self._faults)
            if label in outcomes:
                self._faults.add(place, f"the label '{label}' is also an outcome of the machine; rename one of them")
            spec, link = self._child(label, place, body, scope, parent_type)
            if label in first_lines:
                self._faults.add(place, f"the label '{label}' is given twice; first in line {first_lines[label]}")
                continue
            first_lines[label] = place.line
            links.append(link)
            if spec is not None:
                specs.append(spec)
        return specs, links

    def _child_entries(self, header: Mapping) -> tuple[list[tuple[str, Place, Mapping]], list[str]]:
        """Return label, place and content of each entry of ``states`` that can be read, and the labels of all."""
        node = header.entries.get("states")
        if node is None:
            return [], []
        if not isinstance(node, Sequence) or not node.items:
            found = "an empty list" if isinstance(node, Sequence) else kind_of(node)
            self._faults.add(node.place, f"states must be a list of '- Label: {{source: ...}}', found {found}")
            return [], []
        entries: list[tuple[str, Place, Mapping]] = []
        labels: list[str] = []
        for item in node.items:
            if not isinstance(item, Mapping):
                self._faults.add(item.place, f"a state must be '- Label: {{source: ...}}', found {kind_of(item)}")
                continue
            if len(item.entries) != 1:
                self._faults.add(
                    item.place,
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
        self, label: str, place: Place, body: Mapping, outer: ParamsScope, parent_type: str
    ) -> tuple[ChildSpec | None, ChildLinks]:
        scope = outer.inner(params_of(body.entries.get("params"), self._faults), self._faults)
        body = self._resolved_header(body, scope)
        self._require(body, ("source",), f"state '{label}'")
        spec: ChildSpec | None
        outcomes: tuple[str, ...] | None
        if "states" in body.entries:
            spec = self._machine(label, body, scope, parent_type)
            outcomes = None if spec is None else spec.outcomes
        else:
            spec, outcomes = self._state_builder.build(label, place, body, scope)
        transitions: dict[str, Scalar] | None = {}
        keys: dict[str, Place] = {}
        node = body.entries.get("transitions")
        if node is not None:
            transitions = header_fields.name_map(node, f"state '{label}': transitions", self._faults)
            keys = node.keys if isinstance(node, Mapping) else {}
        return spec, ChildLinks(label, outcomes, transitions, keys, place)

    def _provided_by(self) -> dict[str, str]:
        """Return userdata key -> template that provides it."""
        found: dict[str, str] = {}
        for name in self._templates.names():
            template = self._templates.get(name)
            for key in (template.userdata or ()) if template else ():
                found.setdefault(key, name)
        return found
