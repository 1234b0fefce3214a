//! The types of the messages: their names, and the definitions by which readers that know no ROS take them apart.
//!
//! A definition is the message's fields, one a line, and then those of the types that it is made of, each behind a line of 80
//! equal signs and one with its name.

/// A type of messages.
#[derive(Clone, Copy, Debug)]
pub(super) struct Schema {
    /// The name.
    pub name: &'static str,
    /// The definition with those of its parts.
    pub definition: &'static str,
}

/// Joins the fields of a message and those of its parts.
macro_rules! schema {
    ($name:literal, $fields:expr $(, $part:ident)*) => {
        Schema { name: $name, definition: concat!($fields, $($part!()),*) }
    };
}

/// Declares a part: its name and its fields.
macro_rules! part {
    ($part:ident, $name:literal, $fields:literal) => {
        macro_rules! $part {
            () => {
                concat!(
                    "================================================================================\nMSG: ",
                    $name,
                    "\n",
                    $fields
                )
            };
        }
    };
}

part!(time, "builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n");
part!(header, "std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n");
part!(point, "geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n");
part!(vector3, "geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n");
part!(quaternion, "geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n");
part!(pose, "geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n");
part!(
    pose_with_covariance,
    "geometry_msgs/PoseWithCovariance",
    "geometry_msgs/Pose pose\nfloat64[36] covariance\n"
);
part!(twist, "geometry_msgs/Twist", "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n");
part!(
    twist_with_covariance,
    "geometry_msgs/TwistWithCovariance",
    "geometry_msgs/Twist twist\nfloat64[36] covariance\n"
);
part!(
    transform,
    "geometry_msgs/Transform",
    "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"
);
part!(
    transform_stamped,
    "geometry_msgs/TransformStamped",
    "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n"
);
part!(
    point_field,
    "sensor_msgs/PointField",
    "uint8 INT8=1\nuint8 UINT8=2\nuint8 INT16=3\nuint8 UINT16=4\nuint8 INT32=5\nuint8 UINT32=6\nuint8 FLOAT32=7\n\
     uint8 FLOAT64=8\nstring name\nuint32 offset\nuint8 datatype\nuint32 count\n"
);
part!(
    region_of_interest,
    "sensor_msgs/RegionOfInterest",
    "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n"
);
part!(
    custom_point,
    "livox_ros_driver2/CustomPoint",
    "uint32 offset_time\nfloat32 x\nfloat32 y\nfloat32 z\nuint8 reflectivity\nuint8 tag\nuint8 line\n"
);

part!(
    detection,
    "vision_msgs/Detection3D",
    "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\nvision_msgs/BoundingBox3D bbox\nstring id\n"
);
part!(
    hypothesis_with_pose,
    "vision_msgs/ObjectHypothesisWithPose",
    "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose\n"
);
part!(hypothesis, "vision_msgs/ObjectHypothesis", "string class_id\nfloat64 score\n");
part!(bounding_box, "vision_msgs/BoundingBox3D", "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size\n");

pub(super) const POINT_CLOUD: Schema = schema!(
    "sensor_msgs/msg/PointCloud2",
    "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\nbool is_bigendian\nuint32 point_step\n\
     uint32 row_step\nuint8[] data\nbool is_dense\n",
    header,
    time,
    point_field
);

pub(super) const LIVOX: Schema = schema!(
    "livox_ros_driver2/msg/CustomMsg",
    "std_msgs/Header header\nuint64 timebase\nuint32 point_num\nuint8 lidar_id\nuint8[3] rsvd\n\
     livox_ros_driver2/CustomPoint[] points\n",
    header,
    time,
    custom_point
);

pub(super) const IMAGE: Schema = schema!(
    "sensor_msgs/msg/Image",
    "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\nuint8[] data\n",
    header,
    time
);

pub(super) const CAMERA_INFO: Schema = schema!(
    "sensor_msgs/msg/CameraInfo",
    "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\nfloat64[9] k\nfloat64[9] r\n\
     float64[12] p\nuint32 binning_x\nuint32 binning_y\nsensor_msgs/RegionOfInterest roi\n",
    header,
    time,
    region_of_interest
);

pub(super) const IMU: Schema = schema!(
    "sensor_msgs/msg/Imu",
    "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n\
     geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n\
     geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n",
    header,
    time,
    quaternion,
    vector3
);

pub(super) const ODOMETRY: Schema = schema!(
    "nav_msgs/msg/Odometry",
    "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n\
     geometry_msgs/TwistWithCovariance twist\n",
    header,
    time,
    pose_with_covariance,
    pose,
    point,
    quaternion,
    twist_with_covariance,
    twist,
    vector3
);

pub(super) const TRANSFORMS: Schema = schema!(
    "tf2_msgs/msg/TFMessage",
    "geometry_msgs/TransformStamped[] transforms\n",
    transform_stamped,
    header,
    time,
    transform,
    vector3,
    quaternion
);

pub(super) const DETECTIONS: Schema = schema!(
    "vision_msgs/msg/Detection3DArray",
    "std_msgs/Header header\nvision_msgs/Detection3D[] detections\n",
    header,
    time,
    detection,
    hypothesis_with_pose,
    hypothesis,
    bounding_box,
    pose_with_covariance,
    pose,
    point,
    quaternion,
    vector3
);
