# SPDX-License-Identifier: BSD-3-Clause
"""Objects enter and leave everywhere or nowhere, exit codes report it, and the sensors' frames are on TF."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
import rospy
import rosservice
import tf2_ros
from gazebo_msgs.srv import DeleteModel, DeleteModelResponse, SpawnModel, SpawnModelResponse
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from modular_framework_core import srv
from modular_framework_testing.ros_session import Launch, executable

SENSORS = """
fixed_kinect: {frame_id: simulated_kinect2, origin_frame_id: world, frame_x: -0.1645, frame_y: 0.375, frame_z: 2.72,
               frame_roll: 3.14159265359, frame_pitch: 0, frame_yaw: -1.57079632679}
incomplete: {frame_id: nothing}
pointcloud_topic_name: simulated_kinect2/pointcloud
"""


class FakeSimulation:
    """Knows which models there are; refuses on demand."""

    def __init__(self) -> None:
        self.models: dict[str, object] = {}
        self.refuse_delete = False
        self._services = [
            rospy.Service("gazebo/spawn_sdf_model", SpawnModel, self._spawn),
            rospy.Service("gazebo/delete_model", DeleteModel, self._delete),
        ]

    def _spawn(self, request):
        if "broken" in request.model_xml:
            return SpawnModelResponse(False, "the SDF is broken")
        self.models[request.model_name] = request
        return SpawnModelResponse(True, "")

    def _delete(self, request):
        if self.refuse_delete or request.model_name not in self.models:
            return DeleteModelResponse(False, "no")
        del self.models[request.model_name]
        return DeleteModelResponse(True, "")


@pytest.fixture(scope="module")
def simulation(ros_session, ros_launch, tmp_path_factory: pytest.TempPathFactory) -> FakeSimulation:
    folder: Path = tmp_path_factory.mktemp("models")
    for name, text in (("box", "<sdf/>"), ("bad", "<sdf>broken</sdf>")):
        (folder / name).mkdir()
        (folder / name / "model.sdf").write_text(text)
    (folder / "sensors.yaml").write_text(SENSORS)
    fake = FakeSimulation()
    fake.session = ros_session
    fake.sensors = folder / "sensors.yaml"
    ros_launch(f"""<launch><param name="gazebo_model_path" value="{folder}"/>
      <node name="managers" pkg="modular_framework_core" type="managers" output="screen"/>
      <node name="sensors_tf2_broadcaster" pkg="modular_framework_core" type="sensors_tf2_broadcaster" output="screen"
            args="{folder}/sensors.yaml"/></launch>""")
    ros_session.wait_for_service("/update_acm_entry", 60)
    ros_session.wait_for_service("/delete_gazebo_mapping", 60)
    return fake


def manage(simulation: FakeSimulation, *arguments: str) -> tuple[int, str]:
    done = subprocess.run(
        [executable("modular_framework_core", "manage_object"), *arguments],
        env=simulation.session.env,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    return done.returncode, done.stdout + done.stderr


def object_type(name: str) -> str:
    proxy = rospy.ServiceProxy("get_object_type", srv.GetGazeboType)
    return proxy(name).object_type


def test_an_object_enters_and_leaves_the_simulation(simulation: FakeSimulation) -> None:
    code, text = manage(simulation, "-t", "box", "-n", "mine", "-p", "0.1,-0.2,0.9", "-o", "0 0 0", "-r", "world")
    assert code == 0, text
    pose = simulation.models["mine"].initial_pose
    assert (pose.position.x, pose.position.y, pose.position.z, pose.orientation.w) == (0.1, -0.2, 0.9, 1.0)
    assert object_type("mine") == "box"
    code, text = manage(simulation, "-t", "box", "-n", "mine")
    assert code == 1
    assert "an object 'mine' exists already" in text
    assert manage(simulation, "-d", "true", "-n", "mine")[0] == 0
    assert not simulation.models
    assert object_type("mine") == ""


def test_what_the_simulation_refuses_leaves_no_trace(simulation: FakeSimulation) -> None:
    code, text = manage(simulation, "-t", "bad")
    assert code == 1
    assert "the SDF is broken" in text
    assert object_type("bad") == ""
    assert manage(simulation, "-t", "box")[0] == 0
    simulation.refuse_delete = True
    assert manage(simulation, "-d", "true", "-t", "box")[0] == 1
    assert object_type("box") == "box"
    simulation.refuse_delete = False
    assert manage(simulation, "-d", "true", "-t", "box")[0] == 0


def test_nothing_is_spawned_or_deleted_while_a_manager_is_absent(simulation: FakeSimulation) -> None:
    assert manage(simulation, "-t", "box", "-n", "stays")[0] == 0
    absent = "update_acm_entry:=/nobody"
    code, text = manage(simulation, "-d", "true", "-n", "stays", absent)
    assert (code, "nothing was changed" in text) == (1, True)
    assert "stays" in simulation.models
    assert object_type("stays") == "box"
    assert manage(simulation, "-t", "box", "-n", "never", absent)[0] == 1
    assert "never" not in simulation.models
    assert object_type("never") == ""
    assert manage(simulation, "-d", "true", "-n", "stays")[0] == 0


def test_an_object_that_came_with_the_world_can_be_deleted_too(simulation: FakeSimulation) -> None:
    simulation.models["of_the_world"] = None
    assert manage(simulation, "-d", "true", "-n", "of_the_world")[0] == 0
    assert "of_the_world" not in simulation.models


def test_arguments_without_sense_end_with_their_own_code(simulation: FakeSimulation) -> None:
    code, text = manage(simulation, "-t", "teapot")
    assert code == 2
    assert "teapot" in text
    assert manage(simulation, "-d", "true", "-n", "nobody")[0] == 1


def test_the_launch_file_spawns_too(simulation: FakeSimulation) -> None:
    path = Path(__file__).parents[3] / "src" / "modular_framework_core" / "launch" / "manage_object.launch"
    launch = simulation.session.launch(path, object_type="box", object_position="0 -0.3 1")
    launch.wait(120)
    assert simulation.models["box"].initial_pose.position.y == -0.3, launch.log()


def test_the_frames_of_the_sensors_are_on_tf_and_wrong_ones_are_named(simulation: FakeSimulation) -> None:
    buffer = tf2_ros.Buffer()
    listener = tf2_ros.TransformListener(buffer)
    transform = buffer.lookup_transform("world", "simulated_kinect2", rospy.Time(0), rospy.Duration(60)).transform
    listener.unregister()
    assert (transform.translation.x, transform.translation.z) == (-0.1645, 2.72)
    assert "'incomplete'" in simulation.session.log()
    assert "origin_frame_id" in simulation.session.log()


def test_the_file_of_sensors_is_read_again_on_request(simulation: FakeSimulation) -> None:
    added = rospy.ServiceProxy("add_pose", srv.AddPoseStamped)
    pose = PoseStamped(header=Header(frame_id="world"), pose=Pose(Point(0.5, 0.0, 1.5), Quaternion(0.0, 0.0, 0.0, 1.0)))
    assert added(pose, "corner").success
    simulation.sensors.write_text(
        "camera: {frame_id: camera_frame, initial_pose: corner}\nlost: {frame_id: lost_frame, initial_pose: nowhere}\n"
    )
    reload = rospy.ServiceProxy("reload_sensor_frames", Trigger)
    reload.wait_for_service(60)
    answer = reload()
    assert not answer.success
    assert "sensors.yaml:2" in answer.message and "no pose named 'nowhere' is stored" in answer.message
    assert "'simulated_kinect2' was removed from the file" in answer.message
    buffer = tf2_ros.Buffer()
    listener = tf2_ros.TransformListener(buffer)
    transform = buffer.lookup_transform("world", "camera_frame", rospy.Time(0), rospy.Duration(60)).transform
    listener.unregister()
    assert (transform.translation.x, transform.translation.z) == (0.5, 1.5)


def test_the_sensors_node_needs_its_file(simulation: FakeSimulation) -> None:
    done = subprocess.run(
        ["rosrun", "modular_framework_core", "sensors_tf2_broadcaster", "__name:=other"],
        env=simulation.session.env,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 2
    assert "expected one" in done.stdout + done.stderr


MANAGERS = {  # node: one of its services
    "joint_state_manager_server": "get_joint_state",
    "joint_trajectory_manager_server": "get_trajectory",
    "pose_stamped_manager_server": "get_pose",
    "moveit_plan_manager_server": "get_plan",
    "standardised_grasp_manager_server": "get_grasp",
    "robot_pose_manager_server": "get_robot_pose",
    "acm_manager_server": "get_modified_acm",
    "gazebo_mapping_server": "get_object_type",
}


@pytest.fixture(scope="module")
def separate_managers(simulation: FakeSimulation) -> Iterator[Launch]:
    """Every manager as a node of its own, in a namespace of theirs."""
    nodes = "".join(
        f'<node name="{name}" pkg="modular_framework_core" type="{name}" required="true" output="screen"/>'
        for name in MANAGERS
    )
    launch = simulation.session.launch(f'<launch><group ns="alone">{nodes}</group></launch>')
    yield launch
    launch.stop()


@pytest.mark.parametrize(("node", "service"), MANAGERS.items())
def test_every_manager_runs_as_a_node_of_its_own(
    simulation: FakeSimulation, separate_managers: Launch, node: str, service: str
) -> None:
    simulation.session.wait_for_service(f"/alone/{service}", 60)
    assert rosservice.get_service_node(f"/alone/{service}") == f"/alone/{node}"
    assert separate_managers.alive()
