# SPDX-License-Identifier: BSD-3-Clause
"""Userdata: variables that states share, and a state's restricted view of them."""

from __future__ import annotations

import copy
import threading
from collections.abc import KeysView
from typing import Any

from smach import log
from smach.exceptions import InvalidUserCodeError
from smach.util import NameMap, Names

__all__ = ["Const", "Remapper", "UserData", "get_const"]


class _ItemsAsAttributes:
    """Provides items as attributes; names that start with an underscore are not items."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        try:
            return self[name]  # type: ignore[index]
        except KeyError:
            raise AttributeError(self._missing_key_text(name)) from None


class UserData(_ItemsAsAttributes):
    """Thread-safe named values, accessible as attributes or items."""

    def __init__(self) -> None:
        object.__setattr__(self, "_data", {})
        object.__setattr__(self, "_lock", threading.RLock())

    def update(self, ud: UserData) -> None:
        """Copies every value of other userdata, replacing values with the same name."""
        with self._lock:
            self._data.update(ud._data)

    def extract(self, keys: Names, remapping: NameMap) -> UserData:
        """Returns shallow copies of some values under other names.

        Args:
            keys: Names in this userdata.
            remapping: Name in this userdata, keyed by new name; names without an entry are kept.
        """
        renamed = {here: there for there, here in remapping.items()}
        if len(renamed) != len(remapping):
            log.error(f"userdata remapping {dict(remapping)} gives two names to one key; one of them is dropped")
        result = UserData()
        for key in keys:
            result[renamed.get(key, key)] = copy.copy(self[key])
        return result

    def merge(self, ud: UserData, keys: Names, remapping: NameMap) -> None:
        """Stores shallow copies of some values of other userdata.

        Args:
            ud: Source userdata.
            keys: Names in ``ud``.
            remapping: Name here, keyed by name in ``ud``; names without an entry are kept.
        """
        for key in keys:
            self[remapping.get(key, key)] = copy.copy(ud[key])

    def keys(self) -> KeysView[str]:
        """Returns the names of all values."""
        with self._lock:
            return dict(self._data).keys()

    def __contains__(self, key: object) -> bool:
        return key in self._data

    def __getitem__(self, key: str) -> Any:
        with self._lock:
            return self._data[key]

    def __setitem__(self, key: str, item: Any) -> None:
        with self._lock:
            self._data[key] = item

    def _missing_key_text(self, name: str) -> str:
        return f"userdata has no key '{name}'; it has: {sorted(self.keys())}"

    def __setattr__(self, name: str, value: Any) -> None:
        if name.startswith("_"):
            object.__setattr__(self, name, value)
        else:
            self[name] = value


def get_const(obj: Any) -> Any:
    """Returns a read-only proxy of an ordinary Python object, or the value itself without an instance dictionary.

    Numbers, strings, containers and messages (whose classes use slots) have no instance dictionary.
    """
    return Const(obj) if hasattr(obj, "__dict__") and not isinstance(obj, type) else obj


class Const:
    """A read-only proxy, which refuses changes of attributes and calls of methods."""

    __slots__ = ("_obj",)

    def __init__(self, obj: Any) -> None:
        object.__setattr__(self, "_obj", obj)

    def __getattr__(self, name: str) -> Any:
        value = getattr(object.__getattribute__(self, "_obj"), name)
        if callable(value):
            raise self._refusal(f"call '{name}' of")
        return get_const(value)

    def __setattr__(self, name: str, value: Any) -> None:
        raise self._refusal(f"set '{name}' of")

    def __delattr__(self, name: str) -> None:
        raise self._refusal(f"delete '{name}' of")

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        raise self._refusal("call")

    def __eq__(self, other: object) -> bool:
        mine = object.__getattribute__(self, "_obj")
        return bool(mine == (object.__getattribute__(other, "_obj") if isinstance(other, Const) else other))

    def __hash__(self) -> int:
        return hash(object.__getattribute__(self, "_obj"))

    def __bool__(self) -> bool:
        return bool(object.__getattribute__(self, "_obj"))

    def __repr__(self) -> str:
        return f"Const({object.__getattribute__(self, '_obj')!r})"

    def _refusal(self, action: str) -> TypeError:
        kind = type(object.__getattribute__(self, "_obj")).__name__
        return TypeError(
            f"a state tried to {action} a {kind} that it declared as an input key only, which makes it read-only; "
            "declare the key in io_keys to use the object itself"
        )


class Remapper(_ItemsAsAttributes):
    """A state's view of its container's userdata: the declared keys under the state's names."""

    def __init__(
        self, ud: Any, input_keys: Names = (), output_keys: Names = (), remapping: NameMap | None = None
    ) -> None:
        """Creates the view of a state.

        Args:
            ud: Userdata of the container.
            input_keys: Readable names.
            output_keys: Writable names; a key that is input and output gives the object itself.
            remapping: Name in ``ud``, keyed by the state's name; names without an entry are equal.
        """
        object.__setattr__(self, "_ud", ud)
        object.__setattr__(self, "_input_keys", tuple(input_keys))
        object.__setattr__(self, "_output_keys", tuple(output_keys))
        object.__setattr__(self, "_remapping", dict(remapping or {}))

    def _remap(self, key: str) -> str:
        return self._remapping.get(key, key)

    def __getitem__(self, key: str) -> Any:
        if key not in self._input_keys:
            raise InvalidUserCodeError(
                f"userdata key '{key}' was read, but the state declares as input only: {list(self._input_keys)}; "
                "add it to input_keys or io_keys"
            )
        value = self._ud[self._remap(key)]
        return value if key in self._output_keys else get_const(value)

    def __setitem__(self, key: str, value: Any) -> None:
        if key not in self._output_keys:
            raise InvalidUserCodeError(
                f"userdata key '{key}' was written, but the state declares as output only: "
                f"{list(self._output_keys)}; add it to output_keys or io_keys"
            )
        self._ud[self._remap(key)] = value

    def keys(self) -> list[str]:
        """Returns the declared keys (under the state's names) that have a value."""
        declared = dict.fromkeys([*self._input_keys, *self._output_keys])
        return [key for key in declared if self._remap(key) in self._ud]

    def __contains__(self, key: object) -> bool:
        return isinstance(key, str) and key in self._input_keys and self._remap(key) in self._ud

    def _missing_key_text(self, name: str) -> str:
        return f"userdata key '{name}' has no value yet (it is called '{self._remap(name)}' in the container)"

    def __setattr__(self, name: str, value: Any) -> None:
        self[name] = value
