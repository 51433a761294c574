"""Writes images of noise in all pixel encodings into two bags by rosbags, and prints as JSON what OpenCV or numpy makes of
them: grey, colours, depths in metres. Knows nothing of svl.

image_encodings.py FOLDER: writes FOLDER/images and FOLDER/depths"""

import json
import sys
from pathlib import Path

import cv2
import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_HUMBLE)
T = STORE.types
WIDTH, HEIGHT = 14, 10
NOISE = np.random.default_rng(1)
START = 1_700_000_000
# Focal length, principal point, focal length times baseline.
F, CX, CY, FB = 328.0, 6.5, 4.5, 14.432
BAYER = {"rggb": cv2.COLOR_BayerRGGB2RGB, "bggr": cv2.COLOR_BayerBGGR2RGB,
         "gbrg": cv2.COLOR_BayerGBRG2RGB, "grbg": cv2.COLOR_BayerGRBG2RGB}
PACKED = {"uyvy": cv2.COLOR_YUV2GRAY_UYVY, "yuv422": cv2.COLOR_YUV2GRAY_UYVY,
          "yuyv": cv2.COLOR_YUV2GRAY_YUY2, "yuv422_yuy2": cv2.COLOR_YUV2GRAY_YUY2}


def noise(shape, bits):
    return NOISE.integers(0, 1 << bits, shape).astype("u1" if bits == 8 else "<u2")


def header():
    return T["std_msgs/msg/Header"](T["builtin_interfaces/msg/Time"](START, 0), "cam")


def image(encoding, pixels, big=False):
    """Rows are padded by three bytes of noise. Further rows, of chroma, are below those of the image."""
    pixels = pixels.astype(pixels.dtype.newbyteorder(">")) if big else pixels
    rows = pixels.reshape(-1, pixels.size // pixels.shape[0]).copy().view("u1")
    rows = np.hstack([rows, noise((len(rows), 3), 8)])
    return T["sensor_msgs/msg/Image"](header(), HEIGHT, WIDTH, encoding, int(big), rows.shape[1], rows.reshape(-1))


def compressed(format, data):
    data = np.frombuffer(bytes(data), "u1")
    return T["sensor_msgs/msg/CompressedImage"](header(), format, data)


def png(pixels):
    return cv2.imencode(".png", pixels)[1].tobytes()


def grey(rgb):
    """The luma, rounded. OpenCV's is in fixed point, at most one step off."""
    exact = (rgb.astype(np.int64) @ [299, 587, 114] + 500) // 1000
    assert np.abs(exact - cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY)).max() <= 1
    return exact


def images():
    """Name, message, expected grey of 8 bits, and expected colours or None."""
    for encoding in ["mono8", "8UC1"]:
        pixels = noise((HEIGHT, WIDTH), 8)
        yield encoding, image(encoding, pixels), pixels, None
    for encoding in ["mono16", "16UC1"]:
        for big in [False, True]:
            pixels = noise((HEIGHT, WIDTH), 16)
            yield f"{encoding}_{big}", image(encoding, pixels, big), pixels >> 8, None
    for encoding, order in [("rgb8", "rgb"), ("rgba8", "rgba"), ("bgr8", "bgr"), ("8UC3", "bgr"), ("bgra8", "bgra"),
                            ("8UC4", "bgra")]:
        pixels = noise((HEIGHT, WIDTH, len(order)), 8)
        rgb = pixels[..., [order.index(c) for c in "rgb"]]
        yield encoding, image(encoding, pixels), grey(rgb), rgb
    for encoding, order in [("rgb16", "rgb"), ("rgba16", "rgba"), ("bgr16", "bgr"), ("16UC3", "bgr"),
                            ("bgra16", "bgra"), ("16UC4", "bgra")]:
        for big in [False, True]:
            pixels = noise((HEIGHT, WIDTH, len(order)), 16)
            rgb = pixels[..., [order.index(c) for c in "rgb"]]
            yield f"{encoding}_{big}", image(encoding, pixels, big), grey(rgb) >> 8, (rgb + np.uint32(128)) // 257
    # A sensor of 12 bits.
    rgb = noise((HEIGHT, WIDTH, 3), 12)
    rgb[0, 0] = 4095
    yield "rgb12", image("rgb16", rgb), grey(rgb) >> 4, rgb >> 4
    for encoding, code in PACKED.items():
        pixels = noise((HEIGHT, WIDTH, 2), 8)
        yield encoding, image(encoding, pixels), cv2.cvtColor(pixels, code), None
    for encoding, code in [("nv12", cv2.COLOR_YUV2GRAY_NV12), ("nv21", cv2.COLOR_YUV2GRAY_NV21)]:
        pixels = noise((HEIGHT * 3 // 2, WIDTH), 8)
        yield encoding, image(encoding, pixels), cv2.cvtColor(pixels, code), None
    pixels = noise((3 * HEIGHT, WIDTH), 8)
    yield "nv24", image("nv24", pixels), pixels[:HEIGHT], None
    for tile, code in BAYER.items():
        for bits in [8, 16]:
            pixels = noise((HEIGHT, WIDTH), bits)
            rgb = cv2.cvtColor((pixels >> (bits - 8)).astype("u1"), code)
            yield f"bayer_{tile}{bits}", image(f"bayer_{tile}{bits}", pixels), grey(rgb), rgb
    for encoding, bits in [("mono8", 8), ("mono16", 16), ("16UC1", 16)]:
        pixels = noise((HEIGHT, WIDTH), bits)
        message = compressed(f"{encoding}; png compressed ", png(pixels))
        yield f"png_{encoding}", message, pixels >> (bits - 8), None
    for encoding, bits in [("rgb8", 8), ("bgr16", 16)]:
        bgr = noise((HEIGHT, WIDTH, 3), bits)
        rgb = np.ascontiguousarray(bgr[..., ::-1])
        message = compressed(f"{encoding}; png compressed bgr{bits}", png(bgr))
        yield f"png_{encoding}", message, grey(rgb) >> (bits - 8), rgb if bits == 8 else (rgb + np.uint32(128)) // 257


def rvl(codes):
    """Wilson 2017: runs of zeros and others, differences as numbers of 3-bit groups, eight of them per word."""
    groups, last, left = [], 0, [int(code) for code in codes.reshape(-1)]

    def number(n):
        while n > 7:
            groups.append(8 | n & 7)
            n >>= 3
        groups.append(n)

    while left:
        zeros = next((i for i, code in enumerate(left) if code), len(left))
        others = next((i for i, code in enumerate(left[zeros:]) if not code), len(left) - zeros)
        number(zeros)
        number(others)
        for code in left[zeros : zeros + others]:
            step, last = code - last, code
            number(2 * step if step >= 0 else -2 * step - 1)
        left = left[zeros + others :]
    groups += [0] * (-len(groups) % 8)
    words = [int("".join(f"{g:x}" for g in groups[i : i + 8]), 16) for i in range(0, len(groups), 8)]
    return np.array([codes.shape[1], codes.shape[0], *words], "<u4").tobytes()


def depths():
    """Name, message, expected depths in metres; 0 and what is not finite is none."""
    metres = NOISE.uniform(0.5, 5, (HEIGHT, WIDTH))
    metres[0, :3] = [0, np.nan, np.inf]
    metres[3, 4:] = 0
    millimetres = np.round(1000 * np.nan_to_num(metres, posinf=0)).astype("<u2")
    for big in [False, True]:
        for encoding in ["16UC1", "mono16"]:
            yield f"{encoding}_{big}", image(encoding, millimetres, big), millimetres / 1000
        for encoding, kind in [("32FC1", "<f4"), ("64FC1", "<f8")]:
            yield f"{encoding}_{big}", image(encoding, metres.astype(kind), big), metres.astype(kind)
    for format in ["16UC1; png compressed ", "mono16; png compressed ", "png"]:
        yield format[:3] + "_png", compressed(format, png(millimetres)), millimetres / 1000
    # compressed_depth_image_transport: 12 bytes, then a PNG or RVL; floats as a / (code - b).
    a = 100.0 * 101
    b = np.float32(1 - a / 10)
    codes = np.where(metres > 0, a / np.where(metres > 0, metres, 1) + b, 0)
    codes = np.where(np.isfinite(metres), codes, 0).astype("<u2")
    inverse = np.where(codes > 0, np.float32(a) / (codes - b), 0)
    head = {"16UC1": b"\0" * 12, "32FC1": b"\0" * 4 + np.array([a, b], "<f4").tobytes()}
    for encoding, samples, expected in [("16UC1", millimetres, millimetres / 1000), ("32FC1", codes, inverse)]:
        for format, packed in [(" compressedDepth png", png(samples)), (" compressedDepth", png(samples)),
                               (" compressedDepth rvl", rvl(samples)), ("compressedDepth rvl", rvl(samples))]:
            name = f"{encoding}{len(format)}{format[-3:]}"
            yield name, compressed(f"{encoding};{format}", head[encoding] + packed), expected


def camera_info(tx):
    roi = T["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
    k, r = np.array([F, 0, CX, 0, F, CY, 0, 0, 1]), np.eye(3).reshape(-1)
    p = np.array([F, 0, CX, tx, 0, F, CY, 0, 0, 0, 1, 0])
    return T["sensor_msgs/msg/CameraInfo"](header(), HEIGHT, WIDTH, "plumb_bob", np.zeros(5), k, r, p, 0, 0, roi)


def write(path, messages):
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        for topic, message in messages:
            kind = message.__msgtype__
            connection = bag.add_connection(topic, kind, typestore=STORE)
            bag.write(connection, START * 10**9, STORE.serialize_cdr(message, kind))


def numbers(values):
    return None if values is None else [float(v) if np.isfinite(v) else 0 for v in values.reshape(-1)]


out, expected, messages = Path(sys.argv[1]), {"images": {}, "depths": {}}, []
for side in ["left", "right"]:
    for name, message, luma, rgb in images():
        messages.append((f"/{name}/{side}/image_rect", message))
        expected["images"].setdefault(name, []).append([numbers(luma), numbers(rgb)])
write(out / "images", messages)
messages = [("/cam0/camera_info", camera_info(0.0)), ("/cam1/camera_info", camera_info(-FB))]
messages += [(f"/cam{i}/image_rect", image("mono8", noise((HEIGHT, WIDTH), 8))) for i in range(2)]
for name, message, metres in depths():
    messages.append((f"/{name}/depth", message))
    expected["depths"][f"/{name}/depth"] = numbers(metres)
write(out / "depths", messages)
print(json.dumps(expected))
