"""Compares the gate with scikit-learn on four public tables, on the same split; writes gate_peers.md and gate_peers.json.

Usage: python benches/peers/gate_sklearn.py --program target/release/servotune --out results
Needs scikit-learn (its bundled tables iris, wine, breast cancer, digits) and the built bench `gate`.
"""

from __future__ import annotations

import argparse
import json
import platform
import subprocess
import sys
import tempfile
from pathlib import Path

try:
    import numpy as np
    import sklearn
    from sklearn import datasets
    from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.neural_network import MLPClassifier
    from sklearn.preprocessing import StandardScaler
except ImportError as missing:
    sys.exit(f"{missing}; install it with: python -m pip install scikit-learn")

import warnings

warnings.filterwarnings("ignore", category=ConvergenceWarning)
HIDDEN = (64, 32)
RATE = 0.003
SEEDS = range(1, 6)
TABLES = ("iris", "wine", "breast_cancer", "digits")


def discriminant(x: np.ndarray, y: np.ndarray, test: np.ndarray, folder: Path) -> np.ndarray:
    job = folder / "job.json"
    job.write_text(json.dumps({"x": x.tolist(), "class": y.tolist(), "test": test.tolist()}))
    words = ["cargo", "bench", "--quiet", "--bench", "gate", "--", "lda", str(job)]
    ran = subprocess.run(words, check=True, capture_output=True, text=True)
    return np.array(json.loads(ran.stdout.strip().splitlines()[-1]))


def train(program: str, table: Path, features: int, seed: int, folder: Path) -> dict:
    words = [program, "train", str(table), "--label", "label", "--out", str(folder / "gate.json"), "--json"]
    words += ["--features", str(features), "--hidden", ",".join(map(str, HIDDEN)), "--learning-rate", str(RATE)]
    words += ["--correlation-limit", "1.5", "--folds", "0", "--seed", str(seed)]
    return json.loads(subprocess.run(words, check=True, capture_output=True, text=True).stdout)


def compare(name: str, program: str, folder: Path) -> dict:
    data = getattr(datasets, f"load_{name}")()
    x, y = data.data, data.target
    table = folder / f"{name}.csv"
    rows = [",".join([f"f{j}" for j in range(x.shape[1])] + ["label"])]
    rows += [",".join([repr(float(v)) for v in r] + [f"c{c:02d}"]) for r, c in zip(x, y)]
    table.write_text("\n".join(rows) + "\n")
    ours, theirs, equal, judged = [], [], 0, 0
    for seed in SEEDS:
        report = train(program, table, x.shape[1], seed, folder)
        part = {k: np.array(v) for k, v in report["rows"].items()}
        ours.append(report["accuracy"])
        scaler = StandardScaler().fit(x[part["train"]])
        z = scaler.transform(x)
        peer = MLPClassifier(HIDDEN, learning_rate_init=RATE, batch_size=10, max_iter=200, random_state=seed)
        theirs.append(peer.fit(z[part["train"]], y[part["train"]]).score(z[part["test"]], y[part["test"]]))
        lda = LinearDiscriminantAnalysis().fit(x[part["train"]], y[part["train"]]).predict(x[part["test"]])
        mine = discriminant(x[part["train"]], y[part["train"]], x[part["test"]], folder)
        equal += int((lda == mine).sum())
        judged += len(lda)
    accuracy = float(np.mean(theirs))
    error = float(np.sqrt(max(accuracy * (1 - accuracy), 1 / (4 * judged)) / len(part["test"])))
    return {
        "table": name,
        "rows": len(y),
        "lda_equal": equal,
        "lda_judged": judged,
        "network": float(np.mean(ours)),
        "sklearn": accuracy,
        "standard_error": error,
    }


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--program", default="target/release/servotune")
    arguments.add_argument("--out", type=Path, default=Path("results"))
    a = arguments.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = [compare(name, a.program, Path(folder)) for name in TABLES]
    versions = {"python": platform.python_version(), "scikit-learn": sklearn.__version__, "numpy": np.__version__}
    lines = [
        "# The gate beside scikit-learn",
        "",
        "Made by `python benches/peers/gate_sklearn.py`. " + ", ".join(f"{k} {v}" for k, v in versions.items()) + ".",
        f"Five splits of each table (60/20/20, stratified); networks {HIDDEN}, Adam {RATE}, batch 10, 200 epochs; test part.",
        "The standard error is that of an accuracy on one test part.",
        "",
        "| table | rows | LDA: equal predictions | network | MLPClassifier | standard error |",
        "|---|---|---|---|---|---|",
    ]
    for f in found:
        lines.append(
            f"| {f['table']} | {f['rows']} | {f['lda_equal']} of {f['lda_judged']} | {100 * f['network']:.2f} % "
            f"| {100 * f['sklearn']:.2f} % | {100 * f['standard_error']:.2f} % |"
        )
    a.out.mkdir(parents=True, exist_ok=True)
    (a.out / "gate_peers.md").write_text("\n".join(lines) + "\n")
    (a.out / "gate_peers.json").write_text(json.dumps({"versions": versions, "tables": found}, indent=1) + "\n")


if __name__ == "__main__":
    main()
