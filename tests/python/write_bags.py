"""Writes small stereo bags of mono16 images with 12 bits by rosbags, one per storage and compression, into the folder
that is named. Knows nothing of svl."""

import sys
from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

store = get_typestore(Stores.ROS2_HUMBLE)
Image, Header, Time = (
    store.types[name] for name in ("sensor_msgs/msg/Image", "std_msgs/msg/Header", "builtin_interfaces/msg/Time")
)
WIDTH, HEIGHT = 40, 20


def image(number, side):
    pixels = np.zeros((HEIGHT, WIDTH), "<u2")
    rows = 256 * (np.arange(HEIGHT)[:, None] % 12)
    pixels[:, :] = rows + 100 * number + np.arange(WIDTH) * (1 + side)
    pixels[0, 1] = 1024 + 16 * number
    header = Header(Time(1_700_000_000, 50_000_000 * number), "camera")
    return Image(header, HEIGHT, WIDTH, "mono16", 0, 2 * WIDTH, pixels.view("u1").reshape(-1))


def write(path, plugin, compression):
    writer = Writer(path, version=9, storage_plugin=plugin)
    if compression is not None:
        writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        topics = [
            writer.add_connection(f"/{side}/image_raw", Image.__msgtype__, typestore=store) for side in ("left", "right")
        ]
        for number in range(6):
            for side, topic in enumerate(topics):
                message = store.serialize_cdr(image(number, side), Image.__msgtype__)
                writer.write(topic, 1_700_000_000_000_000_000 + 50_000_000 * number + side, message)


def write_ros1(path, compression):
    store1 = get_typestore(Stores.ROS1_NOETIC)
    writer = Ros1Writer(path)
    if compression is not None:
        writer.set_compression(compression)
    with writer:
        topics = [
            writer.add_connection(f"/{side}/image_raw", Image.__msgtype__, typestore=store1)
            for side in ("left", "right")
        ]
        for number in range(6):
            for side, topic in enumerate(topics):
                message = image(number, side)
                header = store1.types["std_msgs/msg/Header"](number, message.header.stamp, "camera")
                fields = {**vars(message), "header": header}
                data = store1.serialize_ros1(store1.types[Image.__msgtype__](**fields), Image.__msgtype__)
                writer.write(topic, 1_700_000_000_000_000_000 + 50_000_000 * number + side, data)


out = Path(sys.argv[1])
for name, compression in (
    ("none", None),
    ("bz2", Ros1Writer.CompressionFormat.BZ2),
    ("lz4", Ros1Writer.CompressionFormat.LZ4),
):
    write_ros1(out / f"ros1-{name}.bag", compression)
for name, plugin in (("sqlite", StoragePlugin.SQLITE3), ("mcap", StoragePlugin.MCAP)):
    write(out / name, plugin, None)
    write(out / f"{name}-file", plugin, CompressionMode.FILE)
    write(out / f"{name}-message", plugin, CompressionMode.MESSAGE)
