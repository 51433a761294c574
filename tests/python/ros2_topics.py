"""The other end of svl's ROS 2 topics: CycloneDDS, as ROS has it, on the loopback interface.

    ros2_topics.py publish DOMAIN PAIRS HZ WIDTH HEIGHT [raw] [latched] [until=FILE] [lose=N] [lose_pairs=N]
    ros2_topics.py read DOMAIN TOPIC MESSAGES SECONDS [reliable] [ready=FILE] [until=FILE] [ages]

`latched`: the calibrations are sent once, for late subscribers too. `until`: ends once that file is there. `lose`:
of every N-th pair the left image has a number and is not sent; `lose_pairs`: both images. `ready`: a file to make after
subscribing. SVL_MULTICAST: the interface to use with multicast, in place of 127.0.0.1 without.

`publish` prints, when it is done, a JSON line per pair: stamp and CRC-32 of left and right. `read` prints a JSON line
per message that svl publishes; with `ages` one of all: their number, the first stamp, and milliseconds from stamp to
arrival.
"""

import json
import os
import sys
import time
import zlib
from dataclasses import dataclass

LOOPBACK = """<CycloneDDS><Domain id="any"><General><Interfaces>
<NetworkInterface address="127.0.0.1"/></Interfaces><AllowMulticast>false</AllowMulticast></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>50</MaxAutoParticipantIndex>
<Peers><Peer address="127.0.0.1"/></Peers></Discovery></Domain></CycloneDDS>"""
MULTICAST = """<CycloneDDS><Domain id="any"><General><Interfaces><NetworkInterface name="{}" multicast="true"/></Interfaces>
</General></Domain></CycloneDDS>"""
interface = os.environ.get("SVL_MULTICAST")
os.environ["CYCLONEDDS_URI"] = MULTICAST.format(interface) if interface else LOOPBACK

import numpy
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float32, float64, int32, sequence, uint8, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration


def ros(package):
    """The name that ROS gives a type in DDS."""
    return lambda cls: f"{package}::msg::dds_::{cls}_"


@dataclass
class Time(IdlStruct, typename=ros("builtin_interfaces")("Time")):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename=ros("std_msgs")("Header")):
    stamp: Time
    frame_id: str


@dataclass
class Image(IdlStruct, typename=ros("sensor_msgs")("Image")):
    header: Header
    height: uint32
    width: uint32
    encoding: str
    is_bigendian: uint8
    step: uint32
    data: sequence[uint8]


def image_of(size):
    """Image with `size` bytes: a length and an array are sent as a sequence is, and packed ten times as fast."""

    @dataclass
    class FixedImage(IdlStruct, typename=ros("sensor_msgs")("Image")):
        header: Header
        height: uint32
        width: uint32
        encoding: str
        is_bigendian: uint8
        step: uint32
        length: uint32
        data: array[uint8, size]

    return FixedImage


@dataclass
class RegionOfInterest(IdlStruct, typename=ros("sensor_msgs")("RegionOfInterest")):
    x_offset: uint32
    y_offset: uint32
    height: uint32
    width: uint32
    do_rectify: bool


@dataclass
class CameraInfo(IdlStruct, typename=ros("sensor_msgs")("CameraInfo")):
    header: Header
    height: uint32
    width: uint32
    distortion_model: str
    d: sequence[float64]
    k: array[float64, 9]
    r: array[float64, 9]
    p: array[float64, 12]
    binning_x: uint32
    binning_y: uint32
    roi: RegionOfInterest


@dataclass
class PointField(IdlStruct, typename=ros("sensor_msgs")("PointField")):
    name: str
    offset: uint32
    datatype: uint8
    count: uint32


@dataclass
class PointCloud2(IdlStruct, typename=ros("sensor_msgs")("PointCloud2")):
    header: Header
    height: uint32
    width: uint32
    fields: sequence[PointField]
    is_bigendian: bool
    point_step: uint32
    row_step: uint32
    data: sequence[uint8]
    is_dense: bool


@dataclass
class DisparityImage(IdlStruct, typename=ros("stereo_msgs")("DisparityImage")):
    header: Header
    image: Image
    f: float32
    t: float32
    valid_window: RegionOfInterest
    min_disparity: float32
    max_disparity: float32
    delta_d: float32


@dataclass
class LaserScan(IdlStruct, typename=ros("sensor_msgs")("LaserScan")):
    header: Header
    angle_min: float32
    angle_max: float32
    angle_increment: float32
    time_increment: float32
    scan_time: float32
    range_min: float32
    range_max: float32
    ranges: sequence[float32]
    intensities: sequence[float32]


@dataclass
class KeyValue(IdlStruct, typename=ros("diagnostic_msgs")("KeyValue")):
    key: str
    value: str


@dataclass
class DiagnosticStatus(IdlStruct, typename=ros("diagnostic_msgs")("DiagnosticStatus")):
    level: uint8
    name: str
    message: str
    hardware_id: str
    values: sequence[KeyValue]


@dataclass
class DiagnosticArray(IdlStruct, typename=ros("diagnostic_msgs")("DiagnosticArray")):
    header: Header
    status: sequence[DiagnosticStatus]


BEST_EFFORT = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(10))
LATCHED = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.Durability.TransientLocal,
              Policy.History.KeepLast(1))
RELIABLE = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(10))
FOCAL, BASELINE, DISPARITY = 400.0, 0.1, 16


def option(options, name):
    found = [value.removeprefix(f"{name}=") for value in options if value.startswith(f"{name}=")]
    return found[0] if found else ""


def publish(domain, pairs, hz, width, height, *options):
    topics = ["/cam/left/", "/cam/right/"]
    name = "image_raw" if "raw" in options else "image_rect"
    width, height, hz = int(width), int(height), float(hz)
    Image = image_of(width * height)
    latched = "latched" in options
    until, lose, lose_pairs = (option(options, name) for name in ["until", "lose", "lose_pairs"])
    is_lost = lambda i, every: every and i % int(every) == int(every) - 1
    participant = DomainParticipant(int(domain))
    writer = lambda topic, kind, qos: DataWriter(participant, Topic(participant, f"rt{topic}", kind), qos=qos)
    images = [writer(f"{topic}{name}", Image, BEST_EFFORT) for topic in topics]
    infos = [writer(f"{topic}camera_info", CameraInfo, LATCHED if latched else RELIABLE) for topic in topics]
    # A textured wall, moved a little from pair to pair, on images of the same scene.
    texture = numpy.random.default_rng(1).integers(0, 256, (height, width + 256), dtype=numpy.uint8)
    begin, lines = time.time(), []
    for i in range(int(pairs)):
        if os.path.exists(until):
            break
        time.sleep(max(0, begin + i / hz - time.time()))
        now = time.time_ns()
        stamp = Time(now // 10**9, now % 10**9)
        sent = []
        for side in range(2):
            header = Header(stamp, "cam_left_optical_frame")
            shift = i % 64 + DISPARITY * side
            pixels = numpy.ascontiguousarray(texture[:, shift : shift + width]).tobytes()
            k = [FOCAL, 0, (width - 1) / 2, 0, FOCAL, (height - 1) / 2, 0, 0, 1]
            p = [*k[:3], -FOCAL * BASELINE * side, *k[3:6], 0, *k[6:], 0]
            info = CameraInfo(header, height, width, "plumb_bob", [0.0] * 5, [float(v) for v in k],
                              [1.0, 0, 0, 0, 1, 0, 0, 0, 1], [float(v) for v in p], 0, 0,
                              RegionOfInterest(0, 0, 0, 0, False))
            if i == 0 or not latched:
                infos[side].write(info)
            image = Image(header, height, width, "mono8", 0, width, len(pixels), pixels)
            lost = is_lost(i, lose_pairs) or side == 0 and is_lost(i, lose)
            images[side].dispose(image) if lost else images[side].write(image)
            sent.append(zlib.crc32(pixels))
        lines.append({"stamp_ns": now, "crc": sent})
    for line in lines:
        print(json.dumps(line))


def described(message):
    fields = {"frame_id": message.header.frame_id,
              "stamp_ns": message.header.stamp.sec * 10**9 + message.header.stamp.nanosec}
    if isinstance(message, PointCloud2):
        names = [field.name for field in message.fields]
        assert [f.datatype for f in message.fields] == [7] * len(names) and message.row_step == len(message.data)
        points = numpy.frombuffer(bytes(message.data), "<f4").reshape(message.height * message.width, len(names))
        layout = {"size": (message.width, message.height), "steps": (message.point_step, message.row_step),
                  "offsets": [f.offset for f in message.fields], "counts": [f.count for f in message.fields],
                  "is_bigendian": message.is_bigendian}
        return fields | layout | {"fields": names, "dense": message.is_dense, "points": points.tolist()}
    if isinstance(message, DisparityImage):
        pixels = numpy.frombuffer(bytes(message.image.data), "<f4").reshape(message.image.height, message.image.width)
        return fields | {"size": pixels.shape[::-1], "encoding": message.image.encoding, "f": message.f, "t": message.t,
                         "median": float(numpy.median(pixels[pixels >= message.min_disparity])),
                         "max_disparity": message.max_disparity}
    if isinstance(message, LaserScan):
        # JSON has no numbers for free and unknown.
        numbers = {field: getattr(message, field) for field in message.__annotations__ if field != "header"}
        return fields | numbers | {"ranges": [repr(r) if r != r or r == numpy.inf else r for r in message.ranges]}
    if isinstance(message, Image):
        pixels = numpy.frombuffer(bytes(message.data), "<f4").reshape(message.height, message.width)
        return fields | {"size": (message.width, message.height), "encoding": message.encoding, "step": message.step,
                         "is_bigendian": message.is_bigendian, "median": float(numpy.nanmedian(pixels)), "unknown": int(numpy.isnan(pixels).sum())}
    status = message.status[0]
    return fields | {"level": status.level, "name": status.name, "message": status.message,
                     "values": {pair.key: pair.value for pair in status.values}}


def read(domain, name, messages, seconds, *options):
    kinds = {"points": PointCloud2, "scan": LaserScan, "disparity": DisparityImage, "depth": Image,
             "diagnostics": DiagnosticArray}
    participant = DomainParticipant(int(domain))
    topic = Topic(participant, f"rt{name}", kinds[name.rsplit("/")[-1]])
    # Readers of the status ask for reliability, as ROS's aggregator of diagnostics does.
    qos = RELIABLE if name == "/diagnostics" or "reliable" in options else BEST_EFFORT
    reader, end, left = DataReader(participant, topic, qos=qos), time.time() + float(seconds), int(messages)
    ready, until = (option(options, name) for name in ["ready", "until"])
    if ready:
        open(ready, "w").close()
    ages, first, ended = [], None, False
    while left and not ended:
        # What came before the end is taken.
        ended = time.time() >= end or os.path.exists(until)
        # The end of a publisher is a sample without a message.
        for message in (sample for sample in reader.take(N=left) if hasattr(sample, "header")):
            left -= 1
            if "ages" not in options:
                print(json.dumps(described(message)), flush=True)
                continue
            stamp_ns = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
            ages.append((time.time_ns() - stamp_ns) / 1e6)
            first = stamp_ns if first is None else first
        time.sleep(0.002 if "ages" in options else 0.01)
    if "ages" in options:
        print(json.dumps({"messages": len(ages), "first_ns": first, "ages_ms": [round(age, 1) for age in ages]}))


{"publish": publish, "read": read}[sys.argv[1]](*sys.argv[2:])
