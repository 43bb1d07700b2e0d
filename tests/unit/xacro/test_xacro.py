# SPDX-License-Identifier: BSD-3-Clause
"""The xacro command finds ROS 1 packages and is not in the way of the PyPI module of its name."""

import subprocess
from pathlib import Path
from xml.etree import ElementTree

import pytest
import rospkg
import xacro
from xacro_rospkg import PackageNotFoundError, expand

ROBOT = """<robot name="sample" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="length" default="1"/>
  <link name="rod_$(arg length)"/>
  <link name="{link}"/>
</robot>
"""


@pytest.fixture
def robot_file(tmp_path: Path) -> Path:
    path = tmp_path / "sample.urdf.xacro"
    path.write_text(ROBOT.format(link="$(find ur5_ezgripper_robot)"))
    return path


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["rosrun", "xacro", "xacro", *arguments], capture_output=True, text=True, timeout=60)


def test_find_answers_with_the_folder_rospkg_knows(robot_file: Path) -> None:
    links = [link.get("name") for link in ElementTree.fromstring(expand(robot_file)).iter("link")]
    assert links[1] == rospkg.RosPack().get_path("ur5_ezgripper_robot")


def test_mappings_replace_default_arguments(robot_file: Path) -> None:
    assert 'name="rod_7"' in expand(robot_file, {"length": "7"})


def test_an_unknown_package_is_named_with_similar_ones(tmp_path: Path) -> None:
    path = tmp_path / "lost.xacro"
    path.write_text(ROBOT.format(link="$(find ur5_ezgriper_robot)"))
    with pytest.raises(PackageNotFoundError) as caught:
        expand(path)
    assert caught.value.package == "ur5_ezgriper_robot"
    assert "ur5_ezgripper_robot" in caught.value.similar
    assert "setup.bash" in str(caught.value)


def test_other_mistakes_stay_errors_of_xacro(tmp_path: Path) -> None:
    path = tmp_path / "wrong.xacro"
    path.write_text(ROBOT.format(link="$(arg undeclared)"))
    with pytest.raises(xacro.XacroException, match="undeclared"):
        expand(path)


def test_the_command_takes_arguments_and_ignores_inorder(robot_file: Path) -> None:
    result = run("--inorder", str(robot_file), "length:=3")
    assert result.returncode == 0
    assert 'name="rod_3"' in result.stdout
    assert result.stderr == ""


def test_the_command_fails_clearly_on_an_unknown_package(tmp_path: Path) -> None:
    path = tmp_path / "lost.xacro"
    path.write_text(ROBOT.format(link="$(find no_such_package)"))
    result = run(str(path))
    assert result.returncode != 0
    assert "no ROS package 'no_such_package'" in result.stderr


def test_launch_files_find_the_command_under_the_package() -> None:
    result = subprocess.run(
        ["roslaunch", "--dump-params", "ur5_ezgripper_robot", "ur5_upload.launch"],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert result.returncode == 0
    assert "ur5_with_ezgripper" in result.stdout


def test_importing_xacro_gives_the_pypi_module() -> None:
    assert "site-packages" in str(xacro.__file__)


def test_an_unsupported_xacro_is_refused_by_name(robot_file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(xacro.substitution_args, "_eval_find")
    with pytest.raises(RuntimeError, match="requirements.txt"):
        expand(robot_file)
