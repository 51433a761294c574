#!/usr/bin/env python3
"""A network in ONNX as a matcher for svl, by onnxruntime on the CPU or CUDA.

    pip install numpy onnxruntime            # with CUDA: onnxruntime-gpu
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


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("model", type=Path)
    matcher.network_options(parser)
    options = parser.parse_args()
    if not options.model.is_file():
        parser.error(f"{options.model}: no such file")
    return options


class OnnxMatcher:
    """Started with the first request, as that says how many threads may be used."""

    def __init__(self, options, onnxruntime):
        self.options, self.onnxruntime = options, onnxruntime
        has_cuda = "CUDAExecutionProvider" in onnxruntime.get_available_providers()
        if options.device == "cuda" and not has_cuda:
            sys.exit("onnxruntime has no CUDA here: pip install onnxruntime-gpu, or --device cpu")
        on_cuda = has_cuda and options.device != "cpu"
        self.provider = "CUDAExecutionProvider" if on_cuda else "CPUExecutionProvider"

    def start(self, request):
        settings = self.onnxruntime.SessionOptions()
        settings.intra_op_num_threads = request.threads
        # Threads that wait for the next pair in a loop would slow the other algorithms.
        settings.add_session_config_entry("session.intra_op.allow_spinning", "0")
        model = str(self.options.model)
        try:
            session = self.onnxruntime.InferenceSession(model, settings, providers=[self.provider])
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
        self.kind = np.float16 if "float16" in self.inputs[0].type else np.float32
        device = "CPU" if session.get_providers()[0].startswith("CPU") else "CUDA"
        # It falls back by itself where libraries or the device are missing.
        if self.options.device == "cuda" and device == "CPU":
            sys.exit("onnxruntime cannot use CUDA here: see its words above, or --device cpu")
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
        images = [self.network.inputs(side).astype(self.kind, copy=False) for side in (left, right)]
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
