# SPDX-License-Identifier: BSD-3-Clause
"""What an option of a state refers to: a name that must exist, or userdata that the state needs.

It is declared once, in the annotation of the state's constructor; ``--check`` reads it from the source::

    def __init__(self, pose_name: Annotated[str, Named("pose")], request: Annotated[Mapping[str, Any], Fields()]): ...
"""

from __future__ import annotations

from dataclasses import dataclass

FROM_USERDATA = "userdata"
"""Name that stands for a message in userdata, under ``selected_<kind>``."""
USERDATA_PREFIX = "userdata."
"""Prefix of a reference to userdata in the fields of a message; the key follows, and then fields of its value."""
GRASP_STAGES = ("pregrasp", "grasp", "postgrasp")


def kind_of(message_type: str) -> str:
    """Returns the kind of message behind a type word: every stage of a grasp is kept in a grasp message."""
    return "grasp" if message_type in GRASP_STAGES else message_type


@dataclass(frozen=True, slots=True)
class Named:
    """The option is a name, or a list of names; an empty one stands for none.

    Attributes:
        kind: What it names: joint_state, trajectory, pose, plan or grasp, a state of the manipulator's group
            (posture), a planning group (group), or a planner (planner); ``option:<name>`` for the kind that another
            option says.
        made: Whether the state itself stores something under the name.
        userdata: Whether the name ``userdata`` takes what userdata has under ``selected_<kind>``, an input key then.
    """

    kind: str
    made: bool = False
    userdata: bool = False


@dataclass(frozen=True, slots=True)
class Key:
    """The option decides about a userdata key that the state declares.

    Attributes:
        direction: "input" or "output".
        name: The key; ``{}`` in it stands for the kind of message that the option says; empty: the option is the key.
        when: Value of the option for which the key is needed; empty for any that is not empty.
    """

    direction: str
    name: str = ""
    when: str = ""


@dataclass(frozen=True, slots=True)
class Fields:
    """The option has fields of a message; a text ``userdata.<key>`` in it takes the value from an input key."""


@dataclass(frozen=True, slots=True)
class OutputKeys:
    """The keys of the option's mapping are output keys."""


@dataclass(frozen=True, slots=True)
class OutcomeNames:
    """The keys of the option's mapping are outcomes of the state."""


Use = Named | Key | Fields | OutputKeys | OutcomeNames
KINDS: dict[str, type[Use]] = {item.__name__: item for item in (Named, Key, Fields, OutputKeys, OutcomeNames)}
