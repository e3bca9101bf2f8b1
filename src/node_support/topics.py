"""The topics of the graph (thesis 4.5.1), relative to a node's namespace unless they begin with a slash."""

BEAMS = "sonar/raw"  # SonarScanLine: every beam of the sonar
NEWEST_BEAM = "sonar/beam"  # PointCloud2: the newest beam in the target frame
SCANS = "sonar/scan/sonarCloud"  # StampedIntensityCloud: scans
LASER_POINTS = "sonar/scan/laserCloud"  # PointCloud2: scans of one point per beam
LASER_SCANS = "sonar/scan/laserScan"  # LaserScan: whole revolutions of the head as a planar laser would measure them
TURNS = "sonar/scan/turn"  # PointCloud2 with times: whole revolutions of the head from the newest beam's pose
POLAR_SCANS = (
    "sonar/scan/polar"  # StampedIntensityCloud, organised: whole revolutions of the head, one row for each beam
)
THRESHOLDED = "sonar/scan/thresholded"  # StampedIntensityCloud: scans without weak points
CLEANED = "sonar/scan/cleaned"  # StampedIntensityCloud: scans without weak points and outliers
ECHOES = "sonar/scan/echoes"  # StampedIntensityCloud: the echoes of polar scans
LINES = "sonar/scan/line"  # PointCloud2: points on walls; below it `coefficients` and `markers`
CIRCLES = "sonar/scan/circle"  # PointCloud2: points on circles; below it `coefficients` and `markers`
IMAGE = "sonar/image"  # Image: the beams drawn as seen from above
CAMERA_INFO = "sonar/camera_info"  # CameraInfo: the scale of the image
RAYS = "sonar/rays"  # LaserScan, PointCloud or PointCloud2: what a ray sensor of Gazebo measures
JOINT_STATES = "joint_states"  # JointState: where the sonar's servo stands
SERVO_COMMANDS = "sonar_servo/command"  # Float64: where the sonar's servo shall turn, rad
VELOCITY_COMMANDS = "cmd_vel"  # Twist: where the vehicle shall go; its velocity where nothing better is published
HEADING = "imu"  # Imu: the orientation that a compass or an AHRS measures
DEPTH = "depth"  # PoseWithCovarianceStamped, Float64 or FluidPressure: what a depth sensor measures
MEASURED_VELOCITY = "dvl"  # TwistWithCovarianceStamped or a DVL's own message: the velocity that a DVL measures
VELOCITY = "velocity"  # Twist: the velocity that the simulated vehicle measures
ODOMETRY = "odom"  # Odometry: the vehicle's dead reckoning
GROUND_TRUTH = "ground_truth"  # Odometry: where the simulated vehicle truly is
CLOCK = "/clock"  # Clock: simulated time
TRANSFORMS = "/tf"  # TFMessage: transforms that change
STATIC_TRANSFORMS = "/tf_static"  # TFMessage: transforms that do not change
START_MATCHING = "startMatching"  # Bool: whether scans are matched with the map
MAP_MARKERS = "MLSM/Markers"  # MarkerArray: the blocks of the map
MAP_CLOUD = "MLSM/cloud"  # PointCloud2: the blocks of the map
MAP_GRID = "MLSM/grid"  # OccupancyGrid: free, unknown and occupied from above
MAP_OCTOMAP = "MLSM/octomap"  # octomap_msgs/Octomap: the map as voxels, where these messages are installed
MATCHED_POSE = "MLSM/pose"  # PoseWithCovarianceStamped: the vehicle in the map at the newest match
MATCHED_ODOMETRY = "MLSM/odometry"  # Odometry: the vehicle in the map at the newest match
MATCHED_PATH = "MLSM/path"  # Path: the vehicle in the map at all matches
