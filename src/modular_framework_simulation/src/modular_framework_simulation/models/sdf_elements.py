# SPDX-License-Identifier: BSD-3-Clause
"""Elements and attributes that SDF defines, to find misspelt ones, which Gazebo copies and ignores.

The names are those of the specification files of sdformat (sdf/1.0 to sdf/1.12), and <include> of its parser. A name
that any version defines is known, because versions are converted.
"""

from __future__ import annotations

from collections.abc import Iterator

from modular_framework_ros.allowed_names import nearest
from modular_framework_simulation.models.xml_nodes import XmlNode

FREE_CONTENT = ("plugin",)
"""Elements whose attributes and content SDF does not define."""

_CHILDREN = {
    "accel": "bias_mean bias_stddev mean stddev",
    "actor": "animation frame joint link origin plugin pose script skin static",
    "actor/script": "auto_start delay_start loop trajectory",
    "air_pressure": "pressure reference_altitude",
    "air_speed": "pressure",
    "altimeter": "vertical_position vertical_velocity",
    "angular_velocity": "x y z",
    "animation": "filename interpolate_x scale",
    "atmosphere": "pressure temperature temperature_gradient",
    "attenuation": "constant linear quadratic range",
    "audio": "device",
    "audio_source": "contact frame gain loop pitch pose uri",
    "axis": "dynamics initial_position limit mimic use_parent_model_frame xyz",
    "axis2": "dynamics initial_position limit mimic use_parent_model_frame xyz",
    "axis2_state": "acceleration effort position velocity",
    "axis_state": "acceleration effort position velocity",
    "background": "sky",
    "battery": "voltage",
    "blend": "fade_dist min_height",
    "bounce": "restitution_coefficient threshold",
    "box": "size",
    "camera/image": "anti_aliasing format height width",
    "capsule": "length radius",
    "clip": "far near",
    "clouds": "ambient direction humidity mean_size speed",
    "collision": "auto_inertia_params density frame geometry laser_retro mass max_contacts origin pose surface",
    "cone": "length radius",
    "constraints": (
        "cfm contact_max_correcting_vel contact_surface_layer erp split_impulse split_impulse_penetration_threshold"
    ),
    "contact": "collision topic",
    "contact/bullet": "kd kp soft_cfm soft_erp split_impulse split_impulse_penetration_threshold",
    "contact/ode": "kd kp max_vel min_depth soft_cfm soft_erp",
    "convex_decomposition": "max_convex_hulls voxel_resolution",
    "custom_function": "c1 c2 c3 f fun",
    "cylinder": "length radius",
    "damping": "angular linear",
    "dart/solver": "solver_type",
    "deletions": "name",
    "depth_camera": "clip output",
    "distortion": "center k1 k2 k3 p1 p2",
    "distribution": "cols rows step type",
    "dynamics": "damping friction spring_reference spring_stiffness",
    "ellipsoid": "radii",
    "fluid_added_mass": "pp pq pr qq qr rr xp xq xr xx xy xz yp yq yr yy yz zp zq zr zz",
    "fog": "color density end start type",
    "force": "x y z",
    "force_torque": "force frame measure_direction torque",
    "frame": "pose",
    "friction": "bullet ode torsional",
    "friction/bullet": "fdir1 friction friction2 rolling_friction",
    "friction/ode": "fdir1 mu mu2 slip1 slip2",
    "gazebo": "actor light model world",
    "geometry": "box capsule cone cylinder ellipsoid empty heightmap image mesh plane polyline sphere",
    "geometry/image": "granularity height scale threshold uri",
    "gps": "position_sensing velocity_sensing",
    "grasp_check": "attach_steps detach_steps min_contact_count",
    "gripper": "grasp_check gripper_link palm_link",
    "gui": "camera plugin",
    "gui/camera": "frame origin pose projection_type track_visual view_controller",
    "heightmap": "blend pos sampling size texture uri use_terrain_paging",
    "horizontal": "noise",
    "imu": "angular_velocity enable_orientation linear_acceleration noise orientation_reference_frame topic",
    "imu/noise": "accel rate type",
    "include": "model_state name namespace placement_frame plugin pose static uri",
    "inertia": "ixx ixy ixz iyy iyz izz",
    "inertial": "auto_inertia_params density fluid_added_mass frame inertia mass origin pose",
    "insertions": "joint light model",
    "intrinsics": "cx cy fx fy s",
    "joint": (
        "angle axis axis2 child frame gearbox_ratio gearbox_reference_body origin parent physics pose "
        "screw_thread_pitch sensor thread_pitch"
    ),
    "joint_state": "angle axis2_state axis_state",
    "lens": "custom_function cutoff_angle env_texture_size intrinsics projection scale_to_hfov type",
    "lidar": "noise range scan visibility_mask",
    "light": "attenuation cast_shadows diffuse direction frame intensity light_on origin pose specular spot visualize",
    "light_state": "pose",
    "limit": "dissipation effort lower stiffness upper velocity",
    "linear_acceleration": "x y z",
    "link": (
        "acceleration audio_sink audio_source battery collision damping enable_wind frame gravity inertial "
        "kinematic light must_be_base_link origin particle_emitter pose projector self_collide sensor velocity "
        "velocity_decay visual wrench"
    ),
    "link_state": (
        "acceleration angular_acceleration angular_velocity collision_state force linear_acceleration "
        "linear_velocity pose torque velocity wrench"
    ),
    "logical_camera": "aspect_ratio far horizontal_fov near",
    "magnetometer": "x y z",
    "material": "ambient diffuse double_sided emissive lighting pbr render_order script shader shininess specular",
    "material/script": "name uri",
    "mesh": "convex_decomposition filename scale submesh uri",
    "meta": "layer",
    "metal": (
        "albedo_map ambient_occlusion_map emissive_map environment_map light_map metalness metalness_map normal_map "
        "roughness roughness_map"
    ),
    "mimic": "multiplier offset reference",
    "model": (
        "allow_auto_disable enable_wind frame gripper include joint link model model_state origin plugin pose scale "
        "self_collide static"
    ),
    "model_state": "frame joint_state link_state model_state pose scale",
    "navsat": "position_sensing velocity_sensing",
    "noise": "bias_mean bias_stddev dynamic_bias_correlation_time dynamic_bias_stddev mean precision stddev type",
    "ode/limit": "cfm erp",
    "orientation_reference_frame": "custom_rpy grav_dir_x localization",
    "particle_emitter": (
        "color_end color_range_image color_start duration emitting lifetime material max_velocity min_velocity "
        "particle_scatter_ratio particle_size pose rate scale_rate size topic"
    ),
    "pbr": "metal specular",
    "physics": (
        "bullet dart gravity magnetic_field max_contacts max_step_size ode provide_feedback real_time_factor "
        "real_time_update_rate simbody update_rate"
    ),
    "physics/bullet": "constraints dt solver",
    "physics/dart": "collision_detector solver",
    "physics/ode": (
        "bounce cfm cfm_damping constraints erp fudge_factor implicit_spring_damper limit max_force "
        "provide_feedback solver suspension velocity"
    ),
    "plane": "normal size",
    "polyline": "height point",
    "population": "box cylinder distribution frame model model_count pose",
    "position_sensing": "horizontal vertical",
    "pressure": "noise",
    "projection": "p_cx p_cy p_fx p_fy tx ty",
    "projector": "far_clip fov frame near_clip plugin pose texture visibility_flags",
    "range": "max min resolution",
    "rate": "bias_mean bias_stddev mean stddev",
    "ray": "noise range scan visibility_mask",
    "road": "material point width",
    "save": "path",
    "scan": "horizontal vertical",
    "scan/horizontal": "max_angle min_angle resolution samples",
    "scan/vertical": "max_angle min_angle resolution samples",
    "scene": "ambient background fog grid origin_visual shadows sky",
    "sdf": "actor include light model world",
    "sensor": (
        "air_pressure air_speed altimeter always_on camera contact enable_metrics force_torque frame frame_id gps "
        "imu lidar logical_camera magnetometer navsat origin plugin pose ray rfid rfidtag sonar topic transceiver "
        "update_rate visualize"
    ),
    "sensor/camera": (
        "box_type camera_info_topic clip depth_camera distortion frame horizontal_fov image lens noise "
        "optical_frame_id pose save segmentation_type trigger_topic triggered visibility_mask"
    ),
    "shader": "normal_map",
    "simbody": "accuracy contact max_transient_velocity min_step_size must_be_loop_joint",
    "simbody/contact": (
        "dissipation dynamic_friction override_impact_capture_velocity override_stiction_transition_velocity "
        "plastic_coef_restitution plastic_impact_velocity static_friction stiffness viscous_friction"
    ),
    "skin": "filename scale",
    "sky": "clouds cubemap_uri sunrise sunset time",
    "soft_contact": "dart",
    "soft_contact/dart": "bone_attachment damping flesh_mass_fraction stiffness",
    "solver": (
        "dt friction_model island_threads iters min_step_size precon_iters sor thread_position_correction type "
        "use_dynamic_moi_rescaling"
    ),
    "sonar": "geometry max min radius",
    "specular": (
        "albedo_map ambient_occlusion_map emissive_map environment_map glossiness glossiness_map light_map "
        "normal_map specular_map"
    ),
    "sphere": "radius",
    "spherical_coordinates": (
        "elevation heading_deg latitude_deg longitude_deg surface_axis_equatorial surface_axis_polar surface_model "
        "world_frame_orientation"
    ),
    "spot": "falloff inner_angle outer_angle",
    "state": (
        "deletions insertions iterations joint_state light light_state model model_state real_time sim_time time "
        "wall_time"
    ),
    "submesh": "center name",
    "surface": "bounce contact friction soft_contact",
    "surface/contact": (
        "bullet category_bitmask collide_bitmask collide_without_contact collide_without_contact_bitmask "
        "elastic_modulus ode poissons_ratio"
    ),
    "suspension": "cfm erp",
    "texture": "diffuse normal size",
    "torque": "x y z",
    "torsional": "coefficient ode patch_radius surface_radius use_patch_radius",
    "torsional/ode": "slip",
    "track_visual": "inherit_yaw max_dist min_dist name static use_model_frame xyz",
    "trajectory": "waypoint",
    "transceiver": "essid frequency gain max_frequency min_frequency power sensitivity",
    "velocity_decay": "angular linear",
    "velocity_sensing": "horizontal vertical",
    "vertical": "noise",
    "vertical_position": "noise",
    "vertical_velocity": "noise",
    "visual": "cast_shadows frame geometry laser_retro material meta origin plugin pose transparency visibility_flags",
    "waypoint": "pose time",
    "wind": "linear_velocity",
    "world": (
        "actor atmosphere audio frame gravity gui include joint light magnetic_field model physics plugin "
        "population road scene spherical_coordinates state wind"
    ),
    "wrench": "mag pos",
    "x": "noise",
    "y": "noise",
    "z": "noise",
}

CHILDREN = {path: frozenset(names.split()) for path, names in _CHILDREN.items()}
"""Elements below an element; the key is its tag, or its parent's tag and its own tag."""

_ATTRIBUTES = (
    "always_on angle attach_steps attached_to auto auto_start axis canonical_link cast_shadows cfm constant "
    "contact_max_correcting_vel contact_surface_layer damping default degrees delay_start density detach_steps dt "
    "effort enabled end erp expressed_in falloff far fdir1 filename format frame friction fullscreen granularity "
    "gravity height id inner_angle interpolate_x iters ixx ixy ixz iyy iyz izz joint kd kinematic kp laser_retro "
    "length linear link loop lower mass material max max_angle max_vel merge min min_angle min_contact_count "
    "min_depth mu mu2 name namespace near normal optimization origin outer_angle output parent_frame path "
    "placement_frame pose precon_iters quadratic radius range relative_to resolution restitution_coefficient rgba "
    "rotation_format samples scale script self_collide size slip1 slip2 soft_cfm soft_erp sor start static tension "
    "threshold time transparency type update_rate upper uv_set velocity version visualize width world_name xyz"
)

ATTRIBUTES = frozenset(_ATTRIBUTES.split())
"""Attributes of any element."""


def unknown_content(root: XmlNode) -> tuple[str, ...]:
    """Returns the elements and attributes that SDF does not define, as "file:line: text" with the most similar name.

    A name in the same element is listed once. Names with a namespace prefix belong to other programs and are not
    checked.

    Args:
        root: Root of a document before its conversion.
    """
    lines: dict[tuple[str, str], str] = {}
    for node, path in _defined_elements(root, root.tag):
        for name in node.attributes if node.tag not in FREE_CONTENT else ():
            if name not in ATTRIBUTES and not _has_prefix(name):
                hint = nearest(name, sorted(ATTRIBUTES))
                lines.setdefault((node.tag, f"@{name}"), f"{node.location}: SDF defines no attribute '{name}'{hint}")
        children = children_of(path)
        for child in node.children if children else ():
            if not is_defined(child.tag, path):
                text = f"{child.location}: SDF defines no <{child.tag}> in <{node.tag}>"
                lines.setdefault((node.tag, child.tag), f"{text}{nearest(child.tag, sorted(children))}")
    return tuple(lines.values())


def _defined_elements(node: XmlNode, path: str) -> Iterator[tuple[XmlNode, str]]:
    """Yields an element and the elements below it that SDF defines, each with its path."""
    yield node, path
    for child in node.children if node.tag not in FREE_CONTENT else ():
        if child.tag in children_of(path):
            yield from _defined_elements(child, f"{path}/{child.tag}")


def _has_prefix(name: str) -> bool:
    return ":" in name or name.startswith(("xmlns", "{"))


def is_defined(tag: str, path: str) -> bool:
    """Returns whether SDF defines an element, or another program may define it.

    Args:
        tag: Tag of the element.
        path: Path of its parent, see `children_of`.
    """
    return _has_prefix(tag) or tag in children_of(path)


def children_of(path: str) -> frozenset[str]:
    """Returns the elements that SDF defines below an element; empty if it defines none.

    Args:
        path: Tags from the root of the document to the element, separated by slashes.
    """
    parts = path.split("/")
    for start in range(len(parts)):
        found = CHILDREN.get("/".join(parts[start:]))
        if found is not None:
            return found
    return frozenset()
