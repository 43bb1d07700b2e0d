# SPDX-License-Identifier: BSD-3-Clause
"""Reads regions, success criteria and milestones of an experiment file."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from collections.abc import Mapping as Map
from dataclasses import MISSING, Field, dataclass, field
from typing import Any

from modular_framework_benchmark.experiments.reading import ValueReading
from modular_framework_benchmark.experiments.success_criteria import SuccessCriteria
from modular_framework_benchmark.predicates import predicate as predicates
from modular_framework_benchmark.predicates.conditions import (
    CONDITIONS,
    OLD_ON_TOP_OF,
    ON_TOP_OF,
    Collected,
    JointAtLeast,
    Region,
    Span,
    Stacked,
)
from modular_framework_benchmark.predicates.contradictions import contradiction, repetition
from modular_framework_benchmark.predicates.predicate import Condition, Predicate
from modular_framework_benchmark.predicates.predicate_keys import KeyKind, PredicateKey, keys_of
from modular_framework_benchmark.predicates.progress import Milestone
from modular_framework_core.files.located_yaml import Mapping, Node, Scalar
from modular_framework_core.task_constructor.key_spelling import corrected_keys, renamed_key

COMBINATIONS: dict[str, Callable[[tuple[Predicate, ...]], Predicate]] = {
    "all": predicates.All,
    "any": predicates.Any,
    "in_order": predicates.InOrder,
}
PREDICATES = (*CONDITIONS, *COMBINATIONS, "not")
SHORT_FORM = {"lifted": 10.0, "hold_time": 3600.0, "shake": 3600.0}
"""Numbers of the short form of `success`, with their largest values."""
MILESTONE_KEYS = ("name", "weight")
EXAMPLE = "{on_top_of: {support: table}}"
MAX_M = 1000.0


@dataclass(frozen=True, slots=True)
class KnownNames:
    """Names that predicates may use.

    Attributes:
        objects: Names of the objects of the experiment, in order.
        models: Names of the models of the world; None if unknown, and then no name is checked.
        joints: Names of the movable joints of models and objects, keyed by model; unknown models have no entry.
        regions: Regions by name.
    """

    objects: tuple[str, ...] = ()
    models: Collection[str] | None = None
    joints: Map[str, Collection[str]] = field(default_factory=dict)
    regions: Map[str, Region] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class PredicateReading:
    """Reader of predicates.

    Attributes:
        reading: Reader that collects faults.
        names: Names that predicates may use.
    """

    reading: ValueReading
    names: KnownNames

    def success(self, node: Node, key: str) -> SuccessCriteria | None:
        """Returns the success criteria, or None after a fault.

        Args:
            node: Value in the file.
            key: Name of the key, for faults.
        """
        mapping = self.reading.mapping(node, key, "{lifted: 0.10, hold_time: 2.0}")
        if mapping is None:
            return None
        known_keys = (*SHORT_FORM, "object", *PREDICATES)
        node = self._corrected_keys(mapping, known_keys, f"the key of {key}")
        short = {name: node.entries[name] for name in SHORT_FORM if isinstance(node.entries.get(name), Scalar)}
        short_form_values: dict[str, Any] = {
            name: self.reading.number(value, name, 0.0, SHORT_FORM[name]) for name, value in short.items()
        }
        if "object" in node.entries:
            short_form_values["object"] = self._model(node.entries["object"], f"the object of {key}", KeyKind.OBJECT)
        predicate_names = [name for name in node.entries if name not in short_form_values]
        if predicate_names:
            short_form_values["required"] = self._conjunction(_selected_entries(node, predicate_names), key)
        criteria = SuccessCriteria(**short_form_values)
        if criteria.is_pick and not self.names.objects and criteria.object is None and self.names.models is not None:
            text = f"{key} names no object, and objects is empty; add an object there, or name one in {key}"
            self.reading.faults.add(node.location, text)
        return criteria

    def progress(self, node: Node, key: str) -> tuple[Milestone, ...] | None:
        """Returns the milestones in their order, or None after a fault.

        Args:
            node: Value in the file.
            key: Name of the key, for faults.
        """
        items = self.reading.items(node, key, "[{held_for: {}}, {lifted: {height: 0.1}, weight: 2}]")
        found = [self._milestone(item, key) for item in items or ()]
        milestones = tuple(each for each in found if each is not None)
        if items is None or len(milestones) < len(found):
            return None
        names = [milestone.name for milestone in milestones]
        for index, name in enumerate(names):
            if name in names[:index]:
                text = f"two milestones have the name '{name}'; give one of them another name"
                self.reading.faults.add(items[index].location, text)
        if not any(milestone.weight > 0.0 for milestone in milestones):
            self.reading.faults.add(node.location, f"every weight of {key} is 0; make one of them greater")
        index, before = repetition(milestones)
        if before:
            text = f"milestone '{names[index]}' is always reached together with '{before}'; remove one of them"
            self.reading.faults.add(items[index].location, text)
        return milestones

    def _milestone(self, item: Node, key: str) -> Milestone | None:
        mapping = self.reading.mapping(item, f"each of {key}", EXAMPLE)
        if mapping is None:
            return None
        node = self._corrected_keys(mapping, (*MILESTONE_KEYS, *PREDICATES), "the key of a milestone")
        predicate_names = [name for name in node.entries if name not in MILESTONE_KEYS]
        predicate = self._conjunction(_selected_entries(node, predicate_names), f"a milestone of {key}")
        weight = self.reading.number(node.entries["weight"], "weight", 0.0, 1e6) if "weight" in node.entries else 1.0
        name = (
            self.reading.name(node.entries["name"], "name") if "name" in node.entries else "_and_".join(predicate_names)
        )
        if predicate is None or weight is None or name is None:
            return None
        return Milestone(name=name, predicate=predicate, weight=weight)

    def _conjunction(self, node: Mapping, what: str) -> Predicate | None:
        """Returns the predicate that all predicates of a mapping hold, checked for contradictions."""
        parts = [self._predicate(name, node) for name in node.entries]
        if not parts:
            allowed = ", ".join(PREDICATES)
            self.reading.faults.add(node.location, f"{what} has no predicate; add one, such as {EXAMPLE}: {allowed}")
        known_parts = tuple(part for part in parts if part is not None)
        if not parts or len(known_parts) < len(parts):
            return None
        conjunction = known_parts[0] if len(known_parts) == 1 else predicates.All(known_parts)
        if text := contradiction(conjunction):
            self.reading.faults.add(node.location, f"{what} contradicts itself: {text}")
        return conjunction

    def _predicate(self, name: str, node: Mapping) -> Predicate | None:
        value = node.entries[name]
        if name in CONDITIONS:
            return self._condition(name, value)
        if name == "not":
            part = self._nested_predicate(value, name)
            return None if part is None else predicates.Not(part)
        items = self.reading.items(value, name, f"[{EXAMPLE}, ...]")
        parts = [self._nested_predicate(item, name) for item in items or ()]
        known_parts = tuple(part for part in parts if part is not None)
        return COMBINATIONS[name](known_parts) if known_parts and len(known_parts) == len(parts) else None

    def _nested_predicate(self, item: Node, name: str) -> Predicate | None:
        mapping = self.reading.mapping(item, f"a predicate of {name}", EXAMPLE)
        if mapping is None:
            return None
        return self._conjunction(self._corrected_keys(mapping, PREDICATES, "the predicate"), f"a predicate of {name}")

    def _corrected_keys(self, node: Mapping, known_names: Collection[str], what: str) -> Mapping:
        """Returns a mapping of predicates with known keys only; adds a fault for each unknown key."""
        return corrected_keys(renamed_key(node, OLD_ON_TOP_OF, ON_TOP_OF), known_names, what, self.reading.faults)

    def _condition(self, name: str, value: Node) -> Condition | None:
        mapping = self.reading.mapping(value, name, "{object: cube_1}")
        if mapping is None:
            return None
        kind = CONDITIONS[name]
        keys = keys_of(kind)
        node = corrected_keys(mapping, tuple(keys), f"the key of {name}", self.reading.faults)
        values = dict(self._values(name, node, keys))
        if any(each is None for each in values.values()):
            return None
        condition = kind(**values)
        if isinstance(condition, Stacked) and len(condition.objects) < 2:
            self.reading.faults.add(value.location, "stacked needs at least two objects, the lowest first; add one")
            return None
        if isinstance(condition, Collected) and condition.wanted > len(condition.objects):
            limit = f"1 to {len(condition.objects)}, the number of objects"
            text = f"count of collected is {condition.wanted}; allowed: {limit}"
            self.reading.faults.add(node.entries["count"].location, text)
            return None
        if isinstance(condition, JointAtLeast) and condition.model in self.names.joints:
            joints = self.names.joints[condition.model]
            if condition.joint not in joints:
                what = f"the joint of model '{condition.model}' in {name}"
                self.reading.faults.add_unknown(node.entries["joint"].location, what, condition.joint, joints)
                return None
        return condition

    def _values(
        self, name: str, node: Mapping, keys: Map[str, tuple[PredicateKey, Field[Any]]]
    ) -> Iterator[tuple[str, Any]]:
        """Yields the values of a condition; None after a fault."""
        for key, (declared, item) in keys.items():
            if key in node.entries:
                yield key, self._value(node.entries[key], f"{key} of {name}", declared)
            elif item.default is MISSING:
                defaults = {KeyKind.OBJECT: self.names.objects[:1], KeyKind.OBJECTS: self.names.objects}
                default_values = defaults.get(declared.kind, ())
                if not default_values:
                    self.reading.faults.add(node.location, f"{name} needs the key '{key}'; add it")
                yield (
                    key,
                    (default_values[0] if declared.kind is KeyKind.OBJECT else default_values)
                    if default_values
                    else None,
                )

    def _value(self, node: Node, what: str, key: PredicateKey) -> Any:
        match key.kind:
            case KeyKind.NUMBER:
                return self.reading.number(node, what, key.low, key.high)
            case KeyKind.COUNT:
                return self.reading.count(node, what, int(key.low), int(key.high))
            case KeyKind.VECTOR:
                return self._vector(node, what, key)
            case KeyKind.JOINT:
                return self.reading.text(node, what)
            case KeyKind.REGION:
                name = self.reading.choice(node, what, tuple(self.names.regions))
                return self.names.regions.get(name or "")
            case KeyKind.OBJECTS:
                items = self.reading.items(node, what, "[cube_1, cube_2]")
                names = [self._model(item, f"each of {what}", key.kind) for item in items or ()]
                return tuple(names) if names and None not in names else None
            case KeyKind.OBJECT | KeyKind.MODEL:
                return self._model(node, what, key.kind, key.extra)

    def _vector(self, node: Node, what: str, key: PredicateKey) -> tuple[float, ...] | None:
        items = self.reading.items(node, what, "[0.1, 0.2, 0.3]") or ()
        values = [self.reading.number(item, f"each number of {what}", key.low, key.high) for item in items]
        if items and len(items) != 3:
            self.reading.faults.add(node.location, f"{what} has {len(items)} numbers; allowed: 3")
        return tuple(float(each or 0.0) for each in values) if len(values) == 3 and None not in values else None

    def _model(self, node: Node, what: str, kind: KeyKind, extra: tuple[str, ...] = ()) -> str | None:
        text = self.reading.text(node, what)
        if text is None or self.names.models is None:
            return text
        models = self.names.models if kind is KeyKind.MODEL else ()
        allowed = list(dict.fromkeys((*self.names.objects, *models, *extra)))
        if text in allowed or text in self.names.models:
            return text
        self.reading.faults.add_unknown(node.location, what, text, allowed)
        return None


def read_regions(reading: ValueReading, node: Node, key: str) -> tuple[Region, ...] | None:
    """Reads named regions; None if the value is no mapping.

    Args:
        reading: Reader that collects faults.
        node: Value in the file.
        key: Name of the key, for faults.
    """
    mapping = reading.mapping(node, key, "{goal: {x: [0.1, 0.2], y: [0.4, 0.5]}}")
    if mapping is None:
        return None
    regions = [_region(reading, name, value) for name, value in mapping.entries.items()]
    return tuple(region for region in regions if region is not None)


def _region(reading: ValueReading, name: str, value: Node) -> Region | None:
    mapping = reading.mapping(value, f"the region '{name}'", "{x: [0.1, 0.2], y: [0.4, 0.5]}")
    if mapping is None:
        return None
    node = corrected_keys(mapping, ("x", "y", "z"), "the key of a region", reading.faults)
    spans = {axis: _span(reading, item, f"{axis} of region '{name}'") for axis, item in node.entries.items()}
    missing = [axis for axis in ("x", "y") if axis not in node.entries]
    if missing:
        reading.faults.add(
            value.location, f"the region '{name}' has no {' and no '.join(missing)}; add [LOW, HIGH] [m]"
        )
    return None if missing or None in spans.values() else Region(name=name, **spans)  # type: ignore[arg-type]


def _span(reading: ValueReading, node: Node, what: str) -> Span | None:
    items = reading.items(node, what, "[0.1, 0.2]")
    values = [reading.number(item, f"each number of {what} [m]", -MAX_M, MAX_M) for item in items or ()]
    if items is None or None in values:
        return None
    if len(values) != 2 or values[0] >= values[1]:  # type: ignore[operator]
        reading.faults.add(node.location, f"{what} is {values}; allowed: [LOW, HIGH] with LOW < HIGH")
        return None
    return values[0], values[1]  # type: ignore[return-value]


def _selected_entries(node: Mapping, names: Collection[str]) -> Mapping:
    return Mapping({name: node.entries[name] for name in names}, node.keys, node.location)
