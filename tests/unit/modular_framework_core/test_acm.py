# SPDX-License-Identifier: BSD-3-Clause
"""The allowed collision matrix: only the pairs that were asked for change, and forbidding restores the reference."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from modular_framework_core.managers.acm import AcmManager, object_id
from modular_framework_core.managers.collision_matrix import AcmError, CollisionMatrix

NAMES = ("base", "arm", "palm", "finger_1", "finger_2")
ADJACENT = {("base", "arm"), ("arm", "palm"), ("palm", "finger_1"), ("palm", "finger_2")}


def reference() -> CollisionMatrix:
    def touches(a: str, b: str) -> bool:
        return (a, b) in ADJACENT or (b, a) in ADJACENT

    return CollisionMatrix(NAMES, tuple(tuple(touches(a, b) for b in NAMES) for a in NAMES), ("octomap",), (True,))


def manager() -> AcmManager:
    made = AcmManager()
    made.set_initial(reference(), [2, 3, 4])
    return made


def test_without_a_reference_every_question_is_refused() -> None:
    for ask in (
        AcmManager().current,
        AcmManager().reinitialise,
        lambda: AcmManager().allow_self_collision(True),
        lambda: AcmManager().allow_object_collision([], True),
    ):
        with pytest.raises(AcmError, match="set_init_acm"):
            ask()


def test_allowing_objects_when_there_are_none_changes_nothing_and_says_so() -> None:
    answer = manager().allow_object_collision([], True)
    assert answer.matrix == reference()
    assert any("No object was added" in warning for warning in answer.warnings)


def test_self_collision_before_any_update_allows_exactly_the_manipulator_and_restores_it() -> None:
    made = manager()
    allowed = made.allow_self_collision(True).matrix
    assert allowed.is_allowed("finger_1", "finger_2")
    assert not allowed.is_allowed("base", "palm")
    assert made.allow_self_collision(False).matrix == reference()


def test_allowing_an_object_touches_neither_the_hand_itself_nor_other_objects() -> None:
    made = manager()
    made.add_object("box")
    made.add_object("can")
    matrix = made.allow_object_collision(["box"], True).matrix
    assert all(matrix.is_allowed(link, "box__link") for link in ("palm", "finger_1", "finger_2"))
    assert not matrix.is_allowed("arm", "box__link")
    assert not matrix.is_allowed("finger_1", "can__link")
    assert not matrix.is_allowed("box__link", "can__link")
    assert not matrix.is_allowed("finger_1", "finger_2")


def test_forbidding_an_object_keeps_the_pairs_of_the_robot_description() -> None:
    made = manager()
    made.add_object("box")
    before = made.current().matrix
    made.allow_object_collision([], True)
    assert made.allow_object_collision([], False).matrix == before


def test_earlier_objects_are_not_touched_by_later_requests() -> None:
    made = manager()
    made.add_object("first")
    made.allow_object_collision(["first"], True)
    made.allow_object_collision(["first"], False)
    made.add_object("second")
    matrix = made.allow_object_collision(["second"], True).matrix
    assert not matrix.is_allowed("palm", "first__link")
    assert matrix.is_allowed("palm", "second__link")


def test_links_of_any_name_belong_to_their_model() -> None:
    made = manager()
    made.add_object("shelf__left")
    made.add_object("shelf__right")
    matrix = made.allow_object_collision(["shelf"], True).matrix
    assert matrix.is_allowed("palm", "shelf__left")
    assert matrix.is_allowed("palm", "shelf__right")
    assert object_id("box") == "box__link"


def test_objects_may_come_before_the_reference_and_stay_after_a_new_start() -> None:
    made = AcmManager()
    assert made.add_object("early") == ""
    made.set_initial(reference(), [2, 3, 4])
    made.allow_object_collision([], True)
    made.reinitialise()
    matrix = made.current().matrix
    assert "early__link" in matrix.names
    assert not matrix.is_allowed("palm", "early__link")


def test_a_double_object_and_an_unknown_one_are_warned_of() -> None:
    made = manager()
    made.add_object("box")
    assert "already" in made.add_object("box")
    assert made.current().matrix.names.count("box__link") == 1
    assert "nothing was removed" in made.delete_object("other")
    assert made.delete_object("box") == ""
    assert made.current().matrix == reference()
    assert any("'gone'" in warning for warning in made.allow_object_collision(["gone"], True).warnings)


def test_manipulator_links_follow_the_latest_reference() -> None:
    made = manager()
    made.add_object("box")
    made.set_initial(reference(), [1])
    matrix = made.allow_object_collision([], True).matrix
    assert matrix.is_allowed("arm", "box__link")
    assert not matrix.is_allowed("palm", "box__link")
    made.set_initial(reference(), [], "finger")
    assert made.allow_object_collision([], True).matrix.is_allowed("finger_2", "box__link")


def test_wrong_indices_and_matrices_are_refused() -> None:
    with pytest.raises(AcmError, match="5 entries"):
        AcmManager().set_initial(reference(), [7])
    with pytest.raises(AcmError, match="square"):
        CollisionMatrix(("a", "b"), ((True,), (False,)))
    with pytest.raises(AcmError, match="twice"):
        CollisionMatrix(("a", "a"), ((True, True), (True, True)))
    with pytest.raises(AcmError, match="empty"):
        manager().add_object("")


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["add", "delete", "allow", "forbid", "self", "reinit"]), st.sampled_from(["a", "b", "c__d"])
        ),
        max_size=25,
    )
)
def test_after_any_history_the_matrix_is_square_symmetric_and_forbidding_restores_it(history) -> None:
    made = manager()
    objects: set[str] = set()
    for action, name in history:
        match action:
            case "add":
                made.add_object(name)
                objects.add(object_id(name))
            case "delete":
                made.delete_object(name)
                objects.discard(object_id(name))
            case "allow" | "forbid":
                made.allow_object_collision([name], action == "allow")
            case "self":
                made.allow_self_collision(True)
            case _:
                made.reinitialise()
    matrix = made.current().matrix
    assert set(matrix.names) == set(NAMES) | objects
    assert matrix.rows == tuple(zip(*matrix.rows, strict=True))
    made.allow_self_collision(False)
    restored = made.allow_object_collision([], False).matrix
    assert [[restored.is_allowed(a, b) for b in NAMES] for a in NAMES] == [list(row) for row in reference().rows]


def test_any_links_may_be_chosen_instead_of_the_manipulators() -> None:
    made = manager()
    made.add_object("box")
    matrix = made.allow_object_collision(["box"], True, ["arm"]).matrix
    assert matrix.is_allowed("arm", "box__link") and not matrix.is_allowed("palm", "box__link")
    matrix = made.allow_self_collision(True, ["base", "finger_1"]).matrix
    assert matrix.is_allowed("base", "finger_1") and not matrix.is_allowed("finger_1", "finger_2")
    assert made.permissions() == {frozenset(("arm", "box__link")), frozenset(("base", "finger_1"))}
    made.allow_object_collision([], False, ["arm"])
    assert made.allow_self_collision(False, ["base", "finger_1", "arm"]).matrix.is_allowed("base", "arm")
    assert made.permissions() == frozenset()


def test_links_that_are_not_there_are_named_with_those_that_are() -> None:
    for ask in (
        lambda: manager().allow_self_collision(True, ["plam"]),
        lambda: manager().allow_object_collision([], True, ["plam"]),
    ):
        with pytest.raises(AcmError, match="no link 'plam'; it has base, arm, palm.*did you mean 'palm'"):
            ask()


def test_a_permission_ends_with_its_object_and_with_a_new_beginning() -> None:
    made = manager()
    made.add_object("box")
    made.allow_object_collision([], True)
    assert len(made.permissions()) == 3
    made.delete_object("box")
    assert made.permissions() == frozenset()
    made.allow_self_collision(True)
    assert made.permissions() == {frozenset(("finger_1", "finger_2"))}
    made.reinitialise()
    assert made.permissions() == frozenset()


def test_an_object_that_left_the_simulation_takes_its_permissions_along() -> None:
    made = manager()
    made.add_object("box")
    made.add_object("outer::can__link")
    assert made.remove_missing(["table"]) == [], "not spawned yet"
    assert made.remove_missing(["table", "box", "outer::can"]) == []
    made.allow_object_collision(["box"], True)
    assert made.remove_missing(["table", "outer::can"]) == ["box__link"]
    assert made.objects == ("outer::can__link",)
    assert made.permissions() == frozenset()
    made.add_object("box")
    assert not made.current().matrix.is_allowed("palm", "box__link")
