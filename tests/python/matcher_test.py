"""Tests of src/python/svl_bench/matcher.py, between images and networks. Run by tests/bench/cli/exec."""

import argparse
import importlib.util
import itertools
import sys
import tempfile
from pathlib import Path

import numpy as np
import tiny_network
from svl_bench import matcher


def network(*words, channels=1):
    parser = argparse.ArgumentParser()
    matcher.network_options(parser)
    return matcher.Network(parser.parse_args(words), channels)


def loaded(file):
    spec = importlib.util.spec_from_file_location(file.stem, file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def has(*modules):
    return all(importlib.util.find_spec(module) for module in modules)


def there_and_back(net, images, outputs_of):
    given = net.inputs(images)
    outputs = outputs_of(given)
    return given, net.disparities(outputs, images.shape[1:3])


random = np.random.default_rng(1)
grey = random.integers(0, 256, (2, 30, 50), np.uint8)
color = random.integers(0, 256, (1, 30, 50, 3), np.uint8)

# Padding repeats the last pixels, and goes again.
given, found = there_and_back(network("--multiple", "16"), grey, lambda x: {"disp": x[:, 0]})
assert given.shape == (2, 1, 32, 64) and given.dtype == np.float32
assert (given[:, 0, 31, 63] == grey[:, 29, 49]).all()
assert (found == grey).all()

# Normalisation by channel; grey images are repeated for a network in colour, and the reverse.
given = network("--normalise", "imagenet", "--multiple", "1", channels=3).inputs(color)
assert np.allclose(given[0, 2, 4, 5], (color[0, 4, 5, 2] / 255 - 0.406) / 0.225, atol=1e-6)
given = network("--normalise", "signed", "--multiple", "1", channels=3).inputs(grey)
assert given.shape == (2, 3, 30, 50) and np.allclose(given[1, 2], grey[1] / 127.5 - 1, atol=1e-6)
given = network("--channels", "bgr", "--normalise", "imagenet", "--multiple", "1").inputs(color)
assert np.allclose(given[0, 0, 4, 5], (color[0, 4, 5, 2] / 255 - 0.406) / 0.225, atol=1e-6)
mean = network("--channels", "grey", "--multiple", "1", channels=3).inputs(color)
assert (mean[:, 0] == color.astype(np.float32).mean(-1)).all()

# Resizing scales disparities back; so does a coarser level, of which the largest is taken.
net = network("--size", "100x60", "--multiple", "1")
pyramid = lambda x: [np.full((2, 1, 15, 25), 4.0), np.full((2, 1, 30, 50), 8.0)]
given, found = there_and_back(net, grey, pyramid)
assert given.shape == (2, 1, 60, 100) and found.shape == grey.shape and np.allclose(found, 8.0)
_, found = there_and_back(network("--output", "0", "--multiple", "1"), grey, pyramid)
assert np.allclose(found, 8.0)

# Flow has two channels and the other sign; shares of the width; dictionaries; confidences.
flow = lambda x: {"flow": np.stack([np.full((2, 30, 50), -3.0), np.full((2, 30, 50), 9.0)], 1)}
assert (there_and_back(network("--negative", "--multiple", "1"), grey, flow)[1] == 3.0).all()
share = lambda x: [{"a": np.full((2, 30, 50), 0.1)}]
assert np.allclose(there_and_back(network("--scale", "width", "--multiple", "1"), grey, share)[1], 5)
sure = lambda x: {"disparity": np.full((2, 30, 50), 7.0), "confidence": np.tile(np.arange(50) / 50, (2, 30, 1))}
_, found = there_and_back(network("--confidence", "confidence", "--multiple", "1"), grey, sure)
assert np.isinf(found[:, :, 24]).all() and (found[:, :, 25] == 7).all()
try:
    there_and_back(network("--output", "depth"), grey, sure)
    sys.exit("an output that is not there was taken")
except ValueError as error:
    assert "no output depth; there are disparity, confidence" in str(error), error

# Enlarged and shrunk again, a smooth image is as before.
smooth = np.fromfunction(lambda n, c, y, x: x + 2.0 * y, (1, 1, 20, 30))
again = matcher.resized(matcher.resized(smooth, (60, 90)), (20, 30))
assert np.abs(again - smooth)[..., 1:-1, 1:-1].max() < 1e-3

# Too little memory is told with the cure.
told = matcher.memory_error(RuntimeError("CUDA out of memory. Tried to allocate 2 GiB"))
assert "a smaller --size" in str(told), told
assert str(matcher.memory_error(ValueError("else"))) == "else"


# onnxruntime falls back to the CPU by itself, which is not what was asked for.
class Session:
    get_inputs = lambda self: [argparse.Namespace(name=n, type="float", shape=[1, 1, "h", "w"]) for n in "lr"]
    get_outputs = lambda self: []
    get_providers = lambda self: ["CPUExecutionProvider"]


class Settings:
    add_session_config_entry = lambda self, *_: None


onnxruntime = argparse.Namespace(
    get_available_providers=lambda: ["CUDAExecutionProvider", "CPUExecutionProvider"],
    SessionOptions=Settings,
    InferenceSession=lambda *_, **__: Session(),
)
file = Path(__file__).parents[2] / "adapters/svl_onnx.py"
adapter = loaded(file)


def onnx_options(provider, *words):
    return argparse.Namespace(**vars(network(*words).options), provider=provider, model=file)


for options in [onnx_options(None, "--device", "cuda"), onnx_options("cuda", "--device", "cpu")]:
    try:
        adapter.OnnxMatcher(options, onnxruntime).start(argparse.Namespace(threads=1))
        sys.exit("the CPU was taken for CUDA")
    except SystemExit as error:
        assert "cannot use CUDA here" in str(error), error
try:
    adapter.OnnxMatcher(onnx_options("tensorrt"), onnxruntime)
    sys.exit("CUDA was taken for TensorRT")
except SystemExit as error:
    assert "no TensorRT here: pip install onnxruntime-gpu tensorrt" in str(error), error
# What TensorRT lacks runs on CUDA, what that lacks on the CPU.
onnxruntime.get_available_providers = lambda: [p for *_, p in adapter.PROVIDERS.values()]
behind = adapter.OnnxMatcher(onnx_options("tensorrt"), onnxruntime).providers
assert behind == ["TensorrtExecutionProvider", "CUDAExecutionProvider", "CPUExecutionProvider"]
assert adapter.OnnxMatcher(onnx_options("cpu"), onnxruntime).providers == ["CPUExecutionProvider"]

options = onnx_options(None, "--batch", "4", "--device", "cpu")
try:
    adapter.OnnxMatcher(options, onnxruntime).start(argparse.Namespace(threads=1))
    sys.exit("a batch of 4 was taken for a network of single pairs")
except SystemExit as error:
    assert "its batch is fixed: 1, not 4; leave --batch out" in str(error), error
# Masked pixels have no disparity; numbers alone are disparities.
masked = np.ma.masked_array([[1.0, 2.0]], mask=[[False, True]])
assert np.frombuffer(matcher._pixels(masked, (1, 2)), "<f4").tolist() == [1.0, np.inf]
try:
    matcher._pixels(np.array([[1j, 2]]), (1, 2))
    sys.exit("complex numbers were taken for disparities")
except TypeError as error:
    assert "complex128, expected numbers" in str(error), error


# Inputs are equal to the bit to the plain formulas, by numpy, by torch and by nodes of ONNX.
def plain(net, images):
    planes = (images[..., None] if images.ndim == 3 else images).astype(np.float32)
    if planes.shape[-1] != net.channels:
        planes = np.repeat(planes.mean(-1, keepdims=True), net.channels, -1)
    factor, mean, deviation = matcher.NORMALISATIONS[net.options.normalise]
    if net.channels == 1:
        mean, deviation = np.mean(mean), np.mean(deviation)
    if net.options.channels == "bgr":
        planes, mean, deviation = (np.flip(np.atleast_1d(part), -1) for part in (planes, mean, deviation))
    planes = (planes * np.float32(factor) - np.float32(mean)) / np.float32(deviation)
    for axis, new in enumerate(net.options.size or (), 1):
        old = planes.shape[axis]
        at = np.clip((np.arange(new) + 0.5) * old / new - 0.5, 0, old - 1)
        low = np.minimum(at.astype(int), old - 2)
        share = (at - low).astype(np.float32).reshape(-1, *[1] * (3 - axis))
        planes = planes.take(low, axis) * (1 - share) + planes.take(low + 1, axis) * share
    below, right = (-n % net.options.multiple for n in planes.shape[1:3])
    return np.moveaxis(np.pad(planes, ((0, 0), (0, below), (0, right), (0, 0)), "edge"), -1, 1)


def onnx_inputs(way, net, sides, inputs=2, kind=np.float32):
    """By a way of OnnxMatcher, its device being the CPU."""
    import onnxruntime

    state = argparse.Namespace(network=net, kind=kind, inputs=range(inputs), before={}, place="cpu",
        images=(None, None), onnxruntime=onnxruntime, settings=onnxruntime.SessionOptions(),
        providers=["CPUExecutionProvider"])  # fmt: skip
    return [np.asarray(image) for image in way(state, sides)]


def is_equal(found, expected):
    found = np.asarray(found)
    same = found.dtype == expected.dtype and found.shape == expected.shape
    return same and found.tobytes() == expected.tobytes()


torch_adapter = loaded(file.with_name("svl_torch.py"))
on_device, on_cpu = adapter.OnnxMatcher.on_device, adapter.OnnxMatcher.on_cpu
wide = random.integers(0, 256, (2, 150, 70, 3), np.uint8)
sizes = [[], *(["--size", size] for size in ("70x150", "33x21", "101x200", "70x20"))]
for order, normalise, size in itertools.product(("grey", "rgb", "bgr"), matcher.NORMALISATIONS, sizes):
    net = network("--channels", order, "--normalise", normalise, *size)
    for images in (wide, np.ascontiguousarray(wide[..., 0])):
        found, expected = [net.inputs(images)], plain(net, images)
        # Into the memory of another size, of an earlier result.
        found += [net.inputs(images, net.inputs(images[:, :99])), net.inputs(images, net.inputs(images[::-1]))]
        # The images that svl sends to these adapters have the network's channels.
        if (images.ndim == 3) == (order == "grey"):
            if has("torch"):
                import torch

                found.append(torch_adapter.prepared(torch, net, images, torch.device("cpu")))
            if has("onnx", "onnxruntime"):
                found += onnx_inputs(on_device, net, [images, images])
        for i, each in enumerate(found):
            assert is_equal(each, expected), (i, order, normalise, size, images.shape)
if has("onnx", "onnxruntime"):
    sides, net = [wide, wide[::-1].copy()], network("--size", "101x200", channels=3)
    # The model's outputs are the same, too.
    with tempfile.TemporaryDirectory() as folder:
        options = onnx_options("cpu", "--normalise", "unit", "--multiple", "16")
        options.model = Path(folder, "tiny.onnx")
        options.model.write_bytes(tiny_network.model().SerializeToString())
        tiny = adapter.OnnxMatcher(options, importlib.import_module("onnxruntime"))
        assert tiny.start(argparse.Namespace(threads=1))["device"] == "CPU"
    found = []
    for tiny.place in (None, "cpu"):
        feed, size = tiny.prepare(grey[0], grey[1])
        found.append(tiny.match(feed, size))
    assert found[0].shape == (30, 50) and is_equal(*found)
    for inputs, kind in [(1, np.float32), (2, np.float16), (2, np.uint8), (1, np.uint8)]:
        found, expected = (onnx_inputs(way, net, sides, inputs, kind) for way in (on_device, on_cpu))
        assert len(found) == inputs and all(map(is_equal, found, expected)), (inputs, kind)
print("well")
