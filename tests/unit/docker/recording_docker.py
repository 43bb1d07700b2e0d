#!/usr/bin/python3 -SE
# SPDX-License-Identifier: BSD-3-Clause
"""A docker command for tests: records each call and remembers which image and container there are.

The folder $STAND_IN holds calls.jsonl (one call a line), copied (what was copied into the container), image.json,
container.json, off (as long as the engine does not answer), no_gpu (while the engine cannot hand one over) and
exit_code (of the container).
"""

from __future__ import annotations

import json
import os
import sys

FOLDER = os.environ["STAND_IN"]
IMAGE, CONTAINER = f"{FOLDER}/image.json", f"{FOLDER}/container.json"


def read(path: str) -> str:
    with open(path) as file:
        return file.read()


def write(path: str, text: str) -> None:
    with open(path, "w") as file:
        file.write(text)


def values(arguments: list[str], option: str) -> dict[str, str]:
    """Returns the NAME=VALUE pairs that follow an option of a command line."""
    pairs = zip(arguments, arguments[1:], strict=False)
    return dict(value.split("=", 1) for name, value in pairs if name == option)


def inspect(path: str, arguments: list[str]) -> int:
    if not os.path.exists(path):
        return 1
    found = json.loads(read(path))
    if arguments[0] == "--format":
        wanted = arguments[1].strip("{}")
        known = {".Id": found.get("id"), ".State.Running": str(found.get("running", False)).lower()}
        print(known.get(wanted) or found["labels"].get(wanted.split('"')[1] if '"' in wanted else wanted, ""))
    return 0


def make_image(user_id: str) -> None:
    number = json.loads(read(IMAGE))["number"] + 1 if os.path.exists(IMAGE) else 1
    labels = {"modular_framework.user_id": user_id}
    write(IMAGE, json.dumps({"number": number, "id": f"sha256:{number}", "labels": labels}))


def answer(arguments: list[str]) -> int:
    match arguments:
        case ["info"]:
            return int(os.path.exists(f"{FOLDER}/off"))
        case ["image", "inspect", *rest]:
            return inspect(IMAGE, rest)
        case ["container", "inspect", *rest]:
            return inspect(CONTAINER, rest)
        case ["build", *rest]:
            make_image(values(rest, "--build-arg")["USER_ID"])
        case ["pull", name]:
            if "missing" in name:
                return 1
            make_image(os.environ.get("USER_OF_PULLED_IMAGE", "1000"))
        case ["image", "ls", *_]:
            number = json.loads(read(IMAGE))["number"]
            print("\n".join(f"sha256:{old}" for old in range(1, number)))
        case ["create", *rest]:
            write(CONTAINER, json.dumps({"labels": values(rest, "--label")}))
        case ["rm", _]:
            os.remove(CONTAINER)
        case ["cp", source, _]:
            write(f"{FOLDER}/copied", read(source))
        case ["start", "--attach", _]:
            return int(read(f"{FOLDER}/exit_code")) if os.path.exists(f"{FOLDER}/exit_code") else 0
        case ["image", "rm", _]:
            pass
        case ["import", "-"]:
            print("sha256:empty")
        case ["run", "--rm", "--gpus", "all", "sha256:empty", program]:
            no_gpu = os.path.exists(f"{FOLDER}/no_gpu")
            reason = (
                'could not select device driver "" with capabilities: [[gpu]]' if no_gpu else f"{program}: no such file"
            )
            print(f"docker: Error response from daemon: {reason}.", file=sys.stderr)
            return 125 if no_gpu else 127
        case _:
            raise SystemExit(f"docker has no such call: {arguments}")
    return 0


if __name__ == "__main__":
    with open(f"{FOLDER}/calls.jsonl", "a") as record:
        record.write(json.dumps(sys.argv[1:]) + "\n")
    sys.exit(answer(sys.argv[1:]))
