# SPDX-License-Identifier: BSD-3-Clause
"""A picture is drawn for subscribers alone, and a subscriber gets the last one."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
import rospy

from modular_framework_ros.publishing import PicturePublisher


class LatchedTopic:
    """rospy's latched publisher: a connection counts before the listener hears of it, then gets the latch."""

    def __init__(self, *_: Any, subscriber_listener: rospy.SubscribeListener, **__: Any) -> None:
        self.impl = SimpleNamespace(latch=None)
        self.connections, self.received = 0, []
        self._listener = subscriber_listener

    def get_num_connections(self) -> int:
        return self.connections

    def publish(self, message: Any) -> None:
        self.impl.latch = message
        self.received.append(message)

    def tell_listener(self) -> None:
        self._listener.peer_subscribe("picture", None, None)
        if self.impl.latch is not None:
            self.received.append(self.impl.latch)


@pytest.fixture
def picture(monkeypatch: pytest.MonkeyPatch) -> tuple[PicturePublisher, LatchedTopic]:
    topics: list[LatchedTopic] = []

    def made(*arguments: Any, **options: Any) -> LatchedTopic:
        topics.append(LatchedTopic(*arguments, **options))
        return topics[-1]

    monkeypatch.setattr(rospy, "Publisher", made)
    return PicturePublisher("picture", None), topics[0]


def test_a_picture_without_a_subscriber_is_drawn_for_the_first(picture: tuple[PicturePublisher, LatchedTopic]) -> None:
    publisher, topic = picture
    drawn: list[str] = []
    publisher.show(lambda: drawn.append("old") or "old")
    publisher.show(lambda: drawn.append("new") or "new")
    assert drawn == []
    topic.connections = 1
    topic.tell_listener()
    assert (drawn, topic.received) == (["new"], ["new"])


def test_an_old_picture_does_not_follow_a_new_one_to_the_first_subscriber(
    picture: tuple[PicturePublisher, LatchedTopic],
) -> None:
    publisher, topic = picture
    publisher.show(lambda: "old")
    topic.connections = 1
    publisher.show(lambda: "new")
    topic.tell_listener()
    assert topic.received == ["new", "new"]
