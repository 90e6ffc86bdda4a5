"""Times the published network's training beside PyTorch and, where installed, Keras, in one run; writes gate_speed.md and gate_speed.json.

Usage: python benches/peers/gate_speed.py --out results
Needs torch and numpy; keras with tensorflow is timed where it is installed. Same sizes, batch, epochs and rate; like classes of rows.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import platform
import subprocess
import sys
import time
from pathlib import Path
from statistics import median

os.environ.setdefault("KERAS_BACKEND", "tensorflow")
try:
    import numpy as np

    if "--keras" not in sys.argv:
        import torch
except ImportError as missing:
    sys.exit(f"{missing}; install it with: python -m pip install torch numpy")
KERAS = importlib.util.find_spec("keras") is not None

EPOCHS, BATCH, RATE, REPEATS = 200, 10, 0.01, 3


def rows() -> tuple[np.ndarray, np.ndarray]:
    draw = np.random.default_rng(1)
    y = np.arange(291) % 4
    return (draw.normal(size=(291, 10)) + 3.0 * (np.arange(10) % 4 == y[:, None])).astype(np.float32), y


def torch_once(threads: int, flush: bool) -> float:
    torch.set_num_threads(threads)
    torch.set_flush_denormal(flush)
    x, y = (torch.from_numpy(v) for v in rows())
    layers = [torch.nn.Linear(10, 200), torch.nn.Linear(200, 500), torch.nn.Linear(500, 200), torch.nn.Linear(200, 4)]
    relu = torch.nn.ReLU
    net = torch.nn.Sequential(layers[0], relu(), layers[1], relu(), layers[2], relu(), layers[3])
    step = torch.optim.Adam(net.parameters(), lr=RATE)
    loss_of = torch.nn.CrossEntropyLoss()
    start = time.perf_counter()
    for _ in range(EPOCHS):
        for part in torch.randperm(len(y)).split(BATCH):
            step.zero_grad()
            loss_of(net(x[part]), y[part]).backward()
            step.step()
    return time.perf_counter() - start


def keras_once() -> tuple[str, float]:
    """One training in Keras; to be called in a process without PyTorch: the two bring libraries that do not get on."""
    import keras

    x, y = rows()
    dense = keras.layers.Dense
    net = keras.Sequential([dense(200, "relu"), dense(500, "relu"), dense(200, "relu"), dense(4, "softmax")])
    net.compile(optimizer=keras.optimizers.Adam(RATE), loss="sparse_categorical_crossentropy")
    start = time.perf_counter()
    net.fit(x, y, epochs=EPOCHS, batch_size=BATCH, verbose=0)
    return f"Keras {keras.__version__}, {keras.backend.backend()}", time.perf_counter() - start


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--out", type=Path, default=Path("results"))
    arguments.add_argument("--repeats", type=int, default=REPEATS, help="runs of each (default %(default)s)")
    arguments.add_argument("--keras", action="store_true", help="one training in Keras, printed; used by the script itself")
    a = arguments.parse_args()
    if a.keras:
        print(json.dumps(keras_once()))
        return
    words = ["cargo", "bench", "--quiet", "--bench", "gate"]
    ran = subprocess.run(words, check=True, capture_output=True, text=True)
    found = {"servotune, 1 thread": json.loads(ran.stdout.strip().splitlines()[-1])}
    for threads in (1, 2):
        for flush in (False, True):
            name = f"PyTorch {torch.__version__}, {threads} thread{'s' if threads > 1 else ''}"
            name += ", denormals flushed" if flush else ""
            found[name] = [torch_once(threads, flush) for _ in range(a.repeats)]
    for _ in range(a.repeats if KERAS else 0):
        alone = subprocess.run([sys.executable, __file__, "--keras"], check=True, capture_output=True, text=True)
        name, seconds = json.loads(alone.stdout.strip().splitlines()[-1])
        found.setdefault(name, []).append(seconds)
    lines = [
        "# Training time of the published network",
        "",
        f"Made by `python benches/peers/gate_speed.py`, Python {platform.python_version()}, {platform.processor() or platform.machine()}.",
        f"Median of {a.repeats} runs of each peer. 10-200-500-200-4, 291 rows, 200 epochs, batch 10, Adam 0.01; servotune also judges 97 validation rows each epoch, the peers do not.",
        "",
        "| what | median (s) | fastest (s) |",
        "|---|---|---|",
    ]
    lines += [f"| {k} | {median(v):.2f} | {min(v):.2f} |" for k, v in found.items()]
    if not KERAS:
        lines += ["", "Keras was not installed and is not timed."]
    a.out.mkdir(parents=True, exist_ok=True)
    (a.out / "gate_speed.md").write_text("\n".join(lines) + "\n")
    (a.out / "gate_speed.json").write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
