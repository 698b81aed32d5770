"""Digests of all that a model says, by encoder, read-out, backend and type of pixels.

``python -m tests.hdc.net.digests`` writes ``digests.json`` anew, in the commit that moves a bit on
purpose. Words, prototypes and whole numbers are the same on every machine; sets, probabilities and
files of read-outs that are solved in floating point, only on processors like the one named there.
"""

import hashlib
import json
import tempfile
import warnings
from pathlib import Path

import numpy as np
import torch

from hdc import HDCClassifier, HDCRegressor
from hdc.encoders import ENCODERS
from hdc.readouts import READOUTS, VALUE_READOUTS
from tests.hdc.net.frames import frames_of

FILE = Path(__file__).parent / "digests.json"
BACKENDS = ("numpy", "compiled")
TYPES = ("uint8", "uint16", "int32", "float32", "float64")
EXACT = ("majority", "counts", "neighbours", "trained")
"""Read-outs without a solved equation: their answers are the same everywhere."""
COUNTING = ("majority", "counts")
ALPHA = 0.2


def processor():
    """What floating-point sums depend on."""
    names = [torch.backends.cpu.get_cpu_capability()]
    info = Path("/proc/cpuinfo")
    if info.exists():
        lines = info.read_text().splitlines()
        names += sorted({line for line in lines if line.startswith("model name")})
    return ", ".join(names)


def digest(*values):
    """Eight digits of the SHA-256 of arrays, tensors and bytes."""
    found = hashlib.sha256()
    for value in values:
        if isinstance(value, torch.Tensor):
            value = value.numpy(force=True)
        if isinstance(value, np.ndarray):
            found.update(f"{value.dtype} {value.shape}".encode())
            value = np.ascontiguousarray(value).tobytes()
        found.update(value)
    return found.hexdigest()[:8]


def file_of(model):
    """The bytes of a saved model."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model"
        model.save(path)
        return path.read_bytes()


def of_classes(encoder, readout, backend, kind):
    """What a classifier says of frames that it has not seen."""
    frames, labels = frames_of(kind, 36)
    asked, _ = frames_of(kind, 12, seed=1)
    model = HDCClassifier(encoder, readout, backend=backend).fit(frames, labels)
    sets = [np.isin(model.classes_, each) for each in model.predict_set(asked, ALPHA)]
    words = model.encode(asked).packed
    prototypes = []
    if readout in COUNTING:
        prototypes = [model.prototypes_, model.distances(asked)]
    return {
        "words": digest(words),
        "prototypes": digest(*prototypes),
        "scores": digest(model.decision_function(asked), model.predict(asked)),
        "sets": digest(np.array(sets)),
        "known": digest(model.is_known(asked, ALPHA)),
        "probabilities": digest(model.predict_proba(asked)),
        "file": digest(file_of(model)),
    }


def of_numbers(encoder, readout, backend, kind):
    """What a regressor says of frames that it has not seen."""
    frames, labels = frames_of(kind, 36)
    asked, _ = frames_of(kind, 12, seed=1)
    values = np.stack([labels, np.sin(np.arange(36.0))], 1)
    model = HDCRegressor(encoder, readout, backend=backend).fit(frames, values)
    return {
        "values": digest(*model.predict(asked, return_interval=True)),
        "file": digest(file_of(model)),
    }


def everything():
    """Digests of each case by its name: encoder, read-out, backend and type of pixels."""
    found = {}
    for encoder in ENCODERS:
        for backend in BACKENDS:
            for kind in TYPES:
                for readout in READOUTS:
                    name = f"{encoder}, {readout}, {backend}, {kind}"
                    found[name] = of_classes(encoder, readout, backend, kind)
                for readout in VALUE_READOUTS:
                    name = f"{encoder}, {readout} of numbers, {backend}, {kind}"
                    found[name] = of_numbers(encoder, readout, backend, kind)
    return found


def read():
    """The processor of the file, and its digests."""
    content = json.loads(FILE.read_text())
    cases = {}
    for name, line in content["cases"].items():
        pairs = (pair.split("=") for pair in line.split())
        cases[name] = dict(pairs)
    return content["processor"], cases


def write():
    """Write the file anew."""
    torch.set_num_threads(1)
    warnings.simplefilter("ignore")
    cases = {
        name: " ".join(f"{key}={value}" for key, value in found.items())
        for name, found in everything().items()
    }
    content = {"processor": processor(), "cases": cases}
    FILE.write_text(json.dumps(content, indent=0) + "\n")


if __name__ == "__main__":
    write()
