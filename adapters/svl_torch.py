#!/usr/bin/env python3
"""A network in PyTorch as a matcher for svl: TorchScript, or a Python function that makes it.

    pip install numpy torch
    svl score arena --algo v5 --algo "net=exec:command='python3 svl_torch.py model.pt'"
    svl score arena --algo v5 --algo "net=exec:command='python3 svl_torch.py --entry mynet:load weights.pth'"

svl_bench.matcher comes with svl's wheel; without it, in this file's folder:
`mkdir svl_bench` and `svl algos exec --example python > svl_bench/matcher.py`.

The network is called with left and right, float32, N x C x H x W. An entry MODULE:FUNCTION is called with
the path of the model, where there is one, and returns what is called so: a torch.nn.Module or a function.
"""

import argparse
import importlib
import os
import sys
from pathlib import Path

# A file beside this one, as onnx.py, must not take the place of a package; svl_bench may be beside it.
here = Path(__file__).resolve().parent
elsewhere = [folder for folder in sys.path if Path(folder or ".").resolve() != here]
sys.path = [*elsewhere, str(here), str(here.parent / "src/python")]
import numpy as np
from svl_bench import matcher

# A module of an entry may be in the working folder.
sys.path.append(os.getcwd())


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("model", type=Path, nargs="?")
    parser.add_argument("--entry", metavar="MODULE:FUNCTION", help="what makes the network")
    matcher.network_options(parser)
    options = parser.parse_args()
    if options.model is None and options.entry is None:
        parser.error("a model or an --entry is needed")
    if options.model is not None and not options.model.is_file():
        parser.error(f"{options.model}: no such file")
    return options


def load(torch, options, device):
    if options.entry is None:
        return torch.jit.load(str(options.model), map_location=device).eval()
    module, _, function = options.entry.partition(":")
    make = getattr(importlib.import_module(module), function)
    network = make(options.model) if options.model else make()
    if isinstance(network, torch.nn.Module):
        network = network.to(device).eval()
    return network


def prepared(torch, network, images, device):
    """network.inputs(images) on the device, to which images go as 8 bits."""
    put = lambda array: torch.from_numpy(np.ascontiguousarray(array)).to(device)
    # Grey images have one channel, as svl sends what the network has.
    planes = put(images).reshape(*images.shape[:3], -1).movedim(-1, 1)
    if network.options.channels == "bgr":
        planes = planes.flip(1)
    # Divided by a tensor: by a number, CUDA multiplies with its inverse.
    factor, mean, deviation = put(network.statistics())
    found = (planes * factor - mean) / deviation
    for axis, (low, high, share) in enumerate(network.axes(images.shape[1:3]), 2):
        low, high, share = put(low), put(high), put(share)
        found = found.index_select(axis, low) * (1 - share) + found.index_select(axis, high) * share
    return found


def main():
    options = arguments()
    try:
        import torch
    except ImportError:
        sys.exit("PyTorch is missing: pip install torch")
    if options.device == "cuda" and not torch.cuda.is_available():
        sys.exit("PyTorch sees no CUDA device here: install its CUDA build, or --device cpu")
    on_cuda = torch.cuda.is_available() and options.device != "cpu"
    device = torch.device("cuda" if on_cuda else "cpu")
    try:
        model = load(torch, options, device)
    except Exception as error:
        words = " ".join(str(matcher.memory_error(error)).split())
        sys.exit(f"{options.entry or options.model}: {words[:300]}")
    network = matcher.Network(options, 3)
    arrays = [None, None]

    def start(request):
        torch.set_num_threads(request.threads)
        name = torch.cuda.get_device_name() if on_cuda else "CPU"
        return {"threads": torch.get_num_threads(), "device": name}

    def plain(output):
        """Tensors as arrays, on the CPU: this waits for the device."""
        if isinstance(output, torch.Tensor):
            return output.float().cpu().numpy()
        if isinstance(output, dict):
            return {name: plain(inner) for name, inner in output.items()}
        return [plain(inner) for inner in output]

    def prepare(left, right):
        sides = (left, right) if options.batch > 1 else (left[None], right[None])
        if on_cuda:
            images = [prepared(torch, network, side, device) for side in sides]
            torch.cuda.synchronize()
        else:
            arrays[:] = map(network.inputs, sides, arrays)
            images = map(torch.from_numpy, arrays)
        return *images, sides[0].shape[1:3]

    def match(left, right, size):
        with torch.inference_mode():
            outputs = plain(model(left, right))
        found = network.disparities(outputs, size)
        return found if options.batch > 1 else found[0]

    matcher.serve(
        match,
        color=network.channels == 3,
        batch=options.batch,
        start=start,
        prepare=prepare,
        name=options.model.stem if options.model else options.entry,
        version=f"torch {torch.__version__}",
        model=matcher.file_hash(options.model) if options.model else None,
    )


if __name__ == "__main__":
    main()
