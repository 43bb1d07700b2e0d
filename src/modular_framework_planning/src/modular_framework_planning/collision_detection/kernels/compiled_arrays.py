# SPDX-License-Identifier: BSD-3-Clause
"""Arrays without reference counting for compiled loops.

Whenever a tuple is passed to a function, numba atomically counts a reference for every array in the tuple. Reference
counting took two thirds of the time of collision checks.
"""

from __future__ import annotations

from typing import Any

from numba.core import cgutils, types
from numba.extending import intrinsic


def _without_owner(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """Generates code for the value without the owners of its arrays."""
    if isinstance(kind, types.BaseTuple):
        members: Any = kind
        unpack: Any = cgutils.unpack_tuple
        parts = zip(members.types, unpack(builder, value), strict=True)
        return context.make_tuple(builder, kind, [_without_owner(context, builder, *part) for part in parts])
    if not isinstance(kind, types.Array):
        return value
    view = context.make_array(kind)(context, builder, value)
    null: Any = cgutils.get_null_value
    view.meminfo, view.parent = null(view.meminfo.type), null(view.parent.type)
    return view._getvalue()


def _borrow(_: Any, kind: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _without_owner(context, builder, signature.args[0], arguments[0])

    return kind(kind), generate


borrowed: Any = intrinsic(_borrow)
"""Returns an array, or a tuple of arrays, without owners; the caller must keep the original alive meanwhile."""
