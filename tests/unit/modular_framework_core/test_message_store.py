# SPDX-License-Identifier: BSD-3-Clause
"""The store behind every manager: names stay, the queue is first in, first out."""

from __future__ import annotations

import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st

from modular_framework_core.managers.message_store import MessageNotFoundError, MessageStore


@given(st.lists(st.one_of(st.integers(), st.none()), max_size=60))
def test_the_anonymous_queue_behaves_like_a_list_read_from_the_front(actions: list[int | None]) -> None:
    store: MessageStore[int] = MessageStore("number")
    model: list[int] = []
    for action in actions:
        if action is not None:
            store.add(action)
            model.append(action)
        elif model:
            assert store.get() == model.pop(0)
        else:
            with pytest.raises(MessageNotFoundError, match="No anonymous number"):
                store.get()
    assert store.anonymous_count() == len(model)


def test_a_named_message_is_overwritten_and_can_be_read_again_and_again() -> None:
    store: MessageStore[str] = MessageStore("word")
    assert not store.add("first", "name")
    assert store.add("second", "name")
    assert [store.get("name"), store.get("name")] == ["second", "second"]
    assert store.names() == ("name",)


def test_an_unknown_name_is_answered_with_the_names_there_are() -> None:
    store: MessageStore[str] = MessageStore("word")
    store.add("x", "known")
    with pytest.raises(MessageNotFoundError, match="No word named 'other'.*known"):
        store.get("other")


def test_of_many_long_names_only_the_nearest_are_listed() -> None:
    store: MessageStore[str] = MessageStore("word")
    for number in range(300):
        store.add("x", f"{number:03d}" + "y" * 300)
    with pytest.raises(MessageNotFoundError, match=r"'150x' is stored.* 150yyy.*nearest of 300") as refused:
        store.get("150x")
    assert len(str(refused.value)) < 1500


def test_no_anonymous_message_is_lost_or_doubled_between_threads() -> None:
    store: MessageStore[int] = MessageStore("number")
    for number in range(2000):
        store.add(number)
    taken: list[int] = []

    def take() -> None:
        for _ in range(500):
            taken.append(store.get())

    threads = [threading.Thread(target=take) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(20.0)
    assert sorted(taken) == list(range(2000))
    assert store.anonymous_count() == 0
