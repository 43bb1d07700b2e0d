# SPDX-License-Identifier: BSD-3-Clause
"""Import of plugin classes named `module/Class` in parameters."""

from __future__ import annotations

import importlib
import re
from typing import Any

from modular_framework_planning.errors import ModelError, PlanningError


def plugin_class(path: str, source_name: str, allowed: str) -> Any:
    """Returns a plugin class.

    Args:
        path: Class name as `module/Class`.
        source_name: Parameter and value, for error messages.
        allowed: Allowed values, for error messages.

    Raises:
        ModelError: The class does not exist, or its module cannot be imported.
    """
    module, _, name = path.partition("/")
    if not re.fullmatch(r"[A-Za-z_][\w.]*", module) or not name.isidentifier():
        raise ModelError(f"{source_name} is not known; {allowed}")
    try:
        return getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError) as error:
        raise ModelError(f"{source_name} is not known ({error}); {allowed}") from error
    except PlanningError:
        raise
    except Exception as error:  # noqa: BLE001 - a user's module may fail in any way; the cause must be reported
        raise ModelError(
            f"{source_name}: its module fails with {type(error).__name__}: {error}; fix the module"
        ) from error
