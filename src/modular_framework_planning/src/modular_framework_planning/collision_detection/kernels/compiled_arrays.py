# SPDX-License-Identifier: BSD-3-Clause
"""Array views without reference counting, for compiled loops.

When a tuple is passed to a function, numba changes the reference count of every array in the tuple by an atomic
operation. These operations took two thirds of the time of a collision check.
"""

from __future__ import annotations

from typing import Any

from numba.core import cgutils, types
from numba.extending import intrinsic


def _without_owner(context: Any, builder: Any, numba_type: Any, value: Any) -> Any:
    """Generates code that removes the owner of an array, or of every array in a tuple."""
    if isinstance(numba_type, types.BaseTuple):
        tuple_type: Any = numba_type
        unpack: Any = cgutils.unpack_tuple
        members = zip(tuple_type.types, unpack(builder, value), strict=True)
        return context.make_tuple(builder, numba_type, [_without_owner(context, builder, *each) for each in members])
    if not isinstance(numba_type, types.Array):
        return value
    view = context.make_array(numba_type)(context, builder, value)
    null: Any = cgutils.get_null_value
    view.meminfo, view.parent = null(view.meminfo.type), null(view.parent.type)
    return view._getvalue()


def _borrow(_: Any, numba_type: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _without_owner(context, builder, signature.args[0], arguments[0])

    return numba_type(numba_type), generate


borrowed: Any = intrinsic(_borrow)
"""Returns views of an array, or of the arrays in a tuple; the caller must keep the originals alive."""
