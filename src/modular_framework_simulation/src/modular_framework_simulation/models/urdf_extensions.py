# SPDX-License-Identifier: BSD-3-Clause
"""Reads the `<gazebo>` elements of a URDF, which contain properties that URDF does not define."""

from __future__ import annotations

from modular_framework_ros.allowed_names import misspelling
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.materials import Material, gazebo_material
from modular_framework_simulation.models.sdf_elements import children_of
from modular_framework_simulation.models.sdf_notes import Notes
from modular_framework_simulation.models.sdf_surface import friction_coefficient, non_negative
from modular_framework_simulation.models.xml_nodes import XmlNode

_LINK_TAGS = (
    *("material", "mu1", "mu2", "mu", "kp", "kd", "maxVel", "minDepth"),
    *("selfCollide", "turnGravityOff", "gravity", "dampingFactor", "kinematic"),
)
_JOINT_TAGS = ("springStiffness", "springReference", "preserveFixedJoint", "disableFixedJointLumping")
_SENSOR_TAGS = ("sensor", "plugin")
"""Elements that the sensors read."""
_MODEL_TAGS = ("static", "selfCollide", "self_collide")
_KNOWN_TAGS = (*_LINK_TAGS, *_JOINT_TAGS, *_SENSOR_TAGS, *_MODEL_TAGS)
_OTHER_TAGS = (
    *("cfmDamping", "fdir1", "fudgeFactor", "implicitSpringDamper", "laserRetro", "maxContacts", "provideFeedback"),
    *("stopCfm", "stopErp", "initialJointPosition"),
    *(tag for element in ("model", "link", "joint", "collision", "visual") for tag in children_of(element)),
)
"""Elements that Gazebo reads or copies into the model, without effect in this simulation."""


def misspelt_extensions(robot: XmlNode) -> list[str]:
    """Returns the misspelt elements and references of the `<gazebo>` elements of a robot.

    Any element may be copied into the model, and a reference to a missing link has no effect, so only names are
    misspelt that differ from a known name by a letter or two.

    Args:
        robot: Root element of the description.
    """
    owners = [node.attributes.get("name", "") for tag in ("link", "joint") for node in robot.find_all(tag)]
    faults = []
    for node in robot.find_all("gazebo"):
        owner = node.attributes.get("reference", "")
        meant = next((name for name in owners if owner and owner not in owners and misspelling(owner, name)), "")
        if meant:
            faults.append(f"{node.location}: there is no link or joint '{owner}'; did you mean '{meant}'?")
        for child in node.children:
            unknown = child.tag not in (*_KNOWN_TAGS, *_OTHER_TAGS)
            meant = next((tag for tag in _KNOWN_TAGS if unknown and misspelling(child.tag, tag)), "")
            if meant:
                faults.append(f"{child.location}: <gazebo> has no <{child.tag}>; did you mean '{meant}'?")
    return faults


class UrdfExtensions:
    """The `<gazebo>` elements of a description, by referenced link or joint.

    The simulation does not merge links of fixed joints, so settings of the merge have no effect.

    Args:
        robot: Root element of the description.
        notes: Collector of notes on elements without effect.
    """

    def __init__(self, robot: XmlNode, notes: Notes) -> None:
        self._children: dict[str, list[XmlNode]] = {}
        self._notes = notes
        joints = {node.attributes.get("name", "") for node in robot.find_all("joint")}
        links = {node.attributes.get("name", "") for node in robot.find_all("link")}
        for node in robot.find_all("gazebo"):
            owner = node.attributes.get("reference", "")
            if owner and owner not in joints | links:
                notes.add(node, f"refers to '{owner}', which is not a link or joint; the element has no effect")
                continue
            known = _MODEL_TAGS if not owner else (*(_LINK_TAGS if owner in links else ()), *_JOINT_TAGS)
            known = (*known, *_SENSOR_TAGS)
            self._children.setdefault(owner, []).extend(node.children)
            for child in node.children:
                if child.tag not in known:
                    notes.add(child, "has no effect", f"<gazebo>/<{child.tag}>")

    def find(self, owner: str, *tags: str) -> XmlNode | None:
        """Returns the last element of a link or joint with one of the tags; None if no element matches.

        Args:
            owner: Name of the link or joint; "" for the model.
            tags: Tags of the element.
        """
        return next((child for child in reversed(self._children.get(owner, [])) if child.tag in tags), None)

    def flag(self, owner: str, *tags: str) -> bool | None:
        """Returns the value of the last flag of a link or joint; None if no element matches.

        Args:
            owner: Name of the link or joint; "" for the model.
            tags: Tags of the element.
        """
        node = self.find(owner, *tags)
        return node.flag() if node is not None else None

    def friction(self, link: str) -> specs.Friction:
        """Returns the friction of a link."""
        first, second = self.find(link, "mu1", "mu"), self.find(link, "mu2")
        lateral = friction_coefficient(first.number()) if first is not None else None
        across = friction_coefficient(second.number()) if second is not None else None
        return specs.Friction(1.0 if lateral is None else lateral, mu2=across)

    def contact(self, link: str) -> specs.SurfaceContact:
        """Returns the contact properties of a link's surface."""
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
            joint: Name of the joint.
            damping: Damping in the URDF's <dynamics> [N m s/rad or N s/m].
            friction: Friction in the URDF's <dynamics> [N m or N].
        """
        reference = self.find(joint, "springReference")
        return specs.JointDynamics(
            damping,
            friction,
            reference.number() if reference is not None else 0.0,
            non_negative(self.find(joint, "springStiffness")) or 0.0,
        )

    def material(self, link: str) -> Material | None:
        """Returns the Gazebo material that replaces the materials of a link's visuals; None if not specified."""
        node = self.find(link, "material")
        if node is None:
            return None
        material = gazebo_material(node.text.strip())
        if material is None:
            self._notes.add(node, f"'{node.text.strip()}' is not a known material; the element has no effect")
        return material
