"""Reads a recording with the public MCAP libraries and prints, per topic, the number of messages and a sum of what
they hold, as JSON. Knows nothing of svl."""

import io
import json
import sys

import numpy as np
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory as Protobuf
from mcap_ros2.decoder import DecoderFactory as Ros2
from PIL import Image


class Json:
    """The mcap library leaves JSON to its users."""

    def decoder_for(self, message_encoding, _schema):
        return json.loads if message_encoding == "json" else None


def value(schema, message):
    """One number that depends on all that matters of the message."""
    if schema == "foxglove.RawImage":
        assert message.encoding == "mono8" and len(message.data) == message.step * message.height
        return int(np.frombuffer(message.data, np.uint8).sum())
    if schema == "foxglove.CompressedImage":
        return int(np.asarray(Image.open(io.BytesIO(message.data))).astype(np.int64).sum())
    if schema == "sensor_msgs/msg/Image":
        assert message.encoding == "32FC1" and message.step == 4 * message.width
        pixels = np.frombuffer(bytes(message.data), "<f4").reshape(message.height, message.width)
        return float(np.nansum(pixels.astype(np.float64)))
    if schema == "foxglove.CameraCalibration":
        return sum(message.K) + sum(message.P) + sum(message.R)
    if schema == "foxglove.FrameTransform":
        t, q = message.translation, message.rotation
        return t.x + t.y + t.z + q.x + q.y + q.z + q.w
    raise ValueError(f"unexpected schema {schema}")


def main(path):
    topics = {}
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[Protobuf(), Ros2(), Json()])
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            assert message.log_time == message.publish_time
            if channel.message_encoding == "json":
                assert set(json.loads(schema.data)["required"]) <= set(decoded)
                number = decoded["sequence"]
            else:
                number = value(schema.name, decoded)
            count, total = topics.get(channel.topic, (0, 0))
            topics[channel.topic] = (count + 1, total + number)
        metadata = {record.name: dict(record.metadata) for record in reader.iter_metadata()}
        attachments = {record.name: record.data.decode() for record in reader.iter_attachments()}
    json.dump({"topics": topics, "metadata": metadata, "attachments": attachments}, sys.stdout)


main(sys.argv[1])
