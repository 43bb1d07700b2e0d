# SPDX-License-Identifier: BSD-3-Clause
"""Command that checks a method on recorded inputs: `python -m mbf_method.check_method --kind planner -- COMMAND`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any, Sequence

from mbf_method.errors import MethodError
from mbf_method.grasp_request import GraspRequest
from mbf_method.method_checks import Findings, check_grasp_method, check_planner, check_policy
from mbf_method.method_client import MethodClient, MethodLimits, MethodSource
from mbf_method.observation import Observation
from mbf_method.path_request import PathRequest
from mbf_method.sample_inputs import grasp_requests, observations, path_requests
from mbf_method.served_method import ACTIONS, GRASPS, PATHS
from mbf_method.wire import unpack

KINDS = {"grasp": GRASPS, "planner": PATHS, "policy": ACTIONS}


def check(kind: str, client: MethodClient, folder: Path | None) -> Findings:
    """Checks a method.

    Args:
        kind: Key of `KINDS`.
        client: Client of the method.
        folder: Folder with recorded inputs; None for the inputs of this package.

    Raises:
        MethodError: The method does not start.
        FileNotFoundError: The folder contains no input.
    """
    client.start()

    def call(request: Any) -> Any:
        return client.call(request).message

    if kind == "grasp":
        requests = grasp_requests(client.needs_camera)
        recorded = None if folder is None else [GraspRequest.from_message(item) for item in _messages(folder)]
        return check_grasp_method(call, requests if recorded is None else recorded)
    if kind == "policy":
        inputs = observations() if folder is None else [Observation.from_message(item) for item in _messages(folder)]
        return check_policy(call, inputs)
    paths = path_requests() if folder is None else [PathRequest.from_message(item) for item in _messages(folder)]
    return check_planner(call, paths)


def _messages(folder: Path) -> list[dict[str, Any]]:
    files = sorted(folder.glob("*.msgpack"))
    if not files:
        raise FileNotFoundError(f"{folder} contains no *.msgpack file; record inputs with the parameter record_inputs")
    return [unpack(file.read_bytes()) for file in files]


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command; returns 0 without a fault, otherwise 1."""
    parser = argparse.ArgumentParser(prog="check_method", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--kind", choices=sorted(KINDS), default="grasp", help="kind of the method")
    parser.add_argument("--inputs", type=Path, metavar="FOLDER", help="recorded inputs; default: inputs of mbf_method")
    parser.add_argument("--address", default="", help="address of a running method, instead of COMMAND")
    parser.add_argument("--time-limit", type=float, default=60.0, metavar="S", help="maximum time of a call [s]")
    parser.add_argument("command", nargs="*", metavar="COMMAND", help="program and arguments that start the method")
    options = parser.parse_args(arguments)
    source = MethodSource(tuple(options.command), options.address)
    client = MethodClient(source, KINDS[options.kind], MethodLimits(call_s=options.time_limit))
    try:
        findings = check(options.kind, client, options.inputs)
    except (MethodError, FileNotFoundError) as error:
        print(f"check_method: {error}", file=sys.stderr)
        return 1
    finally:
        client.close()
    for text in findings.notes:
        print(text)
    for text in findings.faults:
        print(f"fault: {text}")
    print(f"{len(findings.faults)} faults." if findings.faults else "No fault found.")
    return 1 if findings.faults else 0


if __name__ == "__main__":
    sys.exit(main())
