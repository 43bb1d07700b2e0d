# SPDX-License-Identifier: BSD-3-Clause
"""Reader for padding and scale in robot_description_planning."""

from __future__ import annotations

from modular_framework_planning.errors import ModelError
from modular_framework_planning.move_group.robot_parameters import load_planning_limits
from modular_framework_planning.planning_scene.padding import Padding, uniform_padding
from modular_framework_planning.robot_model.robot_model import RobotModel


def load_padding(model: RobotModel) -> Padding:
    """Reads default_robot_padding, _scale, _link_padding, _link_scale, default_object_padding and _attached_padding.

    Raises:
        ModelError: A link is unknown, or a value is not a number.
        GeometryError: A padding is negative, or a scale is not positive.
    """
    limits = load_planning_limits()
    try:
        padding, scale, objects, attached = (
            float(limits.get(f"default_{key}", default))
            for key, default in (
                ("robot_padding", 0.0),
                ("robot_scale", 1.0),
                ("object_padding", 0.0),
                ("attached_padding", 0.0),
            )
        )
        links, scales = (
            {str(link): float(value) for link, value in (limits.get(f"default_robot_link_{key}") or {}).items()}
            for key in ("padding", "scale")
        )
    except (TypeError, ValueError, AttributeError) as error:
        raise ModelError(
            f"robot_description_planning: a padding or scale is not a number ({error}); give paddings in m, and "
            "default_robot_link_padding and _scale as mappings from link to number"
        ) from error
    unknown = sorted(link for link in (*links, *scales) if not model.has_link(link))
    if unknown:
        raise ModelError(
            f"robot_description_planning: padding or scale of unknown links {', '.join(unknown)}; links of the robot "
            f"are {', '.join(model.frame_ids)}"
        )
    return uniform_padding(model.frame_ids, padding, scale, objects, attached).with_links(links, scales)
