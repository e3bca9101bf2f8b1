"""What the package of 2015 had, and what stands for it here: the source of docs/from_2015.md and of migrate_yaml."""

from dataclasses import dataclass
from enum import Enum
from typing import Any, Callable, List


class Kind(Enum):
    """What a name names."""

    NODE = "Nodes and nodelets"
    LAUNCH = "Launch files"
    TOPIC = "Topics"
    SERVICE = "Services"
    FIELD = "Fields of messages"


@dataclass(frozen=True)
class Name:
    """before: the name of 2015. here: today's; empty where there is none. remark: what else is different."""

    kind: Kind
    before: str
    here: str
    remark: str = ""


@dataclass(frozen=True)
class Key:
    """A parameter of a node of 2015.

    before: its default in the code, as yaml. here: today's name of the parameter of `node`; empty where there is none.
    remark: why its default is another, what takes its place. taken: makes today's value of that of 2015.
    also: another parameter that takes the same value.
    """

    owner: str
    key: str
    before: Any
    node: str
    here: str
    remark: str = ""
    taken: Callable[[Any], Any] = lambda value: value
    also: str = ""


def _scan_mode(value: str) -> str:
    return ("LASER" if "LASER" in value else "SONAR") + ("CONT" if "CONT" in value else "")


def _threshold_mode(value: str) -> str:
    parts = [part for part in ("OTSU", "FIXED", "PROPORTIONAL") if part in value]
    return "OTSU+PROPORTIONAL" if parts == ["OTSU", "PROPORTIONAL"] else parts[0] if parts else value


def _outlier_mode(value: str) -> str:
    return "STATISTICAL" if "STATISTICAL" in value else "RADIUS"


_TOPIC = "topics have fixed names; remap them in a launch file"
_ORGANIZED = "only sonar_to_cloud decides it, with keep_organized; the stages keep rows as they come"

KEYS: List[Key] = [
    Key("SonarToCloud", "mode", "SONAR", "sonar_to_cloud", "mode", "", _scan_mode),
    Key("SonarToCloud", "scanSize", 160, "sonar_to_cloud", "scan_size",
        "the beams of 3 degrees in a turn, as in the yaml of 2015; a scan ends with the turn too (`end_at_full_turn`)"),
    Key("SonarToCloud", "sonarSubscribeTopic", "/Sonar/raw", "sonar_to_cloud", "", "launch argument `beams`"),
    Key("SonarToCloud", "sonarCloudPublishTopic", "/sonar/scan/sonarCloud", "sonar_to_cloud", "", _TOPIC),
    Key("SonarToCloud", "laserCloudPublishTopic", "/sonar/scan/laserCloud", "sonar_to_cloud", "", _TOPIC),
    Key("SonarToCloud", "beamCloudPublishTopic", "/sonar/beam", "sonar_to_cloud", "", _TOPIC),
    Key("SonarToCloud", "scanFlagTopic", "sonar/scan/flag", "sonar_to_cloud", "", "nothing was published on it"),
    Key("SonarToCloud", "targetFrame", "odom", "sonar_to_cloud", "target_frame"),
    Key("SonarToCloud", "heightLimit", 4.8, "sonar_to_cloud", "height_limit", "odom need not begin at the surface"),
    Key("SonarToCloud", "velSubscribeTopic", "/cmd_vel", "sonar_to_cloud", "velocity_topic",
        "without a slash, so that a namespace can hold a whole vehicle"),
    Key("SonarToCloud", "keepOrganized", True, "sonar_to_cloud", "keep_organized", "the matcher needs no rows"),
    Key("SonarToCloud", "dispersedPoints", 10, "sonar_to_cloud", "dispersed_points",
        "copies beside the axis of the beam cost time; 10 meant 12 points, two of them alike"),
    Key("SonarToCloud", "horizontalOpening", 0.0436, "sonar_to_cloud", "beam_width"),
    Key("SonarToCloud", "verticalOpening", 0.384, "sonar_to_cloud", "", "it was read and not used"),
    Key("Thresholder", "mode", "OTSU", "thresholder", "mode",
        "7.2 advises to raise Otsu's threshold a bit; `PROPORTIONAL` behind `OTSU` had no effect, by a slip of the pen",
        _threshold_mode),
    Key("Thresholder", "fixedThresholdValue", 0, "thresholder", "fixed_threshold",
        "it was never read; 66 is what 7.2 reports of Otsu"),
    Key("Thresholder", "maxBinValue", 127, "thresholder", "", "strengths may go up to 255"),
    Key("Thresholder", "OTSUMultiplier", 1.0, "thresholder", "otsu_multiplier", "7.2 advises to raise it a bit"),
    Key("Thresholder", "maxThresholdProportion", 0.5, "thresholder", "max_proportion"),
    Key("Thresholder", "minThresholdProportion", 0.5, "thresholder", "min_proportion"),
    Key("Thresholder", "minThreshold", 50, "thresholder", "min_threshold",
        "50 of 127 suits one gain of one sonar; others hear walls that are weaker"),
    Key("Thresholder", "keepOrganized", True, "thresholder", "", _ORGANIZED),
    Key("Thresholder", "cloudsubscribeTopic", "/sonar/scan/sonarCloud", "thresholder", "", _TOPIC),
    Key("Thresholder", "thresholdedCloudPublishTopic", "/sonar/scan/thresholded", "thresholder", "", _TOPIC),
    Key("OutlierRemover", "mode", "RADIUS", "outlier_remover", "mode",
        "as in the yaml of 2015; RADIUS keeps almost nothing at 50 m", _outlier_mode),
    Key("OutlierRemover", "minNeighbours", 20, "outlier_remover", "min_neighbors"),
    Key("OutlierRemover", "minRadius", 1.0, "outlier_remover", "min_radius"),
    Key("OutlierRemover", "stddevMulThresh", 0.0, "outlier_remover", "stddev_multiplier",
        "as in 6.5.4; 0 removes half of all points"),
    Key("OutlierRemover", "meanK", 30, "outlier_remover", "mean_k", "as in 6.5.4"),
    Key("OutlierRemover", "keepOrganized", True, "outlier_remover", "", _ORGANIZED),
    Key("OutlierRemover", "cloudsubscribeTopic", "/sonar/scan/thresholded", "outlier_remover", "", _TOPIC),
    Key("OutlierRemover", "cleanedCloudPublishTopic", "/sonar/scan/cleaned", "outlier_remover", "", _TOPIC),
    Key("Wall2DDetector", "mode", "RANSAC", "line_detector", "", "HOUGH is not ported: it needed organised clouds"),
    Key("Wall2DDetector", "nWalls", 3, "line_detector", "n_walls", "a basin has four"),
    Key("Wall2DDetector", "RANSACDistance", 0.6, "line_detector", "distance", "an echo of a real pulse is 0.15 m long"),
    Key("Wall2DDetector", "RANSACProbability", 0.8, "line_detector", "probability",
        "one wall in five was not the best one"),
    Key("Wall2DDetector", "RANSACMaxIterations", 5000, "line_detector", "max_iterations"),
    Key("Wall2DDetector", "cloudSubscribeTopic", "/sonar/scan/cleaned", "line_detector", "",
        "launch argument `cloud` of line_detector.launch"),
    Key("Wall2DDetector", "wallPublishTopic", "/Sonar/Walls", "line_detector", "", _TOPIC),
    Key("Wall2DDetector", "wallCoefficientsPublishTopic", "/Sonar/Walls/Coeff", "line_detector", "", _TOPIC),
    Key("MLSM_core", "resolution", 0.3, "mlsm_core", "resolution",
        "echoes at 50 m are 2 m apart; `match_resolution` is that of the map that is matched", also="match_resolution"),
    Key("MLSM_core", "sizeXMeters", 60.0, "mlsm_core", "size_x_meters",
        "4.4.1: the basin of 120 by 50 m; the map grows beyond it"),
    Key("MLSM_core", "sizeYMeters", 60.0, "mlsm_core", "size_y_meters", "as above"),
    Key("MLSM_core", "maxIterations", 1000, "mlsm_core", "max_iterations",
        "only for `estimator: THESIS`; iterations end when the points stand still, or with a moving scan when the "
        "error rises. The yaml of 2015 has 10: a still scan that is 5 degrees off needs 40 to 150"),
    Key("MLSM_core", "errorThreshold", 0.3, "mlsm_core", "",
        "it only ended the iterations; here `error_threshold` is the greatest error of a match that is accepted"),
    Key("MLSM_core", "nSamples", 5, "mlsm_core", "n_samples", "only for `estimator: THESIS`"),
    Key("MLSM_core", "sampleStep", 0.25, "mlsm_core", "sample_step", "as in the yaml of 2015"),
    Key("MLSM_core", "fastUpdate", False, "mlsm_core", "", "it was read and not used"),
    Key("MLSM_core", "speedError", 0.0, "mlsm_core", "", "it was read and not used"),
    Key("MLSM_core", "velSubscribeTopic", "/odom", "mlsm_core", "", "the motion comes from tf, odom to base_link"),
    Key("MLSM_core", "cloudSubscribeTopic", "/sonar/scan/cleaned", "mlsm_core", "", _TOPIC),
    Key("MLSM_core", "markerPublishTopic", "/MLSM/Markers", "mlsm_core", "", _TOPIC),
    Key("MLSM_core", "orientationSubscribeTopic_", "/orientation", "mlsm_core", "", "it was read and not used"),
    Key("MLSM_core", "positionSubscribeTopic", "/lastPosition", "mlsm_core", "", "it was read and not used"),
    Key("SonarControl", "mode", "STATIC_MAPPING", "sonar_control", "mode"),
    Key("SonarControl", "stepSize", 0.5, "sonar_control", "", "set `step_deg`, in degrees"),
    Key("SonarControl", "scanSize", 120, "sonar_control", "scan_beams", "0: a full turn, whatever the head's step"),
    Key("SonarControl", "sonarSubscribeTopic", "/charle/sonar", "sonar_control", "", _TOPIC),
    Key("SonarControl", "servoStateTopic", "/charle/sonar_to_base_link_position_controller/state", "sonar_control", "",
        "`thesis_topics` takes it"),
    Key("SonarControl", "servoCommandTopic", "/charle/sonar_to_base_link_position_controller/command", "sonar_control",
        "", "`thesis_topics` sends it"),
]  # fmt: skip

NAMES: List[Name] = [
    Name(Kind.NODE, "imagenex_852_driver", "imagenex_852_driver"),
    Name(Kind.NODE, "sonar_processing/SonarToCloud", "sonar_to_cloud", "stamps of points are those of pings"),
    Name(Kind.NODE, "sonar_processing/Thresholder", "thresholder", "points at the threshold itself go too"),
    Name(Kind.NODE, "sonar_processing/OutlierRemover", "outlier_remover"),
    Name(Kind.NODE, "sonar_processing/Wall2DDetector, LineDetector", "line_detector"),
    Name(Kind.NODE, "CircleDetector", "circle_detector"),
    Name(Kind.NODE, "the nodelet manager standalone_nodelet", "sonar_processing", "`processes:=one`, the default"),
    Name(Kind.NODE, "mlsm_manager/MLSM_core", "mlsm_core"),
    Name(Kind.NODE, "sonar_control/SonarControl", "sonar_control"),
    Name(Kind.NODE, "sonar_simulator/SonarSimulator", "sonar_simulator"),
    Name(Kind.NODE, "charle_description: AvoraLaserSonar, ImagingSonarSensor", "gazebo_sonar",
         "`laser_cone` and `collision` of the simulator"),
    Name(Kind.NODE, "inertial_navigation/ins_core", "dead_reckoning", "accelerations are not integrated"),
    Name(Kind.NODE, "driver_depth", "", "any driver of a depth sensor; dead_reckoning takes its topic"),
    Name(Kind.NODE, "charle_control", "", "the servo's own driver"),
    Name(Kind.LAUNCH, "processing_nodelets.launch", "sonar_processing.launch"),
    Name(Kind.LAUNCH, "sonar_processing.launch", "sonar_processing.launch"),
    Name(Kind.LAUNCH, "SonarToCloud.launch", "sonar_to_cloud.launch"),
    Name(Kind.LAUNCH, "Thresholder.launch", "thresholder.launch"),
    Name(Kind.LAUNCH, "OutlierRemover.launch", "outlier_remover.launch"),
    Name(Kind.LAUNCH, "Wall2DDetector.launch", "line_detector.launch"),
    Name(Kind.LAUNCH, "MLSM.launch", "mlsm_core.launch", "`mapping.launch` starts everything from beams to map"),
    Name(Kind.LAUNCH, "SonarControl.launch", "sonar_control.launch"),
    Name(Kind.LAUNCH, "charle_gazebo.launch, charle_world.launch, taliarte_collada_world.launch", "demo.launch",
         "`world:=` basin, harbour, or a file; with Gazebo `gazebo_sonar.launch`"),
    Name(Kind.LAUNCH, "charle_display.launch, charle_display_static.launch", "vehicle.launch", "`urdf/charle.urdf`"),
    Name(Kind.LAUNCH, "start_ins.launch", "dead_reckoning.launch"),
    Name(Kind.LAUNCH, "charle_control.launch, ekf.launch", "", "the servo's own driver; robot_localization"),
    Name(Kind.TOPIC, "/sonar/raw, /charle/sonar", "sonar/raw", "launch argument `beams` for another name"),
    Name(Kind.TOPIC, "/sonar/scan/sonarCloud", "sonar/scan/sonarCloud"),
    Name(Kind.TOPIC, "/sonar/scan/laserCloud", "sonar/scan/laserCloud", "PointCloud2, as the thesis says"),
    Name(Kind.TOPIC, "/sonar/beam", "sonar/beam"),
    Name(Kind.TOPIC, "/sonar/scan/thresholded", "sonar/scan/thresholded", "as many stamps as points"),
    Name(Kind.TOPIC, "/sonar/scan/cleaned", "sonar/scan/cleaned", "as many stamps as points"),
    Name(Kind.TOPIC, "/sonar/scan/line, /sonar/walls/cloud", "sonar/scan/line",
         "with `thesis:=true` `sonar/walls/cloud` too"),
    Name(Kind.TOPIC, "/sonar/scan/line/coefficients, /sonar/walls/coeff", "sonar/scan/line/coefficients",
         "Walls, all of a scan in one message; with `thesis:=true` one Wall a message on `sonar/walls/coeff`, and "
         "point and direction, as PCL has them, on `sonar/walls/model`"),
    Name(Kind.TOPIC, "/sonar/walls/markers", "sonar/scan/line/markers", "MarkerArray"),
    Name(Kind.TOPIC, "/Debug/Wall, /Sonar/Walls/image/debug", "", "what is left of a cloud behind each wall"),
    Name(Kind.TOPIC, "/MLSM/Markers", "MLSM/Markers", "MarkerArray; the list in 4.5.1 swaps the types of these two"),
    Name(Kind.TOPIC, "/MLSM/cloud", "MLSM/cloud",
         "PointCloud2, with height, depth, count and type of each block (with `cloud_free` FREE ones too)"),
    Name(Kind.TOPIC, "debug_cloud", "MLSM/scan", "with `thesis:=true` `debug_cloud` too, accepted or not"),
    Name(Kind.TOPIC, "startMatching", "startMatching", "matching is on from the start; see `start_matching`"),
    Name(Kind.TOPIC, "/cmd_vel", "cmd_vel"),
    Name(Kind.TOPIC, "tf map -> odom", "/tf", "with its yaw, 20 times a second instead of once a scan"),
    Name(Kind.TOPIC, "/charle/sonar_to_base_link_position_controller/command", "sonar_servo/command",
         "with `thesis:=true` both"),
    Name(Kind.TOPIC, "/charle/sonar_to_base_link_position_controller/state", "joint_states",
         "JointState; with `thesis:=true` a JointControllerState is taken too"),
    Name(Kind.SERVICE, "sonar_control (requestBehaviour)", "sonar_control/set_mode",
         "SetScanMode; with `thesis:=true` `sonar_control` too"),
    Name(Kind.FIELD, "avora_msgs/SonarScanLine", "SonarScanLine",
         "all fields as they were; `angle` in radians, counter-clockwise"),
    Name(Kind.FIELD, "avora_msgs/StampedIntensityCloud", "StampedIntensityCloud",
         "all fields as they were; `header` is filled, `timeStamps` are of pings and as many as points"),
    Name(Kind.FIELD, "avora_msgs/Wall.orientation", "Wall.orientation",
         "of the normal, all around; in 2015 between -90 and 90 degrees, so that opposite walls were alike"),
    Name(Kind.FIELD, "avora_msgs/Wall.distance", "Wall.distance"),
    Name(Kind.FIELD, "avora_msgs/Wall.header", "Walls.header"),
]  # fmt: skip
