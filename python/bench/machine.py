"""What the scripts of this folder share: the project's root, the program, a made-up floor, processes of this machine as Linux tells them."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def program_file() -> Path:
    """The program, optimised where it is built so; another one is named in SERVOTUNE."""
    named = os.environ.get("SERVOTUNE")
    found = [Path(named)] if named else [ROOT / "target" / kind / "servotune" for kind in ("release", "debug")]
    return next(p for p in found if p.exists()).resolve()


def program(*words: object) -> None:
    """Runs the program; 1 only says that some slots are not served."""
    ran = subprocess.run([program_file(), "--quiet", *map(str, words)], capture_output=True, text=True, check=False)
    if ran.returncode not in (0, 1):
        raise RuntimeError(ran.stderr)


def fleet_file(folder: Path, slots: int, pilots: int | None = None) -> Path:
    """A FLEET.toml of made-up slots that are drawn when they are needed; few pilots make the stage before the slots short."""
    program("twin", "fleet", "--out", folder, "--testers", 1)
    names = "".join(f'{key} = "{file}"\n' for key, file in NAMES.items())
    short = "" if pilots is None else f"[tables]\npilots = {pilots}\nscouts = {2 * pilots}\n"
    made = folder / f"FLEET{slots}.toml"
    made.write_text(f"{names}[input]\ntwin = {{ slots = {slots}, seed = 1, run = 0 }}\n{short}")
    return made


#: Files that `servotune twin fleet` writes beside its slots.
NAMES = {"spec": "spec.toml", "controller": "controller.toml", "gate": "gate.json"}


def children(of: int) -> list[tuple[int, int, str]]:
    """Process, parent and command line of all that descend from a process."""
    parents: dict[int, int] = {}
    for entry in os.listdir("/proc"):
        if entry.isdigit():
            try:
                # The name before the last bracket may hold blanks; the parent is the second word after it.
                parents[int(entry)] = int(Path(f"/proc/{entry}/stat").read_text().rpartition(")")[2].split()[1])
            except (OSError, IndexError):
                continue
    found, wanted = [], {of}
    # A child may have a smaller number than its parent: numbers begin again.
    while new := {pid for pid, parent in parents.items() if parent in wanted and pid not in wanted}:
        wanted |= new
        for pid in new:
            try:
                words = Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
            except OSError:
                continue
            found.append((pid, parents[pid], words.strip()))
    return found


def busy() -> str:
    """The machine in words."""
    loads = " ".join(f"{load:.1f}" for load in os.getloadavg())
    return f"{os.cpu_count()} cores, shared with other work: load average {loads} when the page was written."
