# SPDX-License-Identifier: BSD-3-Clause
"""Reads the `<gazebo>` elements of a URDF, which say what URDF has no words for."""

from __future__ import annotations

from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.materials import Material, gazebo_material
from modular_framework_simulation.models.sdf_notes import Notes
from modular_framework_simulation.models.sdf_surface import friction_coefficient, non_negative
from modular_framework_simulation.models.xml_nodes import XmlNode

_OF_A_LINK = (
    *("material", "mu1", "mu2", "mu", "kp", "kd", "maxVel", "minDepth"),
    *("selfCollide", "turnGravityOff", "gravity", "dampingFactor", "kinematic"),
)
_OF_A_JOINT = ("springStiffness", "springReference", "preserveFixedJoint", "disableFixedJointLumping")
_SENSORS = ("sensor", "plugin")
"""Read elsewhere."""
_OF_THE_MODEL = ("static", "selfCollide", "self_collide")


class UrdfExtensions:
    """The `<gazebo>` elements of one description, by what they refer to.

    Joints that are fixed keep their links apart here, so that nothing has to be said about lumping.

    Args:
        robot: Root element of the description.
        notes: Takes what has no effect.
    """

    def __init__(self, robot: XmlNode, notes: Notes) -> None:
        self._children: dict[str, list[XmlNode]] = {}
        self._notes = notes
        joints = {node.attributes.get("name", "") for node in robot.find_all("joint")}
        links = {node.attributes.get("name", "") for node in robot.find_all("link")}
        for node in robot.find_all("gazebo"):
            owner = node.attributes.get("reference", "")
            if owner and owner not in joints | links:
                notes.add(node, f"refers to '{owner}', which is no link and no joint: it has no effect")
                continue
            known = _OF_THE_MODEL if not owner else (*(_OF_A_LINK if owner in links else ()), *_OF_A_JOINT)
            known = (*known, *_SENSORS)
            self._children.setdefault(owner, []).extend(node.children)
            for child in node.children:
                if child.tag not in known:
                    notes.add(child, "has no effect here", f"<gazebo>/<{child.tag}>")

    def find(self, owner: str, *tags: str) -> XmlNode | None:
        """Returns the last element of one of some names that refers to a link or joint; "" for the model."""
        return next((child for child in reversed(self._children.get(owner, [])) if child.tag in tags), None)

    def flag(self, owner: str, *tags: str) -> bool | None:
        """Returns what an element says; None where there is none."""
        node = self.find(owner, *tags)
        return node.flag() if node is not None else None

    def friction(self, link: str) -> specs.Friction:
        """Returns the friction of a link."""
        first, second = self.find(link, "mu1", "mu"), self.find(link, "mu2")
        lateral = friction_coefficient(first.number()) if first is not None else None
        across = friction_coefficient(second.number()) if second is not None else None
        return specs.Friction(1.0 if lateral is None else lateral, mu2=across)

    def contact(self, link: str) -> specs.SurfaceContact:
        """Returns how the surface of a link gives way."""
        kp, kd, velocity, depth = (non_negative(self.find(link, tag)) for tag in ("kp", "kd", "maxVel", "minDepth"))
        return specs.SurfaceContact(kp, kd, velocity, depth)

    def velocity_decay(self, link: str) -> specs.VelocityDecay:
        """Returns the damping of a link."""
        factor = non_negative(self.find(link, "dampingFactor")) or 0.0
        return specs.VelocityDecay(factor, factor)

    def gravity(self, link: str) -> bool:
        """Returns whether gravity acts on a link."""
        off, on = self.flag(link, "turnGravityOff"), self.flag(link, "gravity")
        return not off if off is not None else on is not False

    def dynamics(self, joint: str, damping: float, friction: float) -> specs.JointDynamics:
        """Returns the passive forces of a joint.

        Args:
            joint: Its name.
            damping: As URDF itself has it.
            friction: As URDF itself has it.
        """
        reference = self.find(joint, "springReference")
        return specs.JointDynamics(
            damping,
            friction,
            reference.number() if reference is not None else 0.0,
            non_negative(self.find(joint, "springStiffness")) or 0.0,
        )

    def material(self, link: str) -> Material | None:
        """Returns the look that replaces that of all visuals of a link; None where there is none."""
        node = self.find(link, "material")
        if node is None:
            return None
        found = gazebo_material(node.text.strip())
        if found is None:
            self._notes.add(node, f"'{node.text.strip()}' is no material that is known here: it has no effect")
        return found
