"""Makes a ROS 2 bag of two svl recordings of one run: the pairs of the first, and what other sensors measure of the
second, whose left camera stands elsewhere: depth images, a point cloud and a laser scan, with transforms. Knows nothing
of svl but the topics of its recordings; written with rosbags.

    sensor_bag.py PAIRS.mcap SENSOR.mcap BAG
"""

import sys
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_HUMBLE)
T = STORE.types
LATE_NS = 3_000_000  # the sensors measure after the cameras


def quaternion(q):
    """The rotation matrix of x, y, z, w."""
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def components(r):
    """x, y, z, w of a rotation matrix whose trace is above -1."""
    w = 0.5 * np.sqrt(max(0.0, 1 + np.trace(r)))
    v = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    return [*(v / (4 * w)), w]


def pose(r, t):
    m = np.eye(4)
    m[:3, :3], m[:3, 3] = r, t
    return m


def read(path):
    """Per pair: stamp, images, pose of the left camera, P of both cameras, true depths."""
    with open(path, "rb") as file:
        pairs = {}
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for schema, channel, message in reader.iter_messages():
            pair = pairs.setdefault(message.log_time, {})
            if channel.message_encoding == "protobuf":
                decoded = DecoderFactory().decoder_for("protobuf", schema)(message.data)
            if channel.topic == "/truth/depth":
                image = STORE.deserialize_cdr(message.data, "sensor_msgs/msg/Image")
                pair["depth"] = image.data.view("<f4").reshape(image.height, image.width).astype(np.float64)
            elif channel.topic == "/rig/pose":
                t, q = decoded.translation, decoded.rotation
                pair["pose"] = pose(quaternion([q.x, q.y, q.z, q.w]), [t.x, t.y, t.z])
            elif channel.topic.endswith("/image"):
                shape = (decoded.height, decoded.width)
                pair[channel.topic] = np.frombuffer(decoded.data, np.uint8).reshape(shape)
            elif channel.topic.endswith("/calibration"):
                pair[channel.topic] = np.array(decoded.P).reshape(3, 4)
    return [(stamp, pairs[stamp]) for stamp in sorted(pairs)]


def header(stamp, frame):
    time = T["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9)
    return T["std_msgs/msg/Header"](time, frame)


def image(stamp, frame, encoding, pixels):
    height, width = pixels.shape
    data = np.ascontiguousarray(pixels).view(np.uint8).reshape(-1)
    step = pixels.dtype.itemsize * width
    return T["sensor_msgs/msg/Image"](header(stamp, frame), height, width, encoding, 0, step, data)


def camera_info(stamp, frame, p, size):
    roi = T["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
    k = p[:, :3].reshape(-1)
    return T["sensor_msgs/msg/CameraInfo"](
        header(stamp, frame), size[1], size[0], "plumb_bob", np.zeros(5), k, np.eye(3).reshape(-1), p.reshape(-1), 0, 0, roi
    )


def transform(parent, child, m):
    vector, rotation = T["geometry_msgs/msg/Vector3"], T["geometry_msgs/msg/Quaternion"]
    motion = T["geometry_msgs/msg/Transform"](vector(*m[:3, 3]), rotation(*components(m[:3, :3])))
    return T["geometry_msgs/msg/TransformStamped"](header(0, parent), child, motion)


def points(depth, p):
    """The points of a depth image in its camera's frame, a row each."""
    v, u = np.indices(depth.shape)
    x, y = (u - p[0, 2]) / p[0, 0], (v - p[1, 2]) / p[1, 1]
    return np.stack([x * depth, y * depth, depth], -1)


def cloud(stamp, frame, xyz):
    """Intensity first and a gap behind it, so that nothing stands where one would guess."""
    fields = [("intensity", 0, 7, 4), ("x", 8, 7, 4), ("y", 12, 7, 4), ("z", 16, 8, 8)]
    packed = np.zeros(len(xyz), {"names": ["intensity", "x", "y", "z"], "formats": ["<f4", "<f4", "<f4", "<f8"],
                                 "offsets": [0, 8, 12, 16], "itemsize": 24})
    packed["x"], packed["y"], packed["z"] = xyz.T
    kinds = [T["sensor_msgs/msg/PointField"](name, offset, kind, 1) for name, offset, kind, _ in fields]
    data = packed.view(np.uint8).reshape(-1)
    return T["sensor_msgs/msg/PointCloud2"](header(stamp, frame), 1, len(xyz), kinds, False, 24, 24 * len(xyz), data, False)


def scan(stamp, frame, depth, p):
    """The row of the optical axis, at equal angles; none where the two columns beside a ray differ."""
    row, f, cx = depth[int(round(p[1, 2]))], p[0, 0], p[0, 2]
    first, last = np.arctan((0 - cx) / f), np.arctan((len(row) - 1 - cx) / f)
    count = len(row)
    # To the left is positive.
    angles = np.linspace(-last, -first, count)
    u = f * np.tan(-angles) + cx
    left = np.clip(np.floor(u).astype(int), 0, count - 2)
    a, b = row[left], row[left + 1]
    with np.errstate(invalid="ignore"):
        depth = np.where(np.abs(a - b) < 0.02 * a, a + (u - left) * (b - a), np.nan)
    ranges = (depth / np.cos(angles)).astype(np.float32)
    step = (angles[-1] - angles[0]) / (count - 1)
    return T["sensor_msgs/msg/LaserScan"](
        header(stamp, frame), angles[0], angles[-1], step, 0.0, 0.03, 0.05, 30.0, ranges, np.zeros(0, np.float32)
    )


def main(pairs, sensor, out):
    pairs, sensor = read(pairs), read(sensor)
    assert len(pairs) == len(sensor) and pairs[0][0] == sensor[0][0]
    left_from_tof = np.linalg.inv(pairs[0][1]["pose"]) @ sensor[0][1]["pose"]
    # x forward, y left, z up, as lidars have it, and turned by some degrees.
    forward = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])
    yaw = quaternion([0, 0, np.sin(0.15), np.cos(0.15)])
    base_from_left = pose(forward.T, [0.1, 0.02, 0.15])
    base_from_tof = base_from_left @ left_from_tof
    base_from_laser = base_from_tof @ pose(forward, [0, 0, 0])
    base_from_lidar = base_from_laser @ pose(yaw, [0, 0, 0])
    lidar_from_tof = np.linalg.inv(base_from_lidar) @ base_from_tof
    frames = [("cam0", base_from_left), ("tof", base_from_tof), ("laser", base_from_laser), ("lidar", base_from_lidar)]
    with Writer(Path(out), version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        topics = {}

        def write(topic, stamp, message):
            kind = message.__msgtype__
            if topic not in topics:
                topics[topic] = bag.add_connection(topic, kind, typestore=STORE)
            bag.write(topics[topic], stamp, STORE.serialize_cdr(message, kind))

        links = [transform("base_link", child, m) for child, m in frames]
        write("/tf_static", pairs[0][0], T["tf2_msgs/msg/TFMessage"](links))
        for (stamp, pair), (_, other) in zip(pairs, sensor):
            for camera, side in [("cam0", "left"), ("cam1", "right")]:
                pixels = pair[f"/stereo/{side}/image"]
                p, size = pair[f"/stereo/{side}/calibration"], pixels.shape[::-1]
                # image_geometry: the right camera's P is in the left one's frame.
                write(f"/{camera}/camera_info", stamp, camera_info(stamp, "cam0", p, size))
                write(f"/{camera}/image_rect", stamp, image(stamp, "cam0", "mono8", pixels))
            late = stamp + LATE_NS
            depth = pair["depth"]
            millimetres = np.nan_to_num(np.round(1000 * depth), posinf=0).clip(0, 65535).astype("<u2")
            write("/cam0/depth16", late, image(late, "cam0", "16UC1", millimetres))
            write("/cam0/depth32", late, image(late, "cam0", "32FC1", depth.astype("<f4")))
            depth, p = other["depth"], other["/stereo/left/calibration"]
            write("/tof/camera_info", late, camera_info(late, "tof", p, depth.shape[::-1]))
            write("/tof/image", late, image(late, "tof", "32FC1", depth.astype("<f4")))
            # Every sixth row, every other column: like a lidar of sixty rings.
            xyz = points(depth, p)[::6, ::2].reshape(-1, 3)
            xyz = xyz @ lidar_from_tof[:3, :3].T + lidar_from_tof[:3, 3]
            write("/lidar/points", late, cloud(late, "lidar", xyz))
            write("/scan", late, scan(late, "laser", depth, p))


main(*sys.argv[1:])
