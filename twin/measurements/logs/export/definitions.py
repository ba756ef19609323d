"""Definitions of the ROS 2 messages that are written: (type, definition with those it is made of)."""

_RULE = "=" * 80
_TIME = f"{_RULE}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
_HEADER = f"{_RULE}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"

FLOAT64 = ("std_msgs/msg/Float64", "float64 data\n")
STRING = ("std_msgs/msg/String", "string data\n")
POINT_STAMPED = (
    "geometry_msgs/msg/PointStamped",
    "std_msgs/Header header\ngeometry_msgs/Point point\n"
    + f"{_RULE}\nMSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n"
    + _HEADER
    + _TIME,
)
JOINT_STATE = (
    "sensor_msgs/msg/JointState",
    "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n" + _HEADER + _TIME,
)
