"""Small networks with the inputs and outputs of those that docs/networks.md names, and random weights, in ONNX.

    known_networks.py DOCUMENT      write NAME.onnx for each row; print NAME, a tab, and the row's options
"""

import re
import sys

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

ANY, FIXED = ["h", "w"], [128, 160]
# By the name in the document: names and type of the inputs, their size, and the outputs: name, channels, factor of its
# size, sign.
KINDS = {
    "RAFT-Stereo": (["left", "right"], TensorProto.FLOAT, FIXED, [("disp", 1, 1, -1)]),
    "IGEV-Stereo": (["left", "right"], TensorProto.FLOAT, FIXED, [("disp", 1, 1, 1)]),
    "CREStereo": (["left", "right"], TensorProto.FLOAT, FIXED, [("disp", 1, 1, 1)]),
    "HITNet": (["input"], TensorProto.FLOAT, ANY, [("reference_output_disparity", 1, 1, 1)]),
    "FoundationStereo": (["left", "right"], TensorProto.FLOAT, FIXED, [("disp", 1, 1, 1)]),
    "Fast-FoundationStereo": (["left", "right"], TensorProto.FLOAT, FIXED, [("disp", 1, 1, 1)]),
    "S2M2": (
        ["input_left", "input_right"],
        TensorProto.UINT8,
        FIXED,
        [("output_disp", 1, 1, 1), ("output_occ", 1, 1, 1), ("output_conf", 1, 1, 0)],
    ),
}


def network(inputs, kind, size, outputs, seed):
    """A convolution of both images for each output; those with the sign 0 are between 0 and 1."""
    random = np.random.default_rng(seed)
    channels = 6 // len(inputs)
    nodes, constants, infos = [], [], []
    for name in inputs:
        nodes.append(helper.make_node("Cast", [name], [f"{name}_float"], to=TensorProto.FLOAT))
    names = [f"{name}_float" for name in inputs]
    nodes.append(helper.make_node("Concat", names, ["both"], axis=1))
    for name, depth, coarser, sign in outputs:
        weights = random.uniform(0.01, 1, (depth, 6, 5, 5)).astype(np.float32) / 150
        constants.append(numpy_helper.from_array(weights, f"{name}_weights"))
        bias = np.full(depth, 0 if sign else -60, np.float32)
        constants.append(numpy_helper.from_array(bias, f"{name}_bias"))
        given = ["both", f"{name}_weights", f"{name}_bias"]
        strides, pads = [coarser, coarser], [2, 2, 2, 2]
        nodes.append(helper.make_node("Conv", given, [f"{name}_raw"], strides=strides, pads=pads))
        last = {1: "Abs", 0: "Sigmoid", -1: "Neg"}[sign]
        nodes.append(helper.make_node(last, [f"{name}_raw"], [name]))
        infos.append(helper.make_tensor_value_info(name, TensorProto.FLOAT, ["n", depth, None, None]))
    images = [helper.make_tensor_value_info(name, kind, [1, channels, *size]) for name in inputs]
    graph = helper.make_graph(nodes, "known", images, infos, constants)
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)


def rows(document):
    """Name and options of each row of the table."""
    text = open(document, encoding="utf-8").read()
    table = text.split("## Networks that people know", 1)[1].split("\n## ", 1)[0]
    for line in table.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        name = re.match(r"\[([^]]+)\]", cells[0])
        if line.startswith("|") and name:
            yield name[1], " ".join(re.findall(r"`(--[^`]*)`", cells[2]))


if __name__ == "__main__":
    found = dict(rows(sys.argv[1]))
    if set(found) != set(KINDS):
        sys.exit(f"networks of the document and of this file differ: {set(found) ^ set(KINDS)}")
    for seed, (name, options) in enumerate(found.items()):
        onnx.save(network(*KINDS[name], seed), f"{name}.onnx")
        print(name, options, sep="\t")
