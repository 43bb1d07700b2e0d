# SPDX-License-Identifier: BSD-3-Clause
"""Reads YAML with rosparam's notation of angles, without executing text of the file.

rosparam evaluates `!degrees 90`, `deg(90)`, `!radians pi/2` and `rad(pi/2)` by `eval`.
"""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable
from typing import Any

import yaml

_OPERATORS: dict[type[ast.AST], Callable[..., float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}


class AngleLoader(yaml.SafeLoader):
    """Safe YAML loader that also reads rosparam's angles."""


def _value(node: ast.expr) -> float:
    """Returns the value of an expression of numbers, pi and + - * /; raises ValueError for all other expressions."""
    match node:
        case ast.Constant(value=int() | float() as number):
            return float(number)
        case ast.Name(id="pi"):
            return math.pi
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
            return _OPERATORS[type(op)](_value(left), _value(right))
        case ast.UnaryOp(op=op, operand=operand) if type(op) in _OPERATORS:
            return _OPERATORS[type(op)](_value(operand))
    raise ValueError


def _angle(loader: AngleLoader, node: yaml.nodes.ScalarNode) -> float:
    text = str(loader.construct_scalar(node)).strip()
    inner = text[4:-1] if text.startswith(("deg(", "rad(")) and text.endswith(")") else text
    try:
        value = _value(ast.parse(inner.strip(), mode="eval").body)
    except (SyntaxError, ValueError, ZeroDivisionError, RecursionError):
        raise yaml.constructor.ConstructorError(
            None, None, f"'{text}' is not an angle; allowed: numbers, pi, + - * /", node.start_mark
        ) from None
    return math.radians(value) if node.tag == "!degrees" else value


for _tag, _word in (("!degrees", "deg"), ("!radians", "rad")):
    AngleLoader.add_constructor(_tag, _angle)
    AngleLoader.add_implicit_resolver(_tag, re.compile(rf"^{_word}\([^)]*\)$"), [_word[0]])


def parse_yaml(text: str) -> Any:
    """Returns the content of a YAML text; raises yaml.YAMLError."""
    return yaml.load(text, Loader=AngleLoader)
