# SPDX-License-Identifier: BSD-3-Clause
"""Reads and checks the fields of a machine's header."""

from __future__ import annotations

from modular_framework_core.files.faults import FaultList, SourceLocation
from modular_framework_core.files.located_yaml import Mapping, Node, Scalar, kind_of
from modular_framework_core.task_constructor import header_fields, machine_checks
from modular_framework_core.task_constructor.key_spelling import corrected_keys, value_of
from modular_framework_core.task_constructor.known_names import MODEL, OBJECT_TYPE
from modular_framework_core.task_constructor.machine_checks import ChildLinks
from modular_framework_core.task_constructor.machine_keys import SHARED_USERDATA, machine_keys, required_keys
from modular_framework_core.task_constructor.state_catalogue import StateCatalogue
from modular_framework_core.task_constructor.template_catalogue import TemplateCatalogue, TemplateSource
from modular_framework_ros.allowed_names import listing

DEFAULT_OUTCOMES = ("success", "fail")
EXTERNAL_KINDS = ("joint_state", "trajectory", "pose", "robot_pose", "plan", "grasp", MODEL, OBJECT_TYPE)


class HeaderReader:
    """Reads the headers of the machines of one task."""

    def __init__(self, states: StateCatalogue, templates: TemplateCatalogue, faults: FaultList) -> None:
        """Stores the catalogues.

        Args:
            states: Available states, to distinguish a state from a misspelt template.
            templates: Available templates.
            faults: Receives all faults.
        """
        self._states = states
        self._templates = templates
        self._faults = faults

    def with_known_keys(self, header: Mapping, label: str, *, is_root: bool) -> Mapping:
        """Returns a header with known keys only. Unknown keys and missing required keys add faults.

        Args:
            header: Header as written.
            label: Name of the machine, for messages.
            is_root: Whether the header is the task's.
        """
        template = self.template_named(value_of(header, "source"))
        templates = self._all_templates() if template is None else [template]
        known = list(
            dict.fromkeys(
                key.name for item in templates for key in machine_keys(item) if (key.at_root if is_root else key.nested)
            )
        )
        machine_label = f"'{label}' (template {template.name})" if template else f"'{label}'"
        corrected = corrected_keys(header, known, f"{machine_label}: key", self._faults)
        for key in required_keys(is_root=is_root):
            if key.name not in corrected.entries:
                owner = "the task" if is_root else f"machine {machine_label}"
                self._faults.add(header.location, f"{owner} has no '{key.name}'; add it: {key.form}")
        return corrected

    def template_named(self, node: Node | None) -> TemplateSource | None:
        """Returns the template that ``source`` names, or None, without a fault."""
        return self._templates.get(node.value) if isinstance(node, Scalar) and isinstance(node.value, str) else None

    def template(self, header: Mapping, label: str) -> TemplateSource | None:
        """Returns the template of a machine."""
        node = header.entries.get("source")
        name = None if node is None else header_fields.text(node, "source", self._faults)
        if node is None or name is None:
            return None
        template = self._templates.get(name)
        if template is None and self._states.resolve(name) is not None:
            self._faults.add(
                node.location,
                f"'{label}' contains states, but its source '{name}' is a state; {listing(self._templates.names())}",
            )
        elif template is None:
            self._faults.add_unknown(node.location, "template", name, self._templates.names())
        elif template.fault:
            self._faults.add(node.location, f"'{label}': the template '{name}' cannot be used: {template.fault}")
        return template

    def outcomes(self, header: Mapping) -> tuple[str, ...] | None:
        """Returns the outcomes of a machine, by default ``DEFAULT_OUTCOMES``; None if invalid."""
        if "outcomes" not in header.entries:
            return DEFAULT_OUTCOMES
        return header_fields.names(header.entries["outcomes"], "outcomes", self._faults)

    def shares_userdata(self, header: Mapping) -> bool:
        """Returns whether a machine uses the enclosing machine's userdata."""
        node = header.entries.get("userdata")
        if node is None:
            return False
        if isinstance(node, Scalar) and node.value == SHARED_USERDATA:
            return True
        self._faults.add(node.location, f"userdata can only be {SHARED_USERDATA}, found {kind_of(node)}")
        return False

    def default_outcome(self, header: Mapping, template: TemplateSource, outcomes: tuple[str, ...]) -> str | None:
        """Returns the default outcome of a concurrence, or None for a sequential machine.

        Args:
            header: Header of the machine.
            template: Template of the machine.
            outcomes: Outcomes of the machine.
        """
        node = header.entries.get("default_outcome")
        if not template.concurrent or not outcomes:
            return None
        if node is None:
            return outcomes[-1]
        name = header_fields.text(node, "default_outcome", self._faults)
        if name is not None and name not in outcomes:
            self._faults.add_unknown(node.location, "default_outcome", name, outcomes)
        return name

    def outcome_map(
        self, header: Mapping, template: TemplateSource, outcomes: tuple[str, ...], links: list[ChildLinks]
    ) -> dict[str, dict[str, str]]:
        """Returns the outcome map of a concurrence, or an empty map for a sequential machine.

        Args:
            header: Header of the machine.
            template: Template of the machine.
            outcomes: Outcomes of the machine.
            links: Labels and outcomes of the children.
        """
        node = header.entries.get("outcome_map")
        if not template.concurrent or node is None or not outcomes:
            return {}
        return machine_checks.check_outcome_map(node, outcomes, links, self._faults)

    def key_names(self, header: Mapping, key: str) -> tuple[str, ...]:
        """Returns the userdata keys listed under a header key."""
        if key not in header.entries:
            return ()
        return header_fields.names(header.entries[key], key, self._faults, may_be_empty=True) or ()

    def initial_state(self, header: Mapping, labels: list[str]) -> str:
        """Returns the label of the initial state; "" for the first child."""
        node = header.entries.get("initial_state")
        name = None if node is None else header_fields.text(node, "initial_state", self._faults)
        if node is None or name is None:
            return ""
        if name not in labels:
            self._faults.add_unknown(node.location, "initial_state", name, labels)
            return ""
        return name

    def external_names(self, header: Mapping) -> dict[str, frozenset[str]]:
        """Returns the names that other nodes store in the managers, kind of message -> names."""
        node = header.entries.get("external_names")
        if node is None:
            return {}
        if not isinstance(node, Mapping):
            self._faults.add(
                node.location, f"external_names must be a mapping such as {{plan: [homing]}}, found {kind_of(node)}"
            )
            return {}
        corrected = corrected_keys(node, EXTERNAL_KINDS, "external_names: kind", self._faults)
        names_by_kind = {
            kind: header_fields.names(
                value, f"external_names: {kind}", self._faults, may_be_empty=True, example="[homing]"
            )
            for kind, value in corrected.entries.items()
        }
        return {kind: frozenset(names or ()) for kind, names in names_by_kind.items()}

    def location_of(self, header: Mapping, key: str) -> SourceLocation:
        """Returns the location of a key's value, or of the header if the key is missing."""
        return header.entries[key].location if key in header.entries else header.location

    def _all_templates(self) -> list[TemplateSource]:
        templates = (self._templates.get(name) for name in self._templates.names())
        return [template for template in templates if template is not None]
