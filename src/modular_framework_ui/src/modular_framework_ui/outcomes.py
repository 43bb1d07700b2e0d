# SPDX-License-Identifier: BSD-3-Clause
"""Infers outcomes from active states, because the smach topics do not contain outcomes."""

from __future__ import annotations

from collections.abc import Collection

from modular_framework_ui.messages import MachineStructure


def only_outcome(structure: MachineStructure, label: str, active: Collection[str]) -> str:
    """Returns the outcome that led from a state to its successor; "" if the outcome is ambiguous or unknown.

    Args:
        structure: Container of the state.
        label: Label of the state that ended.
        active: Labels of the running states; empty if the container ended.
    """
    successors = set(active or structure.outcomes)
    outcomes = {each.outcome for each in structure.transitions if each.start == label and each.target in successors}
    return outcomes.pop() if len(outcomes) == 1 else ""


def machine_outcome(structure: MachineStructure, last_label: str, last_outcome: str) -> str:
    """Returns the outcome of a machine after its last state; "" if the outcome of that state does not end the machine.

    Args:
        structure: Structure of the machine.
        last_label: Label of the state that ended last.
        last_outcome: Outcome of the state that ended last.
    """
    return next(
        (
            each.target
            for each in structure.transitions
            if (each.start, each.outcome) == (last_label, last_outcome) and each.target in structure.outcomes
        ),
        "",
    )
