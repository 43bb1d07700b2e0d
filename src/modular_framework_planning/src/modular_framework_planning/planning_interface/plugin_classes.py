# SPDX-License-Identifier: BSD-3-Clause
"""Imports the class that a parameter names as `module/Class`."""

from __future__ import annotations

import importlib
import re
from typing import Any

from modular_framework_planning.errors import ModelError, PlanningError


def plugin_class(path: str, where: str, known: str) -> Any:
    """Imports a class.

    Args:
        path: `module/Class`.
        where: the parameter and what it names, for the reason of a failure.
        known: what it may name, for the same.

    Raises:
        ModelError: there is none, or its module fails.
    """
    module, _, name = path.partition("/")
    if not re.fullmatch(r"[A-Za-z_][\w.]*", module) or not name.isidentifier():
        raise ModelError(f"{where} is not known; {known}")
    try:
        return getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError) as error:
        raise ModelError(f"{where} is not known ({error}); {known}") from error
    except PlanningError:
        raise
    except Exception as error:  # noqa: BLE001 - a user's module may fail in any way; the cause must be reported
        raise ModelError(f"{where}: its module fails with {type(error).__name__}: {error}; mend the module") from error
