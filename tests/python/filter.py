"""Spectrum and network of a filter by NumPy, and by scikit-learn where it is installed.

    filter.py IMAGE.pgm X Y MODEL.safetensors

Prints JSON: the amplitudes of the window from (X, Y) on, the network's log odds, and by whom.
"""

import json
import sys

import numpy as np


def read_pgm(path):
    data = open(path, "rb").read()
    kind, width, height, _ = data.split(maxsplit=4)[:4]
    assert kind == b"P5"
    width, height = int(width), int(height)
    return np.frombuffer(data[-width * height:], np.uint8).reshape(height, width)


def read_model(path):
    try:
        import safetensors.numpy

        tensors = safetensors.numpy.load_file(path)
        with safetensors.safe_open(path, "numpy") as file:
            return tensors, file.metadata()
    except ImportError:
        data = open(path, "rb").read()
        length = int.from_bytes(data[:8], "little")
        header = json.loads(data[8:8 + length])
        facts = header.pop("__metadata__")
        tensors = {}
        for name, of in header.items():
            begin, end = (8 + length + at for at in of["data_offsets"])
            tensors[name] = np.frombuffer(data[begin:end], np.float32).reshape(of["shape"])
        return tensors, facts


def forward(tensors, features):
    weights = [tensors["hidden.weight"].T, tensors["output.weight"].T]
    biases = [tensors["hidden.bias"], tensors["output.bias"]]
    try:
        from sklearn.neural_network import MLPClassifier

        network = MLPClassifier((len(biases[0]),), activation="tanh")
        network.fit(np.zeros((2, len(features))), [0, 1])
        network.coefs_, network.intercepts_ = weights, biases
        probability = network.predict_proba(features[None].astype(np.float64))[0, 1]
        return "scikit-learn", float(np.log(probability / (1 - probability)))
    except ImportError:
        hidden = np.tanh(features @ weights[0].astype(np.float64) + biases[0])
        return "numpy", float((hidden @ weights[1] + biases[1])[0])


image, x, y, model = sys.argv[1:]
tensors, facts = read_model(model)
side = int(facts["window"])
window = read_pgm(image)[int(y):int(y) + side, int(x):int(x) + side].astype(np.float64)
amplitudes = np.abs(np.fft.fft2(window)).ravel()[:side * side // 2 + 1]
features = {"amplitude": amplitudes / side**2, "log": np.log1p(amplitudes)}[facts["scaling"]]
by, score = forward(tensors, features)
print(json.dumps({"by": by, "score": score, "amplitudes": amplitudes.tolist()}))
