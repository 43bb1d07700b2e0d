# SPDX-License-Identifier: BSD-3-Clause
"""Emulates the server of the Real-Time Data Exchange (RTDE), protocol version 2.

A package consists of its length (2 bytes), its type (1 byte) and a payload, in big-endian order. A client sets up
recipes, which are lists of variables. A data package contains the number of a recipe and the values of its variables.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from modular_framework_testing.emulators.ur_controller import REGISTERS, UrController
from modular_framework_testing.emulators.ur_motion import flange_pose

_PROTOCOL, _VERSION, _DATA = ord("V"), ord("v"), ord("U")
_OUTPUTS, _INPUTS, _START, _PAUSE = ord("O"), ord("I"), ord("S"), ord("P")
_HEADER = struct.Struct(">HB")
_OLD_VERSION = (3, 3, 0, 0)
REFUSALS = ("", "protocol", "version")
_FORMATS = {
    "DOUBLE": "d",
    "INT32": "i",
    "UINT32": "I",
    "UINT64": "Q",
    "UINT8": "B",
    "BOOL": "?",
    "VECTOR3D": "3d",
    "VECTOR6D": "6d",
    "VECTOR6INT32": "6i",
}
Value = float | Sequence[float]


class RtdeProtocolError(ValueError):
    """Raised if a client violates the protocol, which closes the connection."""


@dataclass(frozen=True, slots=True)
class Variable:
    """Variable of RTDE.

    Attributes:
        type_name: Type in responses to setup requests.
        get: Getter of an output.
        set: Setter of an input.
    """

    type_name: str
    get: Callable[[], Value] | None = None
    set: Callable[[Value], None] | None = None


_UNMODELLED_OUTPUTS: dict[str, tuple[str, Value]] = {
    **dict.fromkeys(("elbow_position", "elbow_velocity"), ("VECTOR3D", (0.0,) * 3)),
    **dict.fromkeys(
        (
            "target_qdd",
            "target_current",
            "target_moment",
            "actual_current",
            "joint_control_output",
            "actual_TCP_speed",
            "target_TCP_speed",
            "payload_inertia",
            "actual_current_as_torque",
        ),
        ("VECTOR6D", (0.0,) * 6),
    ),
    **dict.fromkeys(
        (
            "actual_momentum",
            "actual_robot_current",
            "standard_analog_input0",
            "standard_analog_input1",
            "standard_analog_output0",
            "standard_analog_output1",
        ),
        ("DOUBLE", 0.0),
    ),
}
"""Types and constant values of the variables that the emulator does not model."""


def output_variables(controller: UrController) -> dict[str, Variable]:
    """Returns the variables that clients can read, by name."""
    motion = controller.motion
    values: dict[str, tuple[str, Callable[[], Value]]] = {
        "timestamp": ("DOUBLE", lambda: controller.time_s),
        "actual_execution_time": ("DOUBLE", lambda: 0.0002),
        "target_q": ("VECTOR6D", lambda: controller.target_positions),
        "target_qd": ("VECTOR6D", lambda: motion.velocities),
        "actual_q": ("VECTOR6D", lambda: motion.positions),
        "actual_qd": ("VECTOR6D", lambda: motion.velocities),
        "actual_TCP_pose": ("VECTOR6D", lambda: flange_pose(motion.positions)),
        "target_TCP_pose": ("VECTOR6D", lambda: flange_pose(controller.target_positions)),
        "actual_TCP_force": ("VECTOR6D", lambda: controller.wrench),
        "ft_raw_wrench": ("VECTOR6D", lambda: controller.wrench),
        "joint_temperatures": ("VECTOR6D", lambda: (30.0,) * 6),
        "actual_joint_voltage": ("VECTOR6D", lambda: (48.0,) * 6),
        "actual_tool_accelerometer": ("VECTOR3D", lambda: (0.0, 0.0, -9.81)),
        "payload": ("DOUBLE", lambda: controller.payload_kg),
        "payload_cog": ("VECTOR3D", lambda: controller.payload_centre_m),
        "robot_mode": ("INT32", lambda: controller.robot_mode),
        "safety_mode": ("INT32", lambda: controller.safety_mode),
        "joint_mode": ("VECTOR6INT32", lambda: (253,) * 6),
        "runtime_state": ("UINT32", lambda: controller.runtime_state),
        "robot_status_bits": ("UINT32", lambda: controller.robot_status_bits),
        "safety_status_bits": ("UINT32", lambda: controller.safety_status_bits),
        "speed_scaling": ("DOUBLE", lambda: controller.speed_scaling),
        "target_speed_fraction": ("DOUBLE", lambda: controller.speed_slider),
        "actual_main_voltage": ("DOUBLE", lambda: 48.0),
        "actual_robot_voltage": ("DOUBLE", lambda: 48.0),
        "actual_digital_input_bits": ("UINT64", lambda: 0),
        "actual_digital_output_bits": ("UINT64", lambda: controller.digital_outputs),
    }
    for index in range(REGISTERS):
        values[f"output_int_register_{index}"] = ("INT32", _getter(controller.outputs.ints, index))
        values[f"output_double_register_{index}"] = ("DOUBLE", _getter(controller.outputs.doubles, index))
    for name, (type_name, value) in _UNMODELLED_OUTPUTS.items():
        values[name] = (type_name, _constant(value))
    return {name: Variable(type_name, get=get) for name, (type_name, get) in values.items()}


def input_variables(controller: UrController) -> dict[str, Variable]:
    """Returns the variables that clients can set, by name."""

    def set_slider(value: Value) -> None:
        controller.speed_slider = min(max(float(value), 0.0), 1.0)  # type: ignore[arg-type]

    def ignore(value: Value) -> None:
        del value

    variables = {
        "speed_slider_fraction": Variable("DOUBLE", set=set_slider),
        "speed_slider_mask": Variable("UINT32", set=ignore),
        "external_force_torque": Variable("VECTOR6D", set=ignore),
    }
    for kind in ("standard", "configurable", "tool"):
        for suffix in ("_digital_output_mask", "_digital_output"):
            variables[kind + suffix] = Variable("UINT8", set=ignore)
    for suffix, type_name in (("mask", "UINT8"), ("type", "UINT8"), ("0", "DOUBLE"), ("1", "DOUBLE")):
        variables[f"standard_analog_output_{suffix}"] = Variable(type_name, set=ignore)
    for index in range(REGISTERS):
        variables[f"input_int_register_{index}"] = Variable("INT32", set=_setter(controller.inputs.ints, index))
        variables[f"input_double_register_{index}"] = Variable("DOUBLE", set=_setter(controller.inputs.doubles, index))
    return variables


def _constant(value: Value) -> Callable[[], Value]:
    return lambda: value


def _getter(values: Sequence[float], index: int) -> Callable[[], Value]:
    return lambda: values[index]


def _setter(values: list[Any], index: int) -> Callable[[Value], None]:
    def set_value(value: Value) -> None:
        values[index] = value

    return set_value


class Recipe:
    """Packs and unpacks the variables of a data package.

    Args:
        number: Number of the recipe.
        variables: Variables in the order of the package.
    """

    def __init__(self, number: int, variables: Sequence[Variable]) -> None:
        self._variables = tuple(variables)
        self._codec = struct.Struct(">" + "".join(_FORMATS[variable.type_name] for variable in variables))
        self._header = struct.pack(">HBB", 4 + self._codec.size, _DATA, number)

    def package(self) -> bytes:
        """Returns a data package with the current values."""
        values: list[float] = []
        for variable in self._variables:
            value = variable.get() if variable.get is not None else 0.0
            if isinstance(value, (list, tuple)):
                values += value
            else:
                values.append(value)  # type: ignore[arg-type]
        return self._header + self._codec.pack(*values)

    def unpack(self, payload: bytes) -> None:
        """Sets the variables to the values in a package, without header and recipe number.

        Raises:
            RtdeProtocolError: The package has the wrong length.
        """
        if len(payload) != self._codec.size:
            raise RtdeProtocolError(
                f"data package has {len(payload)} bytes; expected {self._codec.size} bytes for the recipe"
            )
        values = self._codec.unpack(payload)
        start = 0
        for variable in self._variables:
            count = int(_FORMATS[variable.type_name][:-1] or 1)
            if variable.set is not None:
                variable.set(values[start] if count == 1 else values[start : start + count])
            start += count


class RtdeServer:
    """Shared state of all clients.

    Args:
        controller: Controller with the values of the variables.

    Attributes:
        outputs: Variables that clients can read, by name.
        inputs: Variables that clients can set, by name.
        owners: Client that sets an input, by name of the input.
        refusal: One of `REFUSALS`: "protocol" refuses the protocol version, "version" reports an old software version.
    """

    def __init__(self, controller: UrController) -> None:
        self.controller = controller
        self.outputs = output_variables(controller)
        self.inputs = input_variables(controller)
        self.owners: dict[str, RtdeSession] = {}
        self.refusal = ""


class RtdeSession:
    """Handles the requests of one client.

    Args:
        server: Shared state of all clients.
    """

    def __init__(self, server: RtdeServer) -> None:
        self._server = server
        self._buffer = b""
        self._inputs: dict[int, Recipe] = {}
        self._output: Recipe | None = None
        self._cycles_per_package = 1
        self._cycles = 0
        self._started = False
        self._handlers: dict[int, Callable[[bytes], bytes]] = {
            _PROTOCOL: lambda payload: bytes([payload[-1:] == b"\x02" and server.refusal != "protocol"]),
            _VERSION: lambda _: struct.pack(
                ">4I", *(_OLD_VERSION if server.refusal == "version" else server.controller.model.version)
            ),
            _OUTPUTS: self._set_up_outputs,
            _INPUTS: self._set_up_inputs,
            _START: lambda _: self._start(True),
            _PAUSE: lambda _: self._start(False),
        }

    def receive(self, data: bytes) -> bytes:
        """Returns the response to received bytes.

        Raises:
            RtdeProtocolError: The bytes are not a valid package.
        """
        self._buffer += data
        replies = b""
        while len(self._buffer) >= _HEADER.size:
            size, kind = _HEADER.unpack_from(self._buffer)
            if size < _HEADER.size or (kind not in self._handlers and kind != _DATA):
                raise RtdeProtocolError(f"package has the unknown type {kind} or the invalid length {size}")
            if len(self._buffer) < size:
                break
            payload, self._buffer = self._buffer[_HEADER.size : size], self._buffer[size:]
            if kind == _DATA:
                self._set_inputs(payload)
                continue
            reply = self._handlers[kind](payload)
            replies += _HEADER.pack(_HEADER.size + len(reply), kind) + reply
        return replies

    def cycle(self) -> bytes:
        """Returns the data package of this cycle; empty without a data package."""
        if not self._started or self._output is None:
            return b""
        self._cycles += 1
        return self._output.package() if self._cycles % self._cycles_per_package == 0 else b""

    def close(self) -> None:
        """Releases the inputs of this client."""
        for name in [name for name, owner in self._server.owners.items() if owner is self]:
            del self._server.owners[name]

    def _set_inputs(self, payload: bytes) -> None:
        recipe = self._inputs.get(payload[0]) if payload else None
        if recipe is None:
            raise RtdeProtocolError(f"data package has the unknown recipe {payload[:1].hex() or 'none'}")
        recipe.unpack(payload[1:])

    def _set_up_outputs(self, payload: bytes) -> bytes:
        if len(payload) < 8:
            raise RtdeProtocolError("setup request of outputs has no frequency")
        (frequency,) = struct.unpack_from(">d", payload)
        max_frequency = self._server.controller.model.frequency
        self._cycles_per_package = max(1, round(max_frequency / frequency)) if frequency > 0.0 else 1
        names = _names(payload[8:])
        variables = [self._server.outputs.get(name) for name in names]
        if all(variable is not None for variable in variables):
            self._output = Recipe(1, [variable for variable in variables if variable is not None])
        return b"\x01" + ",".join(variable.type_name if variable else "NOT_FOUND" for variable in variables).encode()

    def _set_up_inputs(self, payload: bytes) -> bytes:
        number = len(self._inputs) + 1
        names = _names(payload)
        types = [self._input_type(name) for name in names]
        if "NOT_FOUND" in types or "IN_USE" in types:
            return b"\x00" + ",".join(types).encode()
        for name in names:
            self._server.owners[name] = self
        self._inputs[number] = Recipe(number, [self._server.inputs[name] for name in names])
        return bytes([number]) + ",".join(types).encode()

    def _input_type(self, name: str) -> str:
        if name not in self._server.inputs:
            return "NOT_FOUND"
        if self._server.owners.get(name, self) is not self:
            return "IN_USE"
        return self._server.inputs[name].type_name

    def _start(self, started: bool) -> bytes:
        self._started = started and self._output is not None
        return b"\x01" if self._started is started else b"\x00"


def _names(text: bytes) -> list[str]:
    return [name for name in text.decode("ascii", errors="replace").split(",") if name]
