# SPDX-License-Identifier: BSD-3-Clause
"""Root rights of the set-up script: sudo asks before the work, or an administrator gets one command to run."""

from __future__ import annotations

import contextlib
import os
import pty
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
PACKAGES = "apt-get update && apt-get install -y --no-install-recommends cmake rviz"
FAKES = {
    "id": "case $1 in -u) echo 1000 ;; *) echo tester ;; esac",
    "dpkg-query": "exit 1",
    "apt-get": 'echo "apt-get $1" >>"$CALLS"',
    "sudo": """
case $* in
  "-n true") [ -e "$CALLS.ticket" ] || exit 1 ;;
  -v)
    printf '[sudo] password for tester: ' >/dev/tty
    echo asked >>"$CALLS"
    [ -z "${REFUSES:-}" ] || exit 1
    [ -n "${FORGETS:-}" ] || touch "$CALLS.ticket"
    ;;
  "-n "*) shift; "$@" ;;
  *) echo "sudo $*" >>"$CALLS"; exit 9 ;;
esac""",
}


class Checkout:
    """A folder with the set-up script, a list of two Debian packages, and programs that record their calls."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.calls = folder, folder / "calls"
        (folder / "logs").mkdir()
        (folder / "install.sh").write_text((ROOT / "install.sh").read_text())
        (folder / "packages-debian.txt").write_text("cmake\nrviz\n")
        (folder / "bin").mkdir()
        for name, body in FAKES.items():
            program = folder / "bin" / name
            program.write_text(f"#!/bin/bash\n{body}\n")
            program.chmod(0o755)

    def without(self, program: str) -> None:
        """Hides a program: every folder of PATH is replaced by links to its other programs."""
        (self.folder / "bin" / program).unlink()
        for found in {**{path.name: path for path in Path("/bin").iterdir()}}.values():
            link = self.folder / "bin" / found.name
            if found.name != program and not link.exists():
                link.symlink_to(found)

    def command(self, path: str) -> tuple[list[str], dict[str, str]]:
        script = f"source {self.folder}/install.sh; install_debian_packages"
        return ["/bin/bash", "-c", script], {**os.environ, "PATH": path, "CALLS": str(self.calls)}

    def called(self) -> list[str]:
        return self.calls.read_text().splitlines() if self.calls.exists() else []


@pytest.fixture
def checkout(tmp_path: Path) -> Checkout:
    return Checkout(tmp_path)


def run_without_terminal(checkout: Checkout, path: str = "") -> subprocess.CompletedProcess[str]:
    command, env = checkout.command(path or f"{checkout.folder}/bin:{os.environ['PATH']}")
    return subprocess.run(command, env=env, capture_output=True, text=True, start_new_session=True, check=False)


def run_on_a_terminal(checkout: Checkout, **variables: str) -> tuple[int, str]:
    command, env = checkout.command(f"{checkout.folder}/bin:{os.environ['PATH']}")
    child, terminal = pty.fork()
    if child == 0:
        os.execve(command[0], command, {**env, **variables})
    seen = b""
    with contextlib.suppress(OSError):  # the terminal closes with the script
        while part := os.read(terminal, 4096):
            seen += part
    os.close(terminal)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), seen.decode()


def test_sudo_asks_for_the_password_once_before_the_first_step(checkout: Checkout) -> None:
    code, shown = run_on_a_terminal(checkout)
    assert code == 0, shown
    assert checkout.called() == ["asked", "apt-get update", "apt-get install"]
    before, _, after = shown.partition("[sudo] password for tester: ")
    assert "Installing 2 Debian packages needs root rights. sudo asks for your password now" in before
    assert "updating the package lists" not in before and "updating the package lists ... done" in after


def test_a_ticket_of_sudo_is_used_without_a_question(checkout: Checkout) -> None:
    Path(f"{checkout.calls}.ticket").touch()
    answer = run_without_terminal(checkout)
    assert answer.returncode == 0, answer.stderr
    assert checkout.called() == ["apt-get update", "apt-get install"]


@pytest.mark.parametrize(
    ("variables", "reason"),
    [({"REFUSES": "1"}, "sudo refused you"), ({"FORGETS": "1"}, "sudo asks for a password each time")],
)
def test_where_sudo_does_not_help_an_administrator_gets_one_command(
    checkout: Checkout, variables: dict[str, str], reason: str
) -> None:
    code, shown = run_on_a_terminal(checkout, **variables)
    assert code == 1 and reason in shown and PACKAGES in shown.splitlines()[-3].strip()
    assert checkout.called() == ["asked"]


def test_without_a_terminal_nobody_is_asked(checkout: Checkout) -> None:
    answer = run_without_terminal(checkout)
    assert answer.returncode == 1 and checkout.called() == []
    assert "there is no terminal to ask on" in answer.stderr
    assert f"\n    {PACKAGES}\n" in answer.stderr and "it goes on from there" in answer.stderr


def test_without_sudo_an_administrator_gets_one_command(checkout: Checkout) -> None:
    checkout.without("sudo")
    answer = run_without_terminal(checkout, f"{checkout.folder}/bin")
    assert answer.returncode == 1 and checkout.called() == []
    assert "sudo is missing" in answer.stderr and f"\n    {PACKAGES}\n" in answer.stderr


def check_owner(folder: Path) -> subprocess.CompletedProcess[str]:
    """Checks a checkout as a user who may write to it, but not to what root owns."""
    script = f"source {folder}/install.sh; check_owner && mkdir -p {folder}/logs && touch {folder}/logs/install.log"
    user = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"]
    return subprocess.run([*user, "bash", "-c", script], capture_output=True, text=True, cwd="/", check=False)


@pytest.fixture
def of_two_users(tmp_path: Path) -> Path:
    if os.getuid() != 0:
        pytest.skip("only root can make a checkout with files of two users")
    folder = tmp_path / "checkout"
    folder.mkdir()
    Checkout(folder)
    for path in (folder, *folder.parents[:3]):
        path.chmod(0o755)
    os.chown(folder, 65534, 65534)
    return folder


@pytest.mark.parametrize("of_user", [[], ["logs"], ["logs", "logs/tests"]], ids=["folder", "inner folder", "file"])
def test_logs_of_root_are_set_aside_with_a_word(of_two_users: Path, of_user: list[str]) -> None:
    """A run as root after one of the user leaves files of root in folders of the user."""
    (of_two_users / "logs" / "tests").mkdir()
    (of_two_users / "logs" / "tests" / "lint.log").write_text("of root")
    for name in of_user:
        os.chown(of_two_users / name, 65534, 65534)
    answer = check_owner(of_two_users)
    assert answer.returncode == 0, answer.stderr
    assert "You may not write to files of root in the folder logs. It is now logs_of_root_" in answer.stdout
    (aside,) = of_two_users.glob("logs_of_root_*")
    assert (aside / "tests" / "lint.log").read_text() == "of root"
    assert (of_two_users / "logs" / "install.log").exists()


def test_logs_of_the_user_stay_where_they_are(of_two_users: Path) -> None:
    (of_two_users / "logs" / "latest").symlink_to("/no/such/folder")
    (of_two_users / "logs" / "install.log").write_text("of the user")
    for path in (of_two_users / "logs", of_two_users / "logs" / "install.log"):
        os.chown(path, 65534, 65534)
    answer = check_owner(of_two_users)
    assert (answer.returncode, answer.stdout) == (0, ""), answer.stderr
    assert (of_two_users / "logs" / "install.log").read_text() == "of the user"


@pytest.mark.parametrize("name", [".venv", "build", "devel", "devel/lib", ".ruff_cache"])
def test_a_build_of_root_is_named_with_what_to_do(of_two_users: Path, name: str) -> None:
    (of_two_users / name).mkdir(parents=True)
    if "/" in name:
        os.chown((of_two_users / name).parent, 65534, 65534)
    os.chown(of_two_users / "logs", 65534, 65534)
    answer = check_owner(of_two_users)
    assert answer.returncode == 1
    assert f"{of_two_users}/{name} belongs to root" in answer.stderr and "sudo chown -R nobody" in answer.stderr
