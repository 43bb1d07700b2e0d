# SPDX-License-Identifier: BSD-3-Clause
"""Reads friction, bounce, contact and damping of surfaces, links and joints."""

from __future__ import annotations

import math

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.xml_nodes import XmlNode


def non_negative(node: XmlNode | None, *path: str) -> float | None:
    """Returns the number at a path below an element; None if no element is at the path.

    Raises:
        DescriptionError: The number is negative.
    """
    child = node.find_path(*path) if node is not None else None
    if child is None:
        return None
    value = child.number()
    if value < 0:
        raise DescriptionError(child.location, f"got {value:g}", "allowed: 0 or greater")
    return value


def friction_coefficient(value: float | None) -> float | None:
    """Returns a friction coefficient; a negative value, Gazebo's sign of surfaces that never slide, is replaced."""
    return specs.UNLIMITED_FRICTION if value is not None and value < 0 else value


def read_friction(collision: XmlNode) -> specs.Friction:
    """Reads the friction of a <collision>.

    Raises:
        DescriptionError: A coefficient is not a number, or is negative and not a sliding coefficient.
    """
    friction = collision.find_path("surface", "friction")

    def coefficient(*path: str) -> float | None:
        child = friction.find_path(*path) if friction is not None else None
        return friction_coefficient(child.number()) if child is not None else None

    lateral, across = coefficient("ode", "mu"), coefficient("ode", "mu2")
    if lateral is None and across is None:
        lateral, across = coefficient("bullet", "friction"), coefficient("bullet", "friction2")
    elif lateral is None:
        lateral = coefficient("bullet", "friction")
    torsional = non_negative(friction, "torsional", "coefficient")
    return specs.Friction(
        1.0 if lateral is None else lateral,
        torsional,
        non_negative(friction, "bullet", "rolling_friction"),
        across,
    )


def read_bounce(collision: XmlNode) -> specs.Bounce:
    """Reads the bounce of a <collision>.

    Raises:
        DescriptionError: The coefficient is not between 0 and 1, or the threshold is negative.
    """
    bounce = collision.find_path("surface", "bounce")
    default = specs.Bounce()
    restitution = non_negative(bounce, "restitution_coefficient")
    threshold = non_negative(bounce, "threshold")
    if restitution is not None and restitution > 1 and bounce is not None:
        location = bounce.require("restitution_coefficient").location
        raise DescriptionError(location, f"got {restitution:g}", "allowed: 0 to 1")
    return specs.Bounce(
        default.restitution_coefficient if restitution is None else restitution,
        default.threshold if threshold is None else threshold,
    )


def read_surface_contact(collision: XmlNode) -> specs.SurfaceContact:
    """Reads the contact of a <collision>, using the settings of the Open Dynamics Engine.

    Raises:
        DescriptionError: A value is negative or not a number.
    """
    contact = collision.find_path("surface", "contact")
    max_velocity_node = contact.find_path("ode", "max_vel") if contact is not None else None
    max_velocity = (
        max_velocity_node.number() if max_velocity_node is not None else None
    )  # a negative value stands for no limit
    without_contact = contact.find("collide_without_contact") if contact is not None else None
    mask = contact.find("collide_bitmask") if contact is not None else None
    return specs.SurfaceContact(
        non_negative(contact, "ode", "kp"),
        non_negative(contact, "ode", "kd"),
        max_velocity if max_velocity is None or max_velocity >= 0 else None,
        non_negative(contact, "ode", "min_depth"),
        without_contact.flag() if without_contact is not None else False,
        specs.SurfaceContact().collide_bitmask if mask is None else _bitmask(mask),
    )


def _bitmask(node: XmlNode) -> int:
    text = node.text.strip()
    try:
        value = int(text, 0)
    except ValueError:
        value = -1
    if not 0 <= value <= 0xFFFFFFFF:
        raise DescriptionError(node.location, f"got '{text}'", "allowed: a whole number from 0 to 0xFFFFFFFF")
    return value


def read_velocity_decay(link: XmlNode) -> specs.VelocityDecay:
    """Reads the damping of a <link>.

    Raises:
        DescriptionError: A value is negative or not a number.
    """
    decay = link.find("velocity_decay")
    return specs.VelocityDecay(non_negative(decay, "linear") or 0.0, non_negative(decay, "angular") or 0.0)


def read_joint_dynamics(axis: XmlNode) -> specs.JointDynamics:
    """Reads damping, friction and spring of the <axis> of a joint.

    Raises:
        DescriptionError: A value that must not be negative is negative, or a value is not a number.
    """
    dynamics = axis.find("dynamics")
    reference = dynamics.find("spring_reference") if dynamics is not None else None
    return specs.JointDynamics(
        non_negative(dynamics, "damping") or 0.0,
        non_negative(dynamics, "friction") or 0.0,
        reference.number() if reference is not None else 0.0,
        non_negative(dynamics, "spring_stiffness") or 0.0,
    )


def joint_bound(axis: XmlNode, name: str, unlimited: float) -> float:
    """Returns a number of the <limit> of an axis; `unlimited` if the number is missing or at least 1e16.

    Args:
        axis: The <axis> element.
        name: Tag of the limit.
        unlimited: Value that stands for no limit: -inf or inf.

    Raises:
        DescriptionError: The limit is not a number.
    """
    node = axis.find_path("limit", name)
    if node is None:
        return unlimited
    text = node.text.strip().lower().lstrip("+-")
    if text in ("inf", "infinity"):
        return unlimited
    value = node.number()
    no_limit = value <= -_NO_LIMIT if unlimited < 0 else value >= _NO_LIMIT
    return unlimited if no_limit else value


def drive_bound(axis: XmlNode, name: str) -> float:
    """Returns the <effort> or <velocity> limit of an axis; infinite for a negative value.

    Raises:
        DescriptionError: The limit is not a number.
    """
    value = joint_bound(axis, name, math.inf)
    return math.inf if value < 0 else value


_NO_LIMIT = 1e16
"""Magnitude of SDF's default joint limits."""
