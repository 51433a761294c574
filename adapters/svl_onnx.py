#!/usr/bin/env python3
"""A network in ONNX as a matcher for svl, by onnxruntime on the CPU, CUDA or TensorRT.

    pip install numpy onnxruntime            # with CUDA and TensorRT: onnxruntime-gpu, tensorrt
    svl score arena --algo v5 --algo "net=exec:command='python3 svl_onnx.py model.onnx --multiple 16'"

svl_bench.matcher comes with svl's wheel; without it, in this file's folder:
`mkdir svl_bench` and `svl algos exec --example python > svl_bench/matcher.py`.

A network has two inputs, left and right, by name or in this order, or one with the channels of both. Where
its inputs have a fixed size, images are resized to it.
"""

import argparse
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
        self.session = session
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
        return {
            "color": self.network.channels == 3,
            "threads": request.threads,
            "device": device,
            "model": matcher.file_hash(model),
        }

    def match(self, left, right):
        is_batch = self.options.batch > 1
        if not is_batch:
            left, right = left[None], right[None]
        images = [self.network.inputs(side) for side in (left, right)]
        if self.kind == np.uint8:
            images = [np.rint(side) for side in images]
        images = [side.astype(self.kind, copy=False) for side in images]
        if len(self.inputs) == 1:
            images = [np.concatenate(images, 1)]
        feed = {i.name: image for i, image in zip(self.inputs, images)}
        try:
            outputs = self.session.run(None, feed)
        except Exception as error:
            raise matcher.memory_error(error) from None
        named = dict(zip(self.outputs, outputs))
        found = self.network.disparities(named, images[0].shape[2:], left.shape[1:3])
        return found if is_batch else found[0]


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
        name=options.model.stem,
        version=f"onnxruntime {onnxruntime.__version__}",
    )


if __name__ == "__main__":
    main()
