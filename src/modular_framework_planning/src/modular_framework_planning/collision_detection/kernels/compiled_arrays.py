# SPDX-License-Identifier: BSD-3-Clause
"""Arrays that compiled loops use without counting references.

Numba counts a reference, atomically, to every array of a tuple at every call that takes the tuple. In the collision
checks that took two thirds of the time.
"""

from __future__ import annotations

from typing import Any

from numba.core import cgutils
from numba.extending import intrinsic


def _borrow(typing_context: Any, array: Any) -> Any:  # noqa: ARG001 - numba calls it with the context

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        view = context.make_array(signature.args[0])(context, builder, arguments[0])
        null: Any = cgutils.get_null_value
        view.meminfo, view.parent = null(view.meminfo.type), null(view.parent.type)
        return view._getvalue()  # noqa: SLF001 - numba's way to read a struct

    return array(array), generate


borrowed: Any = intrinsic(_borrow)
"""Returns an array without an owner: whoever has the owning one must keep it as long as this one is used."""
