# SPDX-License-Identifier: BSD-3-Clause
"""Where the engine is missing the deployer offers to install it: a terminal is asked, an option decides without one."""

from __future__ import annotations

import os
import pty
import shutil
import subprocess
from pathlib import Path

import pytest
from deployer import DEPLOY, STAND_IN, Deployer, add_command

NEEDED = "bash awk cat chmod cut dirname env find grep id mkdir mktemp rm sed stat tr uname".split()


@pytest.fixture
def bare(docker: Deployer) -> Deployer:
    """A computer whose commands are those that the script needs; apt-get "installs" the recording docker."""
    folder = docker.folder / "bin"
    (folder / "docker").unlink()
    for name in NEEDED:
        (folder / name).symlink_to(str(shutil.which(name)))
    log = docker.folder / "installed"
    install = f"[ $1 != install ] || {{ cat {STAND_IN} > {folder}/docker; chmod 755 {folder}/docker; }}"
    add_command(folder, "apt-get", f'echo "apt-get $*" >> {log}; {install}')
    add_command(folder, "usermod", f'echo "usermod $*" >> {log}')
    add_command(folder, "sudo", '"$@"')
    docker.path = str(folder)
    docker.env = {"SUDO_USER": "ada"}
    return docker


def installed(deployer: Deployer) -> list[str]:
    log = deployer.folder / "installed"
    return log.read_text().splitlines() if log.exists() else []


def run_in_terminal(deployer: Deployer, answer: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Runs the deployer with a terminal whose user types an answer."""
    terminal, end = pty.openpty()
    os.write(terminal, answer.encode())
    try:
        return deployer.run("container_name=mbf", "nvidia=false", *arguments, stdin=end)
    finally:
        os.close(terminal)
        os.close(end)


def test_without_a_terminal_nothing_is_installed(bare: Deployer) -> None:
    error = bare.refusal()
    assert "docker is missing" in error and "docker.io" in error and "install_engine=yes" in error
    assert not installed(bare)


def test_the_option_installs_without_a_terminal_and_goes_on(bare: Deployer) -> None:
    bare.deploy("install_engine=yes")
    assert installed(bare) == ["apt-get update", "apt-get install -y docker.io", "usermod -aG docker ada"]
    assert bare.calls("start --attach mbf")


@pytest.mark.parametrize("answer", ["y\n", "YES\n"])
def test_a_terminal_is_asked_and_yes_installs(bare: Deployer, answer: str) -> None:
    result = run_in_terminal(bare, answer)
    assert result.returncode == 0 and "group docker" in result.stdout and "Install it now? [y/N]" in result.stderr
    assert "apt-get install -y docker.io" in installed(bare) and bare.calls("start --attach mbf")


@pytest.mark.parametrize("answer", ["n\n", "\n", "maybe\n"])
def test_a_terminal_is_asked_and_anything_but_yes_installs_nothing(bare: Deployer, answer: str) -> None:
    result = run_in_terminal(bare, answer)
    assert result.returncode == 1 and "docker is missing" in result.stderr and not installed(bare)


def test_the_option_no_does_not_ask(bare: Deployer) -> None:
    result = run_in_terminal(bare, "y\n", "install_engine=no")
    assert result.returncode == 1 and "Install it now" not in result.stderr and not installed(bare)


def test_a_login_that_is_not_in_the_new_group_goes_on_in_a_shell_that_is(bare: Deployer) -> None:
    (bare.folder / "off").touch()
    add_command(
        bare.folder / "bin", "sg", f'echo "sg $*" >> {bare.folder}/installed; rm {bare.folder}/off; exec bash -c "$3"'
    )
    bare.deploy("install_engine=yes", "simulation_starting_pose:=-J a 1")
    assert installed(bare)[-1].startswith(f"sg docker -c {DEPLOY} container_name=mbf nvidia=false install_engine=yes")
    assert (bare.folder / "copied").read_bytes() == b"simulation_starting_pose:=-J a 1\0"
    assert len(bare.calls("start")) == 1


def test_on_other_systems_the_user_installs_it(bare: Deployer) -> None:
    Path(bare.folder / "bin" / "apt-get").unlink()
    assert "installs it on Debian and Ubuntu only" in bare.refusal("install_engine=yes")
