# SPDX-License-Identifier: BSD-3-Clause
"""Reads the joints of grippers from an SRDF, because a URDF without mimic joints does not name grippers."""

from __future__ import annotations

from modular_framework_simulation.errors import DescriptionError
from modular_framework_urdf.planning_groups import GroupError, KinematicTree
from modular_framework_urdf.srdf_reader import read_srdf
from modular_framework_urdf.urdf_reader import read_urdf
from modular_framework_urdf.xml_text import XmlError

_PARAMETER = "robot_description_semantic"


def end_effector_joints(srdf: str, urdf: str) -> frozenset[str]:
    """Returns the names of the joints in the groups of the end effectors; empty for an empty SRDF.

    Args:
        srdf: SRDF text.
        urdf: URDF text of the same robot.

    Raises:
        DescriptionError: A text is invalid, or the SRDF does not fit the URDF.
    """
    if not srdf:
        return frozenset()
    try:
        semantics, robot = read_srdf(srdf, _PARAMETER), read_urdf(urdf)
        tree = KinematicTree({joint.name: (joint.parent, joint.child) for joint in robot.joints})
        return frozenset(name for each in semantics.end_effectors for name in tree.group_joints(each.group, semantics))
    except XmlError as error:
        raise DescriptionError(error.location, error.found, error.allowed) from error
    except GroupError as error:
        raise DescriptionError(_PARAMETER, str(error), "correct the group or the end effector") from error
