"""What docs/nodes.md and --help say of every node besides its parameters: its purpose, topics and services."""

from dataclasses import dataclass
from enum import Enum
from functools import partial
from typing import Dict, Tuple

from node_support import topics


class Role(Enum):
    """What a node does with a topic, a transform or a service."""

    INPUT = "subscribes"
    OUTPUT = "publishes"
    SERVICE = "serves"


@dataclass(frozen=True)
class Interface:
    """One topic, transform or service; names are relative to the node's namespace unless they begin with / or ~."""

    role: Role
    name: str
    type: str
    text: str


@dataclass(frozen=True)
class NodeDescription:
    """A node's purpose in Markdown and its interfaces, in the order in which they are listed."""

    summary: str
    interfaces: Tuple[Interface, ...]


@dataclass(frozen=True)
class HostDescription:
    """A node that runs other nodes in its process: its purpose in Markdown and the names of those nodes."""

    summary: str
    hosted: Tuple[str, ...]


_subscribes, _publishes, _serves = (partial(Interface, role) for role in Role)
_BEAMS_IN = _subscribes(topics.BEAMS, "SonarScanLine", "beams, also of other types, see [sonars](sonars.md)")
_JOINTS_IN = _subscribes(topics.JOINT_STATES, "sensor_msgs/JointState", "position of the tilt servo")
_DRIVER_JOINTS_IN = _subscribes(
    topics.JOINT_STATES, "sensor_msgs/JointState", "the tilt servo, if `sensor_joint` is set"
)
_OF_DRIVERS = (_DRIVER_JOINTS_IN, _publishes(topics.BEAMS, "SonarScanLine", "one beam for every valid reply"))
_OF_EMULATORS = (
    _serves("~order_fault", "OrderFault", "makes a fault happen at once"),
    _subscribes("tf", "", "`world -> ` frame of the head, if `head_frame` is set"),
)
_SONAR_IN_CLOUD = _subscribes("tf", "", "`sonar_frame` in the cloud's frame: position of the sonar at each beam")
_AS_POINTS = "also as PointCloud2 on `.../cloud`"

DIAGNOSTICS = _publishes("/diagnostics", "diagnostic_msgs/DiagnosticArray", "counters and problems, once a second")
"""What every node publishes."""

SERVO_2015 = "charle/sonar_to_base_link_position_controller"
"""Namespace of the servo's controller in 2015."""

NODES: Dict[str, NodeDescription] = {
    "imagenex_852_driver": NodeDescription(
        "Driver of the Imagenex 852 sonar (thesis 4.1.3, 4.5.1). See [the driver](imagenex_852_driver.md), also for "
        "the log tools `play_852` and `record_852`.",
        _OF_DRIVERS,
    ),
    "imagenex_852_emulator": NodeDescription(
        "An emulated Imagenex 852 on a pseudo-terminal, with faults at random or on request. "
        "See [the emulated head](imagenex_852_driver.md#the-emulated-head).",
        _OF_EMULATORS,
    ),
    "ping360_driver": NodeDescription(
        "Driver of the Blue Robotics Ping360 sonar, over serial and UDP. See [the driver](ping360_driver.md).",
        _OF_DRIVERS,
    ),
    "ping360_emulator": NodeDescription(
        "An emulated Ping360 on a pseudo-terminal or a UDP port, with faults at random or on request. "
        "See [the emulated head](ping360_driver.md#the-emulated-head).",
        _OF_EMULATORS,
    ),
    "sonar_to_cloud": NodeDescription(
        "Assembles beams into scans (thesis 6.5.2). A beam waits until tf can place it at its own stamp. "
        "See [sonar_processing](sonar_processing.md#sonar_to_cloud).",
        (
            _BEAMS_IN,
            _subscribes(
                topics.VELOCITY_COMMANDS,
                "geometry_msgs/Twist, TwistStamped or nav_msgs/Odometry",
                "velocity of the vehicle; `velocity_topic` sets the name, `velocity_type` the type",
            ),
            _publishes(topics.SCANS, "StampedIntensityCloud", f"scans; {_AS_POINTS}"),
            _publishes(topics.LASER_POINTS, "sensor_msgs/PointCloud2", "scans of the LASER modes"),
            _publishes(
                topics.LASER_SCANS, "sensor_msgs/LaserScan", "every revolution, for gmapping, hector or slam_toolbox"
            ),
            _publishes(
                topics.TURNS, "sensor_msgs/PointCloud2", "every revolution, x y z intensity time in the sonar's frame"
            ),
            _publishes(
                topics.POLAR_SCANS,
                "StampedIntensityCloud",
                f"every revolution with all its bins, organised; {_AS_POINTS}",
            ),
            _publishes(topics.NEWEST_BEAM, "sensor_msgs/PointCloud2", "the newest beam"),
        ),
    ),
    "sector_mask": NodeDescription(
        "Removes what is heard in a sector of the vehicle's own hull. Not part of the chain unless it is named there. "
        "See [sonar_processing](sonar_processing.md#sector_mask).",
        (
            _subscribes(topics.SCANS, "StampedIntensityCloud", "scans"),
            _subscribes(topics.POLAR_SCANS, "StampedIntensityCloud", "revolutions with all bins"),
            _SONAR_IN_CLOUD,
            _publishes(topics.MASKED, "StampedIntensityCloud", f"scans without the sector; {_AS_POINTS}"),
            _publishes(topics.MASKED_POLAR, "StampedIntensityCloud", f"revolutions without the sector; {_AS_POINTS}"),
        ),
    ),
    "thresholder": NodeDescription(
        "Removes weak echoes (thesis 6.5.3). See [sonar_processing](sonar_processing.md#thresholder).",
        (
            _subscribes(topics.SCANS, "StampedIntensityCloud", "scans"),
            _publishes(topics.THRESHOLDED, "StampedIntensityCloud", f"strong points; {_AS_POINTS}"),
            _publishes("~threshold", "std_msgs/Float32", "the threshold of each cloud, for plotting"),
        ),
    ),
    "outlier_remover": NodeDescription(
        "Removes isolated points, exactly as PCL does (thesis 6.5.4). "
        "See [sonar_processing](sonar_processing.md#outlier_remover).",
        (
            _subscribes(topics.THRESHOLDED, "StampedIntensityCloud", "strong points"),
            _publishes(topics.CLEANED, "StampedIntensityCloud", f"strong points without outliers; {_AS_POINTS}"),
        ),
    ),
    "echo_extractor": NodeDescription(
        "Finds the echoes of a whole revolution for matching, and removes the ring of floor echoes. "
        "See [sonar_processing](sonar_processing.md#echo_extractor).",
        (
            _subscribes(topics.POLAR_SCANS, "StampedIntensityCloud", "revolutions with all bins"),
            _publishes(topics.ECHOES, "StampedIntensityCloud", f"echoes; {_AS_POINTS}"),
            _publishes("~threshold", "std_msgs/Float32", "the smallest accepted echo height of each revolution"),
        ),
    ),
    "sonar_image": NodeDescription(
        "Draws the beams as an image, each as it arrives. Does nothing while nobody subscribes. "
        "See [sonar_processing](sonar_processing.md#sonar_image).",
        (
            _BEAMS_IN,
            _publishes(topics.IMAGE, "sensor_msgs/Image", "mono8"),
            _publishes(topics.CAMERA_INFO, "sensor_msgs/CameraInfo", "scale: `K[0]` is in pixels per metre"),
        ),
    ),
    "line_detector": NodeDescription(
        "Detects walls by RANSAC (thesis 6.5.5). See [shapes](shapes.md).",
        (
            _subscribes(topics.CLEANED, "StampedIntensityCloud", "points; the launch argument `cloud` sets the topic"),
            _SONAR_IN_CLOUD,
            _publishes(f"{topics.LINES}/coefficients", "Walls", "all walls of a scan, the most certain first"),
            _publishes(topics.LINES, "sensor_msgs/PointCloud2", "the inliers of all walls"),
            _publishes(f"{topics.LINES}/markers", "visualization_msgs/MarkerArray", "the walls for rviz"),
        ),
    ),
    "circle_detector": NodeDescription(
        "Detects buoys and pipes by RANSAC (thesis 6.5.5). See [shapes](shapes.md).",
        (
            _subscribes(
                topics.THRESHOLDED, "StampedIntensityCloud", "points; the launch argument `cloud` sets the topic"
            ),
            _SONAR_IN_CLOUD,
            _publishes(f"{topics.CIRCLES}/coefficients", "Circles", "all circles of a scan, the most certain first"),
            _publishes(topics.CIRCLES, "sensor_msgs/PointCloud2", "the inliers of all circles"),
            _publishes(f"{topics.CIRCLES}/markers", "visualization_msgs/MarkerArray", "the circles for rviz"),
        ),
    ),
    "sonar_control": NodeDescription(
        "Tilts the sonar through its range, one full scan per step. See [sonar_control](sonar_control.md).",
        (
            _JOINTS_IN,
            _BEAMS_IN,
            _publishes(
                topics.SERVO_COMMANDS,
                "std_msgs/Float64",
                "goal of the servo, rad; latched; the launch argument `command` sets the topic",
            ),
            _publishes("~sweeps", "std_msgs/UInt32", "number of completed sweeps; latched"),
            _serves("~set_mode", "SetScanMode", "sets STATIC_MAPPING or HORIZONTAL"),
        ),
    ),
    "mlsm_core": NodeDescription(
        "Builds the map (thesis 6.2), matches every scan with it (6.3, 6.5.6) and publishes `map -> odom`. While "
        "matching is on, an accepted scan is undistorted, inserted into the map, and corrects `map -> odom`; a "
        "rejected scan changes nothing, and `/diagnostics` says why it was rejected. See [matching](matching.md).",
        (
            _subscribes(topics.CLEANED, "StampedIntensityCloud", "points of the map that is shown"),
            _subscribes(topics.ECHOES, "StampedIntensityCloud", "points to match, unless `match_input` is CLEANED"),
            _subscribes(topics.START_MATCHING, "std_msgs/Bool", "switches matching on or off"),
            _subscribes(
                topics.SEEN_POSE,
                "geometry_msgs/PoseWithCovarianceStamped",
                'where somebody sees the vehicle, as rviz\'s "2D Pose Estimate"; the next scans are searched there',
            ),
            _subscribes(
                topics.SET_MARK, "visualization_msgs/Marker", "a place to name by the marker's text, or to delete"
            ),
            _subscribes(
                topics.SATELLITE_FIXES,
                "sensor_msgs/NavSatFix",
                "where satellites have the vehicle at the surface; with `origin: fixes`",
            ),
            _subscribes("tf", "", "`odom -> base_link`: dead reckoning"),
            _publishes(
                topics.MAP_MARKERS,
                "visualization_msgs/MarkerArray",
                "every block at its true size; all at first, then what changed",
            ),
            _publishes(
                topics.MAP_CLOUD,
                "sensor_msgs/PointCloud2",
                "mean, height, depth, number of points and type of every block (0 horizontal, 1 vertical; with "
                "`cloud_free` 2 free)",
            ),
            _publishes(topics.MAP_GRID, "nav_msgs/OccupancyGrid", "free, unknown and occupied from above"),
            _publishes(topics.MAP_OF_NAVIGATION, "nav_msgs/OccupancyGrid", "the same, as map_server names it"),
            _publishes(topics.MAP_METADATA, "nav_msgs/MapMetaData", "size and place of that grid"),
            _publishes(topics.MAP_OCTOMAP, "octomap_msgs/Octomap", "voxels; where these messages are installed"),
            _publishes(
                topics.MATCHED_POSE,
                "geometry_msgs/PoseWithCovarianceStamped",
                "the fix of each matched scan, at the stamp of its newest beam",
            ),
            _publishes(
                topics.POSE_NOW,
                "geometry_msgs/PoseWithCovarianceStamped",
                "each second, also between fixes: the position now, with the covariance that it has by now",
            ),
            _publishes(
                topics.CHART_POSITION,
                "sensor_msgs/NavSatFix",
                "the same in latitude and longitude where `origin` or a map file tells where the map lies; its status "
                "is no fix while the position is not good",
            ),
            _publishes(
                topics.MAP_ORIGIN,
                "std_msgs/Float64MultiArray",
                "where the map lies on the Earth: latitude and longitude of its origin, azimuth of its x axis [deg], "
                "covariance (3 x 3) of east, north [m] and yaw [rad]; empty where that is no longer known; latched",
            ),
            _publishes(
                topics.STATUS_MARKERS,
                "visualization_msgs/MarkerArray",
                "the status for rviz: in words at the vehicle, green, amber or red, with its ellipse of 95 %",
            ),
            _publishes(
                topics.MATCHED_ODOMETRY, "nav_msgs/Odometry", "the fix with the velocity, for robot_localization"
            ),
            _publishes(topics.POSITION_STATUS, "PositionStatus", "how well the position is known now; latched"),
            _publishes(topics.MATCHED_PATH, "nav_msgs/Path", "all fixes; latched"),
            _publishes(topics.MARKS, "visualization_msgs/MarkerArray", "the named places of the map; latched"),
            _publishes(
                topics.MATCHED_SCAN, "sensor_msgs/PointCloud2", "the newest scan as matching undistorts and places it"
            ),
            _publishes(
                "tf", "", "`map -> odom` at `transform_rate`; it changes smoothly to a new fix within `blend_time`"
            ),
            _serves("~relocalise", "std_srvs/Trigger", "searches the whole map for the newest scans"),
            _serves(topics.DYNAMIC_MAP, "nav_msgs/GetMap", "returns `map`"),
            _serves("~save_map", "SaveMap", "writes the map into `map_directory`"),
            _serves("~load_map", "LoadMap", "takes a map of `map_directory` in the place of the present one"),
            _serves("~reset_map", "std_srvs/Trigger", "discards the map, the position in it and the path"),
            _serves("~get_region", "GetRegion", "returns the blocks in a box, as they are on `MLSM/cloud`"),
        ),
    ),
    "thin_link": NodeDescription(
        "Sends fixes, the map and little else to a topside behind a link of few bytes a second, each as the newest "
        "there is. See [a thin link](tutorial_at_sea.md#a-thin-link).",
        (
            _subscribes(topics.MATCHED_POSE, "geometry_msgs/PoseWithCovarianceStamped", "fixes"),
            _publishes(f"thin/{topics.MATCHED_POSE}", "geometry_msgs/PoseWithCovarianceStamped", "each fix, at once"),
            _subscribes(topics.MAP_MARKERS, "visualization_msgs/MarkerArray", "tiles of the map that changed"),
            _publishes(
                f"thin/{topics.MAP_MARKERS}", "visualization_msgs/MarkerArray", "the same, at the pace of the link"
            ),
            _subscribes(topics.MATCHED_PATH, "nav_msgs/Path", "all fixes"),
            _publishes(f"thin/{topics.MATCHED_PATH}", "nav_msgs/Path", "about a hundred of them, now and then"),
            _subscribes(topics.IMAGE, "sensor_msgs/Image", "the sonar's beams as a picture"),
            _publishes(f"thin/{topics.IMAGE}", "sensor_msgs/Image", "a picture of few pixels, now and then"),
            _subscribes("/diagnostics", "diagnostic_msgs/DiagnosticArray", "what every node tells of itself"),
            _publishes("thin/diagnostics", "diagnostic_msgs/DiagnosticArray", "the same, now and then"),
        ),
    ),
    "thesis_topics": NodeDescription(
        "Offers topics and a service under their names of 2015; `thesis:=true` starts it. See "
        "[from 2015](from_2015.md#topics).",
        (
            _subscribes(topics.MATCHED_SCAN, "sensor_msgs/PointCloud2", "becomes `debug_cloud`"),
            _publishes("debug_cloud", "sensor_msgs/PointCloud2", "the newest scan as matched, in map"),
            _subscribes(topics.LINES, "sensor_msgs/PointCloud2", "becomes `sonar/walls/cloud`"),
            _publishes("sonar/walls/cloud", "sensor_msgs/PointCloud2", "the inliers of all walls"),
            _subscribes(f"{topics.LINES}/coefficients", "Walls", "becomes the next two"),
            _publishes("sonar/walls/coeff", "Wall", "one wall a message"),
            _publishes("sonar/walls/model", "ModelCoefficients", "one wall a message: point and direction, as PCL's"),
            _subscribes(f"{SERVO_2015}/state", "control_msgs/JointControllerState", "becomes `joint_states`"),
            _publishes(topics.JOINT_STATES, "sensor_msgs/JointState", "position of the joint that sonar_control tilts"),
            _subscribes(topics.SERVO_COMMANDS, "std_msgs/Float64", "goal of the servo, rad"),
            _publishes(f"{SERVO_2015}/command", "std_msgs/Float64", "the same goal"),
            _serves("sonar_control", "SetScanMode", "calls `sonar_control/set_mode`"),
        ),
    ),
    "dead_reckoning": NodeDescription(
        "Odometry for a vehicle without a position: adds up the velocity that the scans tell, that a DVL measures or "
        "that the thrusters are told, along the heading of a compass. See [dead_reckoning](dead_reckoning.md).",
        (
            _subscribes(
                topics.HEADING,
                "sensor_msgs/Imu or Float64",
                "orientation, x east or any fixed direction, z up; `heading_type` sets the type",
            ),
            _subscribes(
                topics.DEPTH, "PoseWithCovarianceStamped, Float64 or FluidPressure", "depth; `depth_type` sets the type"
            ),
            _subscribes(
                topics.MATCHED_ODOMETRY,
                "nav_msgs/Odometry",
                "velocity that mlsm_core estimates, if `velocity_source` is ESTIMATE",
            ),
            _subscribes(topics.VELOCITY_COMMANDS, "geometry_msgs/Twist", "velocity if `velocity_source` is COMMANDS"),
            _subscribes(
                topics.MEASURED_VELOCITY,
                "TwistWithCovarianceStamped or a DVL's own type",
                "velocity if `velocity_source` is MEASURED",
            ),
            _subscribes("tf", "", "`base_link -> ` frames of compass and DVL: how they are mounted"),
            _publishes("tf", "", "`odom -> base_link` at each heading"),
            _publishes(topics.ODOMETRY, "nav_msgs/Odometry", "the same with the velocity"),
        ),
    ),
    "web_page": NodeDescription(
        "Shows map, vehicle, sonar and checks in any browser, live. See [web_page](web_page.md).",
        (
            _BEAMS_IN,
            _subscribes("tf", "", "`map -> odom -> base_link -> sonar`: vehicle and sonar"),
            _subscribes(topics.MATCHED_POSE, "geometry_msgs/PoseWithCovarianceStamped", "fixes"),
            _subscribes(topics.POSITION_STATUS, "PositionStatus", "how well the position is known"),
            _subscribes(topics.MAP_CLOUD, "sensor_msgs/PointCloud2", "the map"),
            _subscribes(topics.MARKS, "visualization_msgs/MarkerArray", "the named places of the map"),
            _subscribes(topics.MAP_ORIGIN, "std_msgs/Float64MultiArray", "where the map lies on the Earth"),
            _subscribes("/diagnostics", "diagnostic_msgs/DiagnosticArray", "what every node tells of itself"),
            _publishes(topics.SET_MARK, "visualization_msgs/Marker", "a place that somebody named or deleted"),
        ),
    ),
    "autopilot_link": NodeDescription(
        "Sends the position to ArduSub or PX4 by MAVLink, or to MAVROS, while it is good; reads heading, depth and "
        "velocity of an autopilot without MAVROS. See [autopilot_link](autopilot_link.md).",
        (
            _subscribes("tf", "", "`map -> odom -> base_link`: the position at the newest odometry"),
            _subscribes(topics.POSITION_STATUS, "PositionStatus", "whether the position is good, and its covariance"),
            _subscribes(topics.MATCHED_POSE, "geometry_msgs/PoseWithCovarianceStamped", "fixes, which count at once"),
            _publishes(topics.HEADING, "sensor_msgs/Imu", "ATTITUDE of the autopilot, x east, z up"),
            _publishes(topics.DEPTH, "sensor_msgs/FluidPressure", "SCALED_PRESSURE2 of the autopilot"),
            _publishes(
                topics.MEASURED_VELOCITY, "geometry_msgs/TwistStamped", "velocity of LOCAL_POSITION_NED, in base_link"
            ),
            _publishes(
                topics.MAVROS_ODOMETRY, "nav_msgs/Odometry", "the position, if `connection` is empty: MAVROS runs"
            ),
            _publishes(
                topics.MAVROS_POSE,
                "geometry_msgs/PoseWithCovarianceStamped",
                "the same, if `message` is VISION_POSITION_ESTIMATE",
            ),
        ),
    ),
    "sonar_simulator": NodeDescription(
        "Simulates the vehicle Charl-e with a scanning sonar on a tilt servo, in a world from a file (thesis 6.4). It "
        "publishes `/clock`. The vehicle follows a script or `cmd_vel`; the odometry error is configurable. See "
        "[the simulated vehicle](simulator_vehicle.md), also for `simulate_bag`, "
        "and [the simulated sonar](simulation.md).",
        (
            _subscribes(topics.VELOCITY_COMMANDS, "geometry_msgs/Twist", "commands, if `drive` is CMD_VEL"),
            _subscribes(topics.SERVO_COMMANDS, "std_msgs/Float64", "goal of the servo, rad, positive down"),
            _subscribes(topics.ECHOES, "StampedIntensityCloud", "simulated time waits while they are overdue"),
            _publishes(topics.BEAMS, "SonarScanLine", "beams"),
            _publishes(topics.ODOMETRY, "nav_msgs/Odometry", "dead reckoning with the configured errors; also as tf"),
            _publishes(topics.HEADING, "sensor_msgs/Imu", "orientation, if `instruments` is COMPASS"),
            _publishes(topics.DEPTH, "std_msgs/Float64", "depth, if `instruments` is COMPASS"),
            _publishes(topics.GROUND_TRUTH, "nav_msgs/Odometry", "the true pose and velocity"),
            _publishes(
                topics.JOINT_STATES,
                "sensor_msgs/JointState",
                "position of the servo; robot_state_publisher makes tf `base_link -> sonar` of it",
            ),
            _publishes(topics.VELOCITY, "geometry_msgs/Twist", "velocity as the odometry measures it"),
            _publishes(topics.VELOCITY_COMMANDS, "geometry_msgs/Twist", "the same, if `drive` is SCRIPT"),
            _publishes(topics.CLOCK, "rosgraph_msgs/Clock", "simulated time"),
            _publishes("tf", "", "`world -> true_sonar` and `world -> map`, if `head` is EMULATED"),
            _publishes("~world", "visualization_msgs/Marker", "triangles of the world; latched"),
            _publishes("~progress", "std_msgs/Float32", "completed share of the script, 0 to 1; latched"),
        ),
    ),
    "gazebo_sonar": NodeDescription(
        "Makes sonar beams from the output of Gazebo's ray sensor plugins, with the same echo models and parameter "
        "groups as `sonar_simulator`; no plugin has to be built. See [a sonar in Gazebo](gazebo.md).",
        (
            _subscribes(topics.RAYS, "sensor_msgs/LaserScan, PointCloud or PointCloud2", "rays of the sensor plugin"),
            _DRIVER_JOINTS_IN,
            _publishes(topics.BEAMS, "SonarScanLine", "beams"),
        ),
    ),
}


_PROCESSING = (
    "sonar_to_cloud", "sector_mask", "thresholder", "outlier_remover", "echo_extractor", "line_detector",
    "circle_detector", "sonar_image",
)  # fmt: skip

HOSTS: Dict[str, HostDescription] = {
    "sonar_processing": HostDescription(
        "Turns beams into clean clouds, with all stages in one process: clouds are handed on without being copied, and "
        "a topic is serialised only while somebody subscribes to it. See [sonar_processing](sonar_processing.md).",
        _PROCESSING,
    ),
    "mapping": HostDescription(
        "Turns beams into a map, with all stages in one process: clouds are handed on without being copied, and "
        "a topic is serialised only while somebody subscribes to it. See [sonar_processing](sonar_processing.md) "
        "and [matching](matching.md).",
        (*_PROCESSING, "mlsm_core"),
    ),
}
