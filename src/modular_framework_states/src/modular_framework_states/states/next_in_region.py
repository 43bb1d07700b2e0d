# SPDX-License-Identifier: BSD-3-Clause
"""A state that selects the next object of a region."""

from __future__ import annotations

from typing import Annotated, Any, Unpack

import rospy

from modular_framework_core.grasp_generation.ros_scene_objects import SceneObjects
from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_limits import Limits
from modular_framework_core.state_api.option_uses import Named
from modular_framework_ros.calls import CallError
from modular_framework_states.place_poses import PlaceError, read_region
from modular_framework_states.region_objects import ObjectSelection, objects_in_region

OBJECT_KEY = "selected_object"
REGIONS_PARAMETER = "/regions"
SERVICE_TIMEOUT_S = 10.0


class NextInRegion(FrameworkState):
    """Selects the objects in a region one after the other; positive while an object is left to try.

    An object is in the region if the planning scene shows the centre of its box there. The object with the highest
    upper end comes first, and each other object comes before an object is selected again. Without an object in the
    region, the outcome is the second of three outcomes, or the negative outcome of two. The outcome is negative if each
    object was selected ``attempts`` times while no object left the region.

    Args:
        region: Name of a region of the parameter ``/regions``; its ``z`` excludes the furniture below the objects.
        attempts: Maximum number of selections of an object while no object leaves the region.
        **keys: Outcomes and userdata keys of any state; the output key ``selected_object`` receives the name of the
            object.
    """

    def __init__(
        self,
        region: Annotated[str, Named("region")],
        attempts: Annotated[int, Limits(at_least=1)] = 2,
        **keys: Unpack[StateKeys],
    ) -> None:
        super().__init__(**keys)
        self._region, self._attempts = str(region), int(attempts)
        self._selection = ObjectSelection(self._attempts)
        self._scene: SceneObjects | None = None

    def execute(self, userdata: Any) -> str:
        """Reads the planning scene and selects an object."""
        if OBJECT_KEY not in self.get_registered_output_keys():
            return self.fail(f"the output keys lack {OBJECT_KEY}; add it, or the name is lost")
        try:
            region = read_region(self._region, rospy.get_param(REGIONS_PARAMETER, {}))
            names = objects_in_region(self._scene_objects().read(), region)
        except (CallError, PlaceError) as error:
            return self.fail(f"next object: {error}")
        selected = self._selection.next_of(names)
        if selected is not None:
            userdata.selected_object = selected
            return self.succeed()
        self._selection = ObjectSelection(self._attempts)
        if not names:
            return self.end(self.outcomes[1], f"no object is left in {region.label}")
        return self.fail(
            f"each of the {len(names)} objects left in {region.label} was tried {self._attempts} times without "
            f"success: {', '.join(names)}"
        )

    def _scene_objects(self) -> SceneObjects:
        if self._scene is None:
            scene = SceneObjects()
            scene.connect(SERVICE_TIMEOUT_S)
            self._scene = scene
        return self._scene
