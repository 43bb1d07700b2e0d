# SPDX-License-Identifier: BSD-3-Clause
"""Messages of openpi-style policy servers: converts observations, and reads responses.

Such a server sends its metadata first. Each request is a dictionary whose keys depend on the policy, and each response
has the key `actions`. The transport and the encoding of arrays are those of `mbf_method`.
"""

from __future__ import annotations

from typing import Any, Mapping

import numpy as np

from mbf_method.observation import Observation

STATE_FIELDS = ("positions", "gripper", "state", "prompt")
"""Fields of an observation beside its cameras; `state` has the positions of the joints and of the gripper."""


def openpi_fields(cameras: Mapping[str, str]) -> tuple[str, ...]:
    """Returns the fields that a request may contain.

    Args:
        cameras: Colour image topics, keyed by camera name.
    """
    return (*STATE_FIELDS, *cameras)


def openpi_request(observation: Observation, keys: Mapping[str, str]) -> dict[str, Any]:
    """Returns the request for an observation.

    Args:
        observation: Input of the policy.
        keys: Key of each field in the request, such as {"positions": "observation/joint_position"}.
    """
    positions = np.asarray(observation.robot.positions, np.float32)
    gripper = np.array([observation.gripper], np.float32)
    fields: dict[str, Any] = {name: images.colour for name, images in observation.cameras.items()}
    fields.update(
        positions=positions, gripper=gripper, state=np.concatenate([positions, gripper]), prompt=observation.prompt
    )
    return {key: fields[field] for field, key in keys.items()}


def openpi_response(message: Mapping[str, Any], total_s: float) -> dict[str, Any]:
    """Returns a response with the fields of a response of `mbf_method`.

    Args:
        message: Response of the server.
        total_s: Duration of the call [s], the duration of the policy if the server states none.
    """
    timing = {"infer_ms": 1e3 * total_s, "queue_ms": 0.0, **message.get("server_timing", {})}
    result = {name: message[name] for name in ("actions",) if name in message}
    return {"result": result or dict(message), "server_timing": timing}
