#!/usr/bin/env python3
"""A network in ONNX as a matcher for svl, by onnxruntime on the CPU, CUDA or TensorRT.

    pip install numpy onnxruntime            # with CUDA and TensorRT: onnxruntime-gpu, onnx, tensorrt
    svl score arena --algo v5 --algo "net=exec:command='python3 svl_onnx.py model.onnx --multiple 16'"

svl_bench.matcher comes with svl's wheel; without it, in this file's folder:
`mkdir svl_bench` and `svl algos exec --example python > svl_bench/matcher.py`.

A network has two inputs, left and right, by name or in this order, or one with the channels of both. Where
its inputs have a fixed size, images are resized to it.
"""

import argparse
import importlib.util
import sys
from pathlib import Path

# A file beside this one, as onnx.py, must not take the place of a package; svl_bench may be beside it.
here = Path(__file__).resolve().parent
elsewhere = [folder for folder in sys.path if Path(folder or ".").resolve() != here]
sys.path = [*elsewhere, str(here), str(here.parent / "src/python")]
import numpy as np
from svl_bench import matcher


# By --provider: name and cure, and name in onnxruntime. Operators that one lacks run on the next.
PROVIDERS = {
    "tensorrt": ("TensorRT", "pip install onnxruntime-gpu tensorrt", "TensorrtExecutionProvider"),
    "cuda": ("CUDA", "pip install onnxruntime-gpu", "CUDAExecutionProvider"),
    "cpu": ("CPU", "pip install onnxruntime", "CPUExecutionProvider"),
}


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("model", type=Path)
    matcher.network_options(parser)
    parser.add_argument("--provider", choices=PROVIDERS, help="in place of --device; tensorrt builds an "
        "engine first, for minutes")  # fmt: skip
    options = parser.parse_args()
    if not options.model.is_file():
        parser.error(f"{options.model}: no such file")
    return options


class OnnxMatcher:
    """Started with the first request, as that says how many threads may be used."""

    def __init__(self, options, onnxruntime):
        self.options, self.onnxruntime = options, onnxruntime
        has = onnxruntime.get_available_providers()
        self.wanted = options.provider or options.device
        if self.wanted == "auto":
            self.wanted = "cuda" if PROVIDERS["cuda"][-1] in has else "cpu"
        self.device, cure, provider = PROVIDERS[self.wanted]
        if provider not in has:
            sys.exit(f"onnxruntime has no {self.device} here: {cure}, or --device cpu")
        names = list(PROVIDERS)
        behind = [PROVIDERS[name][-1] for name in names[names.index(self.wanted) :]]
        self.providers = [name for name in behind if name in has]

    def start(self, request):
        settings = self.onnxruntime.SessionOptions()
        settings.intra_op_num_threads = request.threads
        # Threads that wait for the next pair in a loop would slow the other algorithms.
        settings.add_session_config_entry("session.intra_op.allow_spinning", "0")
        model = str(self.options.model)
        try:
            session = self.onnxruntime.InferenceSession(model, settings, providers=self.providers)
        except Exception as error:
            sys.exit(f"{model}: {' '.join(str(matcher.memory_error(error)).split())[:300]}")
        self.session, self.settings, self.before, self.images = session, settings, {}, (None, None)
        self.inputs = ordered(session.get_inputs())
        self.outputs = [output.name for output in session.get_outputs()]
        images = len(self.inputs)
        channels = self.inputs[0].shape[1]
        if not isinstance(channels, int):
            channels = 3 * (3 - images)
        self.network = matcher.Network(self.options, channels * images // 2)
        fixed = self.inputs[0].shape[2:]
        if all(isinstance(n, int) for n in fixed):
            self.options.size, self.options.multiple = tuple(fixed), 1
        batch, wanted = self.inputs[0].shape[0], self.options.batch
        if isinstance(batch, int) and batch != wanted:
            cure = f"--batch {batch}" if batch > 1 else "leave --batch out"
            sys.exit(f"{model}: its batch is fixed: {batch}, not {wanted}; {cure}")
        kinds = {"tensor(float16)": np.float16, "tensor(uint8)": np.uint8}
        self.kind = kinds.get(self.inputs[0].type, np.float32)
        if self.kind == np.uint8 and self.options.normalise != "raw":
            sys.exit(f"{model}: its images are integers of 8 bits: leave --normalise out")
        # It falls back by itself where libraries or the device are missing.
        used = session.get_providers()[0]
        is_asked = (self.options.provider or self.options.device) != "auto"
        if is_asked and used != self.providers[0]:
            sys.exit(f"onnxruntime cannot use {self.device} here: see its words above, or --device cpu")
        (device,) = [name for name, _, provider in PROVIDERS.values() if provider == used]
        # Without onnx no model can be written.
        self.place = "cuda" if device != "CPU" and importlib.util.find_spec("onnx") else None
        return {
            "color": self.network.channels == 3,
            "threads": request.threads,
            "device": device,
            "model": matcher.file_hash(model),
        }

    def prepare(self, *sides):
        if self.options.batch == 1:
            sides = [side[None] for side in sides]
        images = self.on_device(sides) if self.place else self.on_cpu(sides)
        return dict(zip((i.name for i in self.inputs), images)), sides[0].shape[1:3]

    def on_cpu(self, sides):
        self.images = images = list(map(self.network.inputs, sides, self.images))
        if self.kind == np.uint8:
            images = [np.rint(side) for side in images]
        images = [side.astype(self.kind, copy=False) for side in images]
        return images if len(self.inputs) == 2 else [np.concatenate(images, 1)]

    def on_device(self, sides):
        """Inputs by a model before the model, on the device, to which images go as 8 bits."""
        # Grey images have one channel, as svl sends what the network has.
        sides = [side.reshape(*side.shape[:3], -1) for side in sides]
        shape = sides[0].shape
        if shape not in self.before:
            model = model_before(self.network, shape, self.kind, len(self.inputs))
            providers = [name for name in self.providers if "Tensorrt" not in name]
            make = self.onnxruntime.InferenceSession
            self.before[shape] = make(model, self.settings, providers=providers)
        session = self.before[shape]
        binding = session.io_binding()
        for given, side in zip(session.get_inputs(), sides):
            binding.bind_cpu_input(given.name, side)
        for output in session.get_outputs():
            binding.bind_output(output.name, self.place)
        session.run_with_iobinding(binding)
        binding.synchronize_outputs()
        return binding.get_outputs()

    def match(self, feed, size):
        if self.place:
            outputs = [value.numpy() for value in self.session.run_with_ort_values(self.outputs, feed)]
        else:
            outputs = self.session.run(None, feed)
        found = self.network.disparities(dict(zip(self.outputs, outputs)), size)
        return found if self.options.batch > 1 else found[0]


def model_before(network, shape, kind, count):
    """Network.inputs() of two images of a shape, as a model in bytes with one or two outputs."""
    from onnx import TensorProto, helper, numpy_helper

    nodes, images = [], []

    def node(operator, *inputs, **attributes):
        """The name of its output; inputs are such names, or arrays."""
        constant = lambda array: node("Constant", value=numpy_helper.from_array(np.asarray(array)))
        names = [given if isinstance(given, str) else constant(given) for given in inputs]
        nodes.append(helper.make_node(operator, names, [f"node{len(nodes)}"], **attributes))
        return nodes[-1].output[0]

    factor, mean, deviation = network.statistics()
    kind_number = helper.np_dtype_to_tensor_dtype(np.dtype(kind))
    for side in ("left", "right"):
        found = node("Transpose", node("Cast", side, to=TensorProto.FLOAT), perm=[0, 3, 1, 2])
        if network.options.channels == "bgr":
            found = node("Gather", found, [2, 1, 0], axis=1)
        found = node("Div", node("Sub", node("Mul", found, factor), mean), deviation)
        for axis, (low, high, share) in enumerate(network.axes(shape[1:3]), 2):
            low, high = (node("Gather", found, at, axis=axis) for at in (low, high))
            found = node("Add", node("Mul", low, 1 - share), node("Mul", high, share))
        if kind == np.uint8:
            found = node("Round", found)
        images.append(node("Cast", found, to=kind_number))
    images = images if count == 2 else [node("Concat", *images, axis=1)]
    info = helper.make_tensor_value_info
    inputs = [info(side, TensorProto.UINT8, shape) for side in ("left", "right")]
    graph = helper.make_graph(nodes, "before", inputs, [info(each, kind_number, None) for each in images])
    opsets = [helper.make_opsetid("", 17)]
    return helper.make_model(graph, opset_imports=opsets, ir_version=9).SerializeToString()


def ordered(inputs):
    """Left and right, or the single one."""
    if len(inputs) > 2:
        names = ", ".join(i.name for i in inputs)
        sys.exit(f"the model has {len(inputs)} inputs ({names}); one or two can be given")
    # Stable, so that names that say nothing keep their order.
    return sorted(inputs, key=lambda i: any(word in i.name.lower() for word in ("right", "img2")))


def main():
    options = arguments()
    try:
        import onnxruntime
    except ImportError:
        sys.exit("onnxruntime is missing: pip install onnxruntime")
    net = OnnxMatcher(options, onnxruntime)
    matcher.serve(
        net.match,
        batch=options.batch,
        start=net.start,
        prepare=net.prepare,
        name=options.model.stem,
        version=f"onnxruntime {onnxruntime.__version__}",
    )


if __name__ == "__main__":
    main()
