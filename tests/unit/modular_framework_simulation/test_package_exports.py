# SPDX-License-Identifier: BSD-3-Clause
"""Models and media that ROS packages export for Gazebo are found."""

from __future__ import annotations

from pathlib import Path

from modular_framework_simulation.models.package_exports import MEDIA_EXPORT, MODEL_EXPORT, exported_folders


def test_folders_are_those_of_the_exports_and_broken_packages_are_passed_over(tmp_path: Path) -> None:
    texts = {
        "house": "<package><export><gazebo_ros gazebo_model_path='${prefix}/models:/other'/>"
        "<gazebo_ros gazebo_media_path='${prefix}'/></export></package>",
        "plain": "<package/>",
        "broken": "<package gazebo_model_path",
    }
    for name, text in texts.items():
        (tmp_path / name).mkdir()
        (tmp_path / name / "package.xml").write_text(text)
    packages = [tmp_path / name for name in (*texts, "absent")]
    assert exported_folders(packages, MODEL_EXPORT) == (tmp_path / "house" / "models", Path("/other"))
    assert exported_folders(packages, MEDIA_EXPORT) == (tmp_path / "house",)
