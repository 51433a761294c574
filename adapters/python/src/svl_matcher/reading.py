"""svl's recordings as arrays, its reports as data frames."""

import io
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


def read(recording):
    """The pairs of a recording of svl's, in their order."""
    from mcap.reader import make_reader
    from mcap_protobuf.decoder import DecoderFactory as Protobuf
    from mcap_ros2.decoder import DecoderFactory as Ros2

    with open(recording, "rb") as file:
        reader = make_reader(file, decoder_factories=[Protobuf(), Ros2()])
        summary = reader.get_summary()
        channels = summary.channels.values() if summary else []
        there = {channel.topic for channel in channels}
        if not {_LEFT, _RIGHT} <= there:
            raise ValueError(f"{recording}: has no {_LEFT} and {_RIGHT}: no recording of svl's")
        topics = sorted(there & {_LEFT, _RIGHT, _DEPTH})
        waiting = {}
        messages = reader.iter_decoded_messages(topics=topics)
        for _, channel, message, decoded in messages:
            images = waiting.setdefault(message.log_time, {})
            images[channel.topic] = _image(decoded)
            if len(images) == len(topics):
                del waiting[message.log_time]
                images = (images[_LEFT], images[_RIGHT], images.get(_DEPTH))
                yield Pair(message.log_time, *images)


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
