# SPDX-License-Identifier: BSD-3-Clause
"""Limits of options are declared once, in a constructor; check, schema and the state itself hold to them."""

from __future__ import annotations

import ast
import functools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal
from unittest.mock import MagicMock, Mock

import jsonschema
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from task_folders import TEMPLATES

from modular_framework_core.files.faults import TaskFault
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_annotations import from_annotation, from_hint
from modular_framework_core.state_api.option_limits import Finite, Length, Limits, Positive, Share, Vector
from modular_framework_core.state_api.option_types import ScalarType
from modular_framework_core.task_constructor.json_schema import task_schema
from modular_framework_core.task_constructor.loading import load_state_class
from modular_framework_core.task_constructor.pipeline import check_task, main
from modular_framework_core.task_constructor.state_catalogue import StateCatalogue
from modular_framework_core.task_constructor.template_catalogue import TemplateCatalogue

if TYPE_CHECKING:
    from somewhere.that.is_not import Thing

STATE = '''
from __future__ import annotations

from typing import Annotated

from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_limits import Length, Limits, NotNegative, Positive, Share, Vector

MOST = 5
Few = Annotated[int, Limits(at_least=1, at_most=MOST)]


class Reach(FrameworkState):
    """Reaches.

    Args:
        speed: How fast.
        tries: How often.
    """

    def __init__(self, speed: Share = 1.0, tries: Few = 1, spot: Vector | None = None, rest: NotNegative = 0.0,
                 below: Annotated[float, Limits(below=-2.5)] = -3.0, pair: Annotated[list[str], Length(2)] = ("a", "b"),
                 timeout: Positive | None = None, outcomes=("success", "fail")):
        super().__init__(outcomes)
        self.made_with = speed, tries, spot

    def execute(self, userdata):
        return self.succeed()
'''
TASK = (
    "name: t\nsource: state_machine\noutcomes: [success, fail]\nparams: {{far: 7.0}}\nstates:\n"
    "  - A: {{source: reach, {option}: {value}, transitions: {{success: success, fail: fail}}}}\n"
)
REFUSED = [
    ("speed", "3.0", "a number above 0 and at most 1, found the number 3.0; lower it to 1 or less"),
    ("speed", "0", "a number above 0 and at most 1, found the number 0; raise it above 0"),
    ("speed", ".nan", "a number above 0 and at most 1, found the number nan; write a finite number"),
    (
        "speed",
        "'0.5'",
        "a number above 0 and at most 1, found the text '0.5'; remove the quotes to make it a number",
    ),
    ("speed", "params.far", "a number above 0 and at most 1, found the number 7.0; lower it to 1 or less"),
    ("tries", "0", "a whole number of at least 1 and at most 5, found the number 0; raise it to 1 or more"),
    ("tries", "6", "a whole number of at least 1 and at most 5, found the number 6; lower it to 5 or less"),
    ("tries", "2.0", "a whole number of at least 1 and at most 5, found the number 2.0"),
    ("rest", "-1e-9", "a number of at least 0, found the number -1e-09; raise it to 0 or more"),
    ("rest", ".nan", "a number of at least 0, found the number nan; write a finite number"),
    ("rest", "-.inf", "a number of at least 0, found the number -inf; raise it to 0 or more"),
    ("speed", ".inf", "a number above 0 and at most 1, found the number inf; lower it to 1 or less"),
    ("below", ".inf", "a number below -2.5, found the number inf; lower it below -2.5"),
    ("tries", ".inf", "a whole number of at least 1 and at most 5, found the number inf; lower it to 5 or less"),
    ("rest", "1" + 400 * "0", f"a number of at least 0, found the number 1{400 * '0'}; write a finite number"),
    ("below", "-2.5", "a number below -2.5, found the number -2.5; lower it below -2.5"),
    ("timeout", "0", "a number above 0 or nothing (null), found the number 0; raise it above 0"),
    ("spot", "[1, 2]", "a list of 3 items, each item a finite number, or nothing (null), found a list of 2"),
    ("spot", "[1, .inf, 2]", "a finite number, found the number inf; write a finite number"),
    ("pair", "[a]", "a list of 2 items, each item a text, found a list of 1"),
]
ALLOWED = [
    ("speed", "1"),
    ("speed", "1e-9"),
    ("tries", "5"),
    ("rest", "0"),
    ("below", "-2.6"),
    ("timeout", "null"),
    ("timeout", "0.1"),
    ("timeout", ".inf"),
    ("rest", ".inf"),
    ("spot", "[1, 2.0, -3]"),
    ("spot", "[1, params.far, 3]"),
    ("spot", "null"),
    ("pair", "[a, b]"),
]


@pytest.fixture()
def states(tmp_path: Path) -> Path:
    folder = tmp_path / "states"
    folder.mkdir()
    (folder / "reach.py").write_text(STATE)
    return folder


def check(states: Path, option: str, value: str) -> list[str]:
    script = states.parent / "t.yaml"
    script.write_text(TASK.format(option=option, value=value))
    try:
        check_task(script, [states], [TEMPLATES])
    except TaskFault as error:
        return [str(fault).removeprefix(str(script)) for fault in error.faults]
    return []


@pytest.mark.parametrize(("option", "value", "expected"), REFUSED)
def test_a_value_beyond_the_limits_is_reported_before_the_run_with_its_place(
    states: Path, option: str, value: str, expected: str
) -> None:
    (found,) = check(states, option, value)
    assert found.startswith((":6:", ":4:"))
    assert found.endswith(f": state 'A' (reach): option '{option}' must be {expected}")


@pytest.mark.parametrize(("option", "value"), ALLOWED)
def test_a_value_within_the_limits_is_in_order(states: Path, option: str, value: str) -> None:
    assert check(states, option, value) == []


@pytest.mark.parametrize(
    ("option", "value", "expected"),
    [
        ("speed", 3.0, "must be a number above 0 and at most 1, found the number 3.0; lower it to 1 or less"),
        ("tries", 0, "must be a whole number of at least 1 and at most 5, found the number 0; raise it to 1 or more"),
        ("spot", np.array([1.0, 2.0]), "found a list of 2"),
        ("spot", (1.0, 2.0, math.inf), "found the number inf"),
        ("timeout", -1, "found the number -1"),
        ("speed", np.float32(1.5), "lower it to 1 or less"),
    ],
)
def test_the_same_limits_hold_where_a_state_is_made(states: Path, option: str, value: Any, expected: str) -> None:
    reach = load_state_class(str(states / "reach.py"), "Reach")
    with pytest.raises(ValueError, match=f"^Reach: option '{option}' must be .*") as caught:
        reach(**{option: value})
    assert expected in str(caught.value)


def test_all_options_beyond_their_limits_are_reported_together_and_good_ones_arrive(states: Path) -> None:
    reach = load_state_class(str(states / "reach.py"), "Reach")
    with pytest.raises(ValueError, match="option 'speed' .*; option 'tries' .*"):
        reach(2.0, 9)
    assert reach(0.5, tries=np.int64(2), spot=np.array([1.0, 2.0, 3.0])).made_with[:2] == (0.5, 2)
    with pytest.raises(TypeError, match="nonsense"):
        reach(nonsense=1)


def test_explain_and_schema_report_the_limits(states: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--explain", "reach", "", str(states), str(TEMPLATES)]) == 0
    page = capsys.readouterr().out
    assert "  speed: a number above 0 and at most 1, default 1.0\n      How fast." in page
    assert "  tries: a whole number of at least 1 and at most 5, default 1\n" in page
    schema = task_schema(StateCatalogue([states]), TemplateCatalogue([TEMPLATES]))
    options = schema["definitions"]["state_reach"]["properties"]
    assert options["speed"]["anyOf"][0] == {"type": "number", "exclusiveMinimum": 0.0, "maximum": 1.0}
    assert options["tries"]["anyOf"][0] == {"type": "integer", "minimum": 1, "maximum": 5}
    assert options["pair"]["anyOf"][0] | {"items": {}} == {"type": "array", "items": {}, "minItems": 2, "maxItems": 2}


bounds = st.one_of(st.none(), st.floats(-5.0, 5.0))


@given(
    st.builds(Limits, above=bounds, at_least=bounds, below=bounds, at_most=bounds),
    st.one_of(st.floats(-6.0, 6.0), st.sampled_from([math.inf, -math.inf])),
)
def test_schema_and_check_agree_about_every_number(limits: Limits, number: float) -> None:
    assume(limits.bounds() or math.isfinite(number))  # JSON itself knows no infinity
    valid = jsonschema.Draft7Validator(ScalarType("float", limits).schema()).is_valid(number)
    assert (limits.remedy(number) == "") == valid


@pytest.mark.parametrize(
    "text",
    [
        "float",
        "None",
        "Positive",
        "Finite | None",
        "Vector",
        "Share | Literal['all', 5]",
        "Sequence[Annotated[int, Limits(above=2)] | None]",
        "dict[str, Positive]",
        "Annotated[Annotated[float, Limits(above=1)], Limits(below=2)]",
        "Annotated[float, 'metres']",
        "Annotated[tuple[str, ...], Length(2)]",
        "Any",
        "Path",
        "list",
        "str | int | None",
    ],
)
def test_an_annotation_means_the_same_as_source_and_evaluated(text: str) -> None:
    names = {
        "Positive": "Annotated[float, Limits(above=0.0)]",
        "Finite": "Annotated[float, Limits()]",
        "Share": "Annotated[float, Limits(above=0.0, at_most=1.0)]",
        "Vector": "Annotated[Sequence[Annotated[float, Limits()]], Length(3)]",
    }
    aliases = {name: ast.parse(value, mode="eval").body for name, value in names.items()}
    known = {
        "Annotated": Annotated,
        "Limits": Limits,
        "Length": Length,
        "Literal": Literal,
        "Sequence": Sequence,
        "Positive": Positive,
        "Finite": Finite,
        "Share": Share,
        "Vector": Vector,
        "Any": Any,
        "Path": Path,
    }
    assert from_annotation(ast.parse(text, mode="eval").body, aliases) == from_hint(eval(text, known))


def test_limits_that_are_not_numbers_are_refused_where_they_are_written() -> None:
    with pytest.raises(TypeError, match="Limits: above is 'low'; write a number"):
        Limits(above="low")  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="Length: items is 2.5; write a whole number"):
        Length(2.5)  # type: ignore[arg-type]


class Loose(FrameworkState):
    def __init__(self, thing: Thing, speed: Share = 9.0, *more: float, keys: Sequence[str] | None = None) -> None:
        super().__init__()
        self.made_with = thing, speed, more


def test_what_no_task_can_hold_and_annotations_that_lead_nowhere_are_not_judged() -> None:
    thing = object()
    assert Loose(thing).made_with == (thing, 9.0, ())
    assert Loose("x", 1.0, 2.0).made_with == ("x", 1.0, (2.0,))
    assert Loose("x", keys={"a": 1}.keys()) is not None  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="Loose: option 'speed' must be a number above 0 and at most 1"):
        Loose(thing, 2.0)


class Made(FrameworkState):
    __init__ = functools.partialmethod(FrameworkState.__init__, ("done", "failed"))  # type: ignore[assignment]


def test_a_constructor_that_is_no_function_of_its_own_is_left_as_it_is() -> None:
    assert Made(io_keys=["a"]).outcomes == ["done", "failed"]


class Unsaid(FrameworkState):
    def __init__(self, state, arguments=None, options=None, speeds: list[Share] = (), timeout: float = None):  # type: ignore # noqa: RUF013
        super().__init__()
        self.made_with = state, arguments, options, timeout


class Deeper(Unsaid):
    def __init__(self, timeout: float = None) -> None:  # type: ignore[assignment] # noqa: RUF013
        super().__init__("x", timeout=timeout)


class _CallsHome:
    """Answers to every name with a remote call, as a proxy of XML-RPC does."""

    def __getattr__(self, name: str) -> Any:
        raise AssertionError(f"{name} was called")


@pytest.mark.parametrize("value", [Mock(), MagicMock(), _CallsHome()], ids=["mock", "magic", "proxy"])
def test_values_that_answer_to_every_name_are_not_asked(value: Any) -> None:
    made = Unsaid("x", value, options=value, speeds=value, timeout=value)
    assert made.made_with[1] is made.made_with[2] is made.made_with[3] is value
    assert Unsaid("x", speeds=[value]) is not None


def test_what_is_under_no_annotation_is_not_looked_at_and_a_list_within_itself_is_not_judged() -> None:
    endless: list[Any] = []
    endless.append(endless)
    assert Unsaid("x", endless, speeds=endless).made_with[1] is endless
    with pytest.raises(ValueError, match="option 'speeds' must be .* found the number 2.0"):
        Unsaid("x", speeds=np.array([0.5, 2.0]))


def test_an_option_may_have_any_name() -> None:
    assert Unsaid(state=1, arguments=2, options=3).made_with == (1, 2, 3, None)


def test_a_default_that_is_handed_on_is_not_judged() -> None:
    assert Deeper().made_with == Deeper(timeout=None).made_with == ("x", None, None, None)
    assert Deeper(timeout=2.0).made_with[3] == 2.0
    with pytest.raises(ValueError, match="Deeper: option 'timeout' must be a number, found the text 'long'"):
        Deeper(timeout="long")  # type: ignore[arg-type]
