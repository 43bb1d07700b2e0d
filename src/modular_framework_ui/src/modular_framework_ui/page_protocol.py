# SPDX-License-Identifier: BSD-3-Clause
"""Messages between the server and the page, as JSON; `web/page.js` is the page.

The first message of a connection contains the whole state of the task. Each later message contains the changes since
the previous message. Times are in seconds of the server's clock; `now_s` is the time of the message.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from typing import Any

from modular_framework_ui.joint_history import JointSample, Quantity
from modular_framework_ui.recorded_task import ReplayError
from modular_framework_ui.task_state import TaskChanges

TIME_DIGITS, VALUE_DIGITS = 3, 5


def changes_text(changes: TaskChanges) -> str:
    """Returns the changes as a JSON message.

    The keys are the fields of `TaskChanges` except `revision`. The values of `runs`, `log` and `samples` are lists of
    entries with the additional key `index`. A sample has a list of values per `Quantity`, in the order of `joints`.
    """
    values: dict[str, Any] = {
        "now_s": changes.now_s,
        "task": asdict(changes.task) | {"phase": changes.task.phase.value},
        "drawing": changes.drawing,
        "viewer": changes.viewer,
        "runs": [asdict(run) | {"index": index} for index, run in changes.runs.items()],
        "oldest_run": changes.oldest_run,
        "log": [asdict(line) | {"index": index} for index, line in changes.log.items()],
        "oldest_line": changes.oldest_line,
        "joints": changes.joints,
        "samples": [_sample(index, sample) for index, sample in changes.samples.items()],
        "oldest_sample": changes.oldest_sample,
        "record": asdict(changes.record),
    }
    return json.dumps(values)


def fault_text(reason: str) -> str:
    """Returns the only message of a connection without a task, with the reason.

    Args:
        reason: Reason for the page, as a sentence.
    """
    return json.dumps({"fault": reason})


def shown_time(text: str | bytes) -> float | None:
    """Returns the time of a message from the page: `{"view_s": 1.5}`, or null for the end of the task.

    Args:
        text: JSON message.

    Raises:
        ReplayError: The message has other content.
    """
    try:
        message = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ReplayError("the message is not JSON") from error
    match message:
        case {"view_s": None}:
            return None
        case {"view_s": int() | float() as time_s} if math.isfinite(time_s):
            return float(time_s)
    raise ReplayError('a page may only send {"view_s": seconds or null}')


def _sample(index: int, sample: JointSample) -> dict[str, Any]:
    """Returns a sample with a list per quantity; the values are rounded, because samples are most of the messages."""
    values = zip(Quantity, sample.values, strict=True)
    return {"index": index, "time_s": round(sample.time_s, TIME_DIGITS)} | {
        quantity.value: [None if value is None else round(value, VALUE_DIGITS) for value in joints]
        for quantity, joints in values
    }
