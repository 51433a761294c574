"""Writes a network of absolute differences in ONNX, and what its numpy twin makes of a pair as a matcher.

    tiny_network.py MODEL.onnx      write the network
    tiny_network.py                 answer svl as its twin
"""

import sys

import numpy as np

DISPARITIES, SIDE = 16, 5


def model():
    from onnx import TensorProto, helper

    nodes, costs = [], []
    constants = []
    for d in range(DISPARITIES):
        pads = [0, 0, 0, d, 0, 0, 0, -d]
        constants.append(helper.make_tensor(f"pads{d}", TensorProto.INT64, [8], pads))
        nodes += [
            helper.make_node("Pad", ["right", f"pads{d}"], [f"moved{d}"]),
            helper.make_node("Sub", ["left", f"moved{d}"], [f"difference{d}"]),
            helper.make_node("Abs", [f"difference{d}"], [f"absolute{d}"]),
            helper.make_node("AveragePool", [f"absolute{d}"], [f"cost{d}"], kernel_shape=[SIDE, SIDE],
                pads=[SIDE // 2] * 4, count_include_pad=1),  # fmt: skip
        ]
        costs.append(f"cost{d}")
    nodes += [
        helper.make_node("Concat", costs, ["volume"], axis=1),
        helper.make_node("ArgMin", ["volume"], ["best"], axis=1, keepdims=1),
        helper.make_node("Cast", ["best"], ["disparity"], to=TensorProto.FLOAT),
    ]
    image = lambda name: helper.make_tensor_value_info(name, TensorProto.FLOAT, ["n", 1, "h", "w"])
    graph = helper.make_graph(nodes, "tiny", [image("left"), image("right")], [image("disparity")], constants)
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)


def twin(left, right):
    height, width = left.shape
    volume = []
    for d in range(DISPARITIES):
        moved = np.zeros_like(right)
        moved[:, d:] = right[:, : width - d]
        around = np.pad(np.abs(left - moved), SIDE // 2)
        windows = np.lib.stride_tricks.sliding_window_view(around, (SIDE, SIDE))
        volume.append(windows.sum((2, 3)))
    return np.argmin(volume, 0).astype(np.float32)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        import onnx

        onnx.save(model(), sys.argv[1])
    else:
        from svl_bench import matcher

        matcher.serve(lambda *images: twin(*(image.astype(np.float32) for image in images)))
