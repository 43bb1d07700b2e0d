# SPDX-License-Identifier: BSD-3-Clause
"""What a robot looks like is kept for the markers, beside what Pinocchio reads."""
from __future__ import annotations

import numpy as np
import pytest

from modular_framework_planning.errors import ModelError
from modular_framework_planning.shapes import Box, Cylinder, Sphere
from modular_framework_planning.urdf_document import load_urdf

URDF = """<robot name="r"><link name="a">
<visual><origin xyz="0 0 0.5"/><geometry><box size="0.1 0.2 0.3"/></geometry></visual>
<visual><geometry><cylinder radius="0.1" length="0.4"/></geometry></visual>
<visual><geometry><sphere radius="0.2"/></geometry></visual>
<visual><geometry><mesh filename="package://p/m.dae" scale="2 2 2"/></geometry></visual>
</link></robot>"""


def test_primitives_and_meshes_of_a_link_are_kept_with_their_poses() -> None:
    document = load_urdf(URDF)
    shapes = document.visual_shapes["a"]
    assert [type(shape) for shape, _ in shapes] == [Box, Cylinder, Sphere]
    sizes = [tuple(getattr(shape, name) for name in shape.__match_args__) for shape, _ in shapes]
    assert sizes == [(0.1, 0.2, 0.3), (0.4, 0.1), (0.2,)]
    assert np.allclose(shapes[0][1].translation, [0.0, 0.0, 0.5])
    (uri, pose, scale), = document.visual_meshes["a"]
    assert (uri, scale) == ("package://p/m.dae", (2.0, 2.0, 2.0)) and np.allclose(pose.homogeneous, np.eye(4))


def test_a_size_that_is_no_number_is_refused_and_named() -> None:
    with pytest.raises(ModelError, match="link 'a'.*'0.1 wide 0.3'"):
        load_urdf(URDF.replace("0.1 0.2 0.3", "0.1 wide 0.3"))
