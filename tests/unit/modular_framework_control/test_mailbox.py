# SPDX-License-Identifier: BSD-3-Clause
"""The mailbox between other threads and the control loop: nothing is lost, nothing is taken twice."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest

from modular_framework_control.realtime.mailbox import Mailbox

ITEMS = 1_000_000


def test_orders_are_taken_in_sequence_those_put_in_meanwhile_included() -> None:
    mailbox: Mailbox[str] = Mailbox()
    assert list(mailbox.drain()) == []
    mailbox.put("first")
    mailbox.put("second")
    taken = []
    for item in mailbox.drain():
        taken.append(item)
        if item == "first":
            mailbox.put("put in meanwhile")
    assert taken == ["first", "second", "put in meanwhile"]
    assert list(mailbox.drain()) == []


def test_an_order_that_cannot_be_carried_out_stays_before_those_that_wait() -> None:
    mailbox: Mailbox[int] = Mailbox()
    for item in (0, 1, 2):
        mailbox.put(item)
    with pytest.raises(ZeroDivisionError):
        mailbox.process(lambda item: None if item == 0 else print(item / 0))
    assert list(mailbox.drain()) == [1, 2]


@pytest.fixture
def frequent_switches() -> Iterator[None]:
    """Threads take turns as often as they can, so that they meet within any step that can be divided."""
    usual_s = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(usual_s)


@pytest.mark.usefixtures("frequent_switches")
def test_orders_that_two_threads_take_while_another_puts_are_each_taken_once() -> None:
    mailbox: Mailbox[int] = Mailbox()
    all_are_in = threading.Event()

    def put() -> None:
        for item in range(ITEMS):
            mailbox.put(item)
        all_are_in.set()

    def take() -> list[int]:
        taken: list[int] = []
        while not all_are_in.is_set():
            taken.extend(mailbox.drain())
        return taken

    with ThreadPoolExecutor() as threads:
        takers = [threads.submit(take), threads.submit(take)]
        threads.submit(put).result(30.0)
    assert sorted([*takers[0].result(), *takers[1].result(), *mailbox.drain()]) == list(range(ITEMS))
