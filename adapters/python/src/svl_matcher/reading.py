"""svl's recordings as arrays, its reports as data frames."""

import io
import json
from pathlib import Path
from typing import NamedTuple, Optional

import numpy as np


class Pair(NamedTuple):
    """A synchronized pair of a recording."""

    stamp_ns: int
    # uint8, height x width.
    left: np.ndarray
    right: np.ndarray
    # True distances along the optical axis in metres, where the recording has them; NaN for none.
    depth_m: Optional[np.ndarray]


_LEFT, _RIGHT, _DEPTH = "/stereo/left/image", "/stereo/right/image", "/truth/depth"
# The last message of a pair.
_SYNC = "/stereo/sync"


class _Json:
    """The mcap library leaves JSON to its users."""

    def decoder_for(self, message_encoding, _schema):
        return json.loads if message_encoding == "json" else None


def read(recording):
    """The pairs of a recording of svl's, in their order. One that was cut off ends with its last whole pair."""
    from mcap.reader import make_reader
    from mcap_protobuf.decoder import DecoderFactory as Protobuf
    from mcap_ros2.decoder import DecoderFactory as Ros2

    with open(recording, "rb") as file:
        reader = make_reader(file, decoder_factories=[Protobuf(), Ros2(), _Json()])
        # By the number of the pair: the right image has a stamp of its own.
        pairs = {}
        found = set()
        topics = [_LEFT, _RIGHT, _DEPTH, _SYNC]
        for _, channel, message, decoded in reader.iter_decoded_messages(topics=topics):
            found.add(channel.topic)
            pair = pairs.setdefault(message.sequence, {})
            pair[channel.topic] = decoded
            if channel.topic == _LEFT:
                pair["stamp"] = message.log_time
            if {_LEFT, _RIGHT, _SYNC} <= pair.keys():
                del pairs[message.sequence]
                depth = pair.get(_DEPTH)
                yield Pair(
                    pair["stamp"],
                    _image(pair[_LEFT]),
                    _image(pair[_RIGHT]),
                    None if depth is None else _image(depth),
                )
        missing = {_LEFT, _RIGHT, _SYNC} - found
        if missing:
            names = ", ".join(sorted(missing))
            raise ValueError(f"{recording}: is no recording of svl's: it has no {names}")


def _image(message):
    encoding = getattr(message, "encoding", None)
    if encoding is None:
        from PIL import Image

        return np.asarray(Image.open(io.BytesIO(message.data)))
    kind = np.dtype({"mono8": "u1", "32FC1": "<f4"}[encoding])
    rows = np.frombuffer(bytes(message.data), kind)
    return rows.reshape(message.height, message.step // kind.itemsize)[:, : message.width]


def report(folder):
    """The tables of a report as data frames, by their names: rows, cells, summary and so on."""
    import pandas

    folder = Path(folder)
    if not (folder / "manifest.json").is_file():
        raise ValueError(f"{folder}: is no report of svl's: it has no manifest.json")
    return {path.stem: pandas.read_csv(path) for path in sorted(folder.glob("*.csv"))}
