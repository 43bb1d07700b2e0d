# SPDX-License-Identifier: BSD-3-Clause
"""With the environment of install.sh nodes listen on the loopback interface; the exception is known and counted."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from urllib.parse import urlparse

import rosgraph
import rospy

from modular_framework_testing.ros_session import RosSession, until

ROOT = Path(__file__).parents[2]
LISTENING = "0A"  # state of a socket in /proc/net/tcp
LOOPBACK = ("7F", "00000000000000000000000001000000")  # 127.*, ::1, as /proc writes them (bytes swapped)
CPP_NODES = {"/rosout", "/robot_state_publisher"}
LAUNCH = """<launch>
  <param name="robot_description" value="&lt;robot name='rod'&gt;&lt;link name='rod'/&gt;&lt;/robot&gt;"/>
  <node pkg="robot_state_publisher" type="robot_state_publisher" name="robot_state_publisher"/>
  <node pkg="joint_state_publisher" type="joint_state_publisher" name="joint_state_publisher"/>
</launch>"""


def test_the_environment_of_install_sh_binds_nodes_to_this_computer() -> None:
    script = f"source {ROOT}/install.sh; source_workspace; echo $ROS_IP ${{ROS_HOSTNAME:-}}"
    environment = {name: value for name, value in os.environ.items() if name not in ("ROS_IP", "ROS_HOSTNAME")}
    answer = subprocess.run(["bash", "-c", script], env=environment, capture_output=True, text=True, check=True)
    assert answer.stdout.split() == ["127.0.0.1"]


def sockets_of(pid: int) -> set[str]:
    """Inodes of a process's sockets."""
    links = (os.readlink(entry) for entry in Path(f"/proc/{pid}/fd").iterdir() if entry.is_symlink())
    return {link[len("socket:[") : -1] for link in links if link.startswith("socket:[")}


def open_ports(pid: int) -> set[int]:
    """TCP ports at which a process listens on more than the loopback interface."""
    own, ports = sockets_of(pid), set()
    for table in (Path("/proc/net/tcp"), Path("/proc/net/tcp6")):
        for line in table.read_text().splitlines()[1:] if table.exists() else ():
            fields = line.split()
            address, port = fields[1].split(":")
            loopback = address == LOOPBACK[1] or (len(address) == 8 and address[6:] == LOOPBACK[0])
            if fields[3] == LISTENING and fields[9] in own and not loopback:
                ports.add(int(port, 16))
    return ports


def test_only_the_xml_rpc_ports_of_cpp_nodes_are_open(session: RosSession) -> None:
    os.environ.update({name: session.env[name] for name in ("ROS_MASTER_URI", "ROS_IP", "ROS_HOME", "ROS_LOG_DIR")})
    session.start_master()
    session.launch(LAUNCH)
    rospy.init_node("test", disable_signals=True)
    master = rosgraph.Master("/test_sockets", master_uri=session.env["ROS_MASTER_URI"])
    wanted = CPP_NODES | {"/joint_state_publisher"}

    def publishing() -> set[str]:
        return {node for topic, nodes in master.getSystemState()[0] for node in nodes if topic != "/rosout"}

    until(lambda: wanted - {"/rosout"} <= publishing(), "the nodes publish", 60.0)
    uris = {node: urlparse(master.lookupNode(node)) for node in wanted}
    assert {uri.hostname for uri in uris.values()} == {"127.0.0.1"}
    for node, uri in uris.items():
        assert open_ports(owner_of(uri.port)) == ({uri.port} if node in CPP_NODES else set()), node
    assert open_ports(owner_of(session.port)) == set(), "the master"
    assert open_ports(os.getpid()) == set(), "this node"


def owner_of(port: int | None) -> int:
    """The process that listens at a port of this computer."""
    rows = (line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:])
    inode = next(row[9] for row in rows if row[3] == LISTENING and int(row[1].split(":")[1], 16) == port)
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                if inode in sockets_of(int(entry.name)):
                    return int(entry.name)
            except OSError:
                continue
    raise AssertionError(f"no process listens at port {port}")
