"""Reads the ROS 2 messages of a recording with rosbags' types and CDR, and prints, per topic, the number of messages and
the sum of their finite pixels, as JSON. Knows nothing of svl; rosbags' own file reader takes nothing but pure bags."""

import json
import sys

import numpy as np
from mcap.reader import make_reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore


def main(path):
    store, topics = get_typestore(Stores.EMPTY), {}
    with open(path, "rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            if channel.message_encoding != "cdr":
                continue
            if schema.name not in store.types:
                store.register(get_types_from_msg(schema.data.decode(), schema.name))
            image = store.deserialize_cdr(message.data, schema.name)
            stamp = image.header.stamp.sec * 10**9 + image.header.stamp.nanosec
            assert stamp == message.log_time and image.encoding == "32FC1" and image.step == 4 * image.width
            pixels = image.data.view("<f4").reshape(image.height, image.width).astype(np.float64)
            count, total = topics.get(channel.topic, (0, 0.0))
            topics[channel.topic] = (count + 1, total + float(pixels[np.isfinite(pixels)].sum()))
    json.dump({"topics": topics}, sys.stdout)


main(sys.argv[1])
