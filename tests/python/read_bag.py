"""Reads a ROS 2 bag with rosbags' file reader, and every message with mcap-ros2-support too, and prints, per topic, the
number of messages and a sum of what they hold, as JSON. Knows nothing of svl."""

import io
import json
import sys
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from PIL import Image
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore


def value(schema, message):
    """One number that depends on all that matters of the message."""
    if schema == "sensor_msgs/msg/Image":
        dtype = {"mono8": "u1", "32FC1": "<f4"}[message.encoding]
        assert not message.is_bigendian and message.step == np.dtype(dtype).itemsize * message.width
        pixels = np.frombuffer(bytes(message.data), dtype).reshape(message.height, message.width)
        return float(pixels[np.isfinite(pixels)].astype(np.float64).sum())
    if schema == "sensor_msgs/msg/CompressedImage":
        assert message.format == "mono8; png compressed "
        return float(np.asarray(Image.open(io.BytesIO(bytes(message.data)))).astype(np.int64).sum())
    if schema == "sensor_msgs/msg/CameraInfo":
        assert message.distortion_model == "plumb_bob" and len(message.d) == 5 and message.roi.width == 0
        return float(sum(message.d) + sum(message.k) + sum(message.p) + sum(message.r))
    if schema == "tf2_msgs/msg/TFMessage":
        parts = [(each.transform.translation, each.transform.rotation) for each in message.transforms]
        return sum(t.x + t.y + t.z + q.x + q.y + q.z + q.w for t, q in parts)
    if schema == "sensor_msgs/msg/PointCloud2":
        assert [field.name for field in message.fields] == ["x", "y", "z", "probability"] and message.point_step == 16
        return float(np.frombuffer(bytes(message.data), "<f4").reshape(-1, 4)[:, 2].sum())
    if schema == "sensor_msgs/msg/LaserScan":
        assert message.header.frame_id == "stereo_left_scan" and len(message.ranges) == len(message.intensities)
        assert 0 < message.range_min < 1, message.range_min
        return float(np.isfinite(message.ranges).sum())
    if schema == "stereo_msgs/msg/DisparityImage":
        # The range of the search is stored, not the greatest disparity found.
        assert message.max_disparity == 80, message.max_disparity
        return message.f * message.t
    if schema == "std_msgs/msg/String":
        return json.loads(message.data)["sequence"]
    raise ValueError(f"unexpected schema {schema}")


def stamp(message):
    """Of the header, where there is one."""
    header = getattr(message, "header", None) or getattr(getattr(message, "transforms", [None])[0], "header", None)
    return header and header.stamp.sec * 10**9 + header.stamp.nanosec


def main(path):
    # ROS's own definitions; those in the bag must be the same types.
    store, topics, sizes = get_typestore(Stores.ROS2_HUMBLE), {}, set()
    with open(path, "rb") as file, Reader(Path(path)) as bag:
        for connection in bag.connections:
            types = get_types_from_msg(connection.msgdef.data, connection.msgtype)
            fields = lambda kind, types: [(name, kind_of) for name, kind_of in types[kind][1]]
            for kind in types:
                assert fields(kind, types) == fields(kind, store.fielddefs), f"{kind} is not ROS's"
        others = make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages(log_time_order=False)
        others = sorted(others, key=lambda other: (other[2].log_time, other[1].topic, other[2].sequence, other[2].data))
        ours = sorted(bag.messages(), key=lambda message: (message[1], message[0].topic, message[2]))
        assert len(ours) == len(others)
        for (connection, time, raw), (schema, _, _, other) in zip(ours, others):
            message = store.deserialize_cdr(raw, connection.msgtype)
            number = value(connection.msgtype, message)
            assert number == value(schema.name, other), f"{connection.topic}: rosbags and mcap-ros2-support disagree"
            assert stamp(message) in (None, time)
            if connection.topic.startswith("/stereo") and hasattr(message, "header"):
                # image_geometry's StereoCameraModel: both in the left camera's frame.
                assert message.header.frame_id == "stereo_left"
            if hasattr(message, "width") and not hasattr(message, "point_step"):
                sizes.add((message.width, message.height))
            count, total = topics.get(connection.topic, (0, 0))
            topics[connection.topic] = (count + 1, total + number)
    assert len(sizes) == 1, f"images and cameras of sizes {sizes}"
    json.dump({"topics": topics}, sys.stdout)


main(sys.argv[1])
