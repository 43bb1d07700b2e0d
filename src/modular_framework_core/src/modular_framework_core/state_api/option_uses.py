# SPDX-License-Identifier: BSD-3-Clause
"""References of a state's options: to names that must exist, or to userdata keys that the state must declare.

The annotations of the state's constructor declare the references, and ``--check`` reads them from the source::

    def __init__(self, pose_name: Annotated[str, Named("pose")], request: Annotated[Mapping[str, Any], Fields()]): ...
"""

from __future__ import annotations

from dataclasses import dataclass

FROM_USERDATA = "userdata"
"""Reserved name for the message under the userdata key ``selected_<kind>``."""
USERDATA_PREFIX = "userdata."
"""Prefix of a userdata reference in the fields of a message: ``userdata.<key>[.<field>...]``."""
GRASP_STAGES = ("pregrasp", "grasp", "postgrasp")


def kind_of(message_type: str) -> str:
    """Returns the kind of message of a type; all grasp stages are stored in a grasp message."""
    return "grasp" if message_type in GRASP_STAGES else message_type


@dataclass(frozen=True, slots=True)
class Named:
    """The option is a name or a list of names; empty names are ignored.

    Attributes:
        kind: Kind of name: joint_state, trajectory, pose, plan, grasp, posture, group, region, model, series
            (common part of numbered models), object_type (folder of a model) or planner;
            ``option:<name>`` if another option gives the kind.
        made: Whether the state stores a message under the name.
        userdata: Whether the name ``userdata`` refers to the input key ``selected_<kind>``.
    """

    kind: str
    made: bool = False
    userdata: bool = False


@dataclass(frozen=True, slots=True)
class Key:
    """The option requires a userdata key that the state must declare.

    Attributes:
        direction: "input" or "output".
        name: Userdata key, with ``{}`` for the kind of message given by the option; "" if the option itself is the key.
        when: Value of the option that requires the key; "" for any nonempty value.
    """

    direction: str
    name: str = ""
    when: str = ""


@dataclass(frozen=True, slots=True)
class Fields:
    """The option contains fields of a message, in which ``userdata.<key>`` is replaced by the value of an input key."""


@dataclass(frozen=True, slots=True)
class OutputKeys:
    """The keys of the option's mapping are output keys."""


@dataclass(frozen=True, slots=True)
class OutcomeNames:
    """The keys of the option's mapping are outcomes of the state."""


Use = Named | Key | Fields | OutputKeys | OutcomeNames
KINDS: dict[str, type[Use]] = {item.__name__: item for item in (Named, Key, Fields, OutputKeys, OutcomeNames)}
