"""`python -m servotune.floor`: the floor on an engine, from a shell."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict

from servotune import ServotuneError
from servotune.floor import ENGINES, run


def main() -> int:
    """0 where every slot is served, 1 where some are not, 2 where it could not be done."""
    words = argparse.ArgumentParser(prog="python -m servotune.floor", description=__doc__)
    words.add_argument("source", help="FLEET.toml, a folder tree, or a table of slots (CSV, Parquet)")
    words.add_argument("--out", required=True, help="folder to write to")
    words.add_argument("--engine", choices=list(ENGINES), default="local")
    words.add_argument("--workers", type=int, default=0, help="0 for as many as the engine has")
    words.add_argument("--batch", type=int, default=16, help="slots in one task")
    words.add_argument("--spec", help="spec.toml, of a tree or a table")
    words.add_argument("--controller", help="controller.toml, of a tree or a table")
    words.add_argument("--gate", help="gate.json, of a tree or a table")
    words.add_argument("--run", help="name of the run in the store")
    words.add_argument("--who", help="who runs it; the user's name where it is left out")
    words.add_argument("--pages", type=int, default=12, help="slots with a full report")
    words.add_argument("--json", action="store_true", help="one JSON document on stdout")
    a = words.parse_args()
    say = lambda line: print(line, file=sys.stderr)  # noqa: E731
    try:
        ran = run(
            a.source,
            a.spec,
            a.engine,
            out=a.out,
            controller=a.controller,
            gate=a.gate,
            workers=a.workers,
            batch=a.batch,
            name=a.run,
            who=a.who,
            pages=a.pages,
            said=say,
        )
    except (ServotuneError, ValueError, ImportError, OSError) as e:
        print(f"error: {e}", file=sys.stderr)
        return 2
    if a.json:
        print(json.dumps(asdict(ran), indent=2))
    else:
        print(f"run {ran.run}: {ran.slots} slots: " + ", ".join(f"{n} {word}" for word, n in ran.verdicts.items()))
    served = ran.verdicts.get("keeps", 0) + ran.verdicts.get("tuned", 0)
    return 0 if served == ran.slots else 1


if __name__ == "__main__":
    sys.exit(main())
