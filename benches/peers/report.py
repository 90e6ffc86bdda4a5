"""The one place where the numbers of a comparison become text."""

from __future__ import annotations

from collections.abc import Sequence

COMMAND = "python benches/peers/compare.py --out results"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join(lines)


def number(x: float | None, digits: int = 4) -> str:
    return "-" if x is None else f"{x:.{digits}g}"


def fixed(x: float | None, places: int) -> str:
    return "-" if x is None else f"{x:.{places}f}"


def duration(seconds: float | None) -> str:
    if seconds is None:
        return "-"
    for unit, scale in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if seconds >= scale:
            return f"{seconds / scale:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"


def share(x: float | None) -> str:
    return "-" if x is None else f"{100 * x:.2g} %" if abs(x) < 1 else f"{100 * x:.0f} %"


def _time_of(results: dict, what: str) -> dict:
    return next(t for t in results["speed"]["times"] if t["what"] == what)


CANDIDATE = "candidate: margins and DFT, search"
EXACT_MARGINS = "margins, exact"
WRITE = "simulate: whole write with sampling of the plant"
IDENTIFY = "identify: 500 points, order 22 given"
IDENTIFY_AUTO = "identify: 500 points, order chosen"
TUNE_1, TUNE_2 = "tune: one slot, 1 thread", "tune: one slot, 2 threads"


def markdown(results: dict) -> str:
    parts = [_head(results), _aims(results), _margins(results), _write(results), _candidate(results)]
    parts += [_discretisation(results), _identification(results), _tuning(results), _speed(results), _caveats()]
    return "\n\n".join(parts) + "\n"


def _head(r: dict) -> str:
    m = r["machine"]
    versions = ", ".join(f"{name} {version}" for name, version in m["versions"].items())
    return (
        "# Against python-control, scipy and scikit-rf\n\n"
        f"Made by `{COMMAND}`, one run on one machine. Raw numbers: `peers.json`.\n\n"
        f"{m['cores']} cores, {m['architecture']}, {m['system']}; Python {m['python']}; {versions}; {m['rustc']}. "
        f"Load average (1 min) {m['load_before']:.1f} at the start, {m['load_after']:.1f} at the end; "
        "BLAS held to one thread. Times are medians of wall time, with the fastest of the repeats in "
        "brackets; processor time is a mean and leaves out what other programs on the machine took."
    )


def _aims(r: dict) -> str:
    candidate = _time_of(r, CANDIDATE)
    rows = []

    def row(aim: str, value: str, met: bool, cpu: str) -> None:
        rows.append([aim, value, "yes" if met else "**no**", cpu])

    for peer in ("python-control", "scipy", "NumPy"):
        t = next(t for name, t in r["candidate_times"].items() if name.startswith(peer))
        ratio = t["median_s"] / candidate["median_s"]
        of_cpu = f"{t['cpu_s'] / candidate['cpu_s']:,.0f} times"
        aim = f"1000 times faster per candidate than {peer}{' by hand' if peer == 'NumPy' else ''}"
        row(aim, f"{ratio:,.0f} times", ratio >= 1000, of_cpu)
    aims = [
        ("margins and DFT of one candidate in 20 us", CANDIDATE, 20e-6),
        ("500 points at order 22 identified in 50 ms", IDENTIFY, 50e-3),
        ("one slot tuned in 100 ms, 1 thread", TUNE_1, 100e-3),
        ("one slot tuned in 100 ms, 2 threads", TUNE_2, 100e-3),
    ]
    for aim, what, limit in aims:
        t = _time_of(r, what)
        row(aim, _both(t), t["median_s"] <= limit, duration(t["cpu_s"]))
    return "## Aims\n\n" + table(["aim", "measured: median (fastest)", "met by the median", "processor time"], rows)


def _both(t: dict) -> str:
    return f"{duration(t['median_s'])} ({duration(t['fastest_s'])})"


def _margins(r: dict) -> str:
    m = r["margins"]
    rows = []
    for name, f in m["routes"].items():
        time = f["time"]["median_s"] if f["time"] else None
        rows.append([
            name,
            fixed(f["phase_margin_deg"], 6),
            fixed(f["gain_crossover_hz"], 4),
            fixed(f["gain_margin_db"], 6),
            fixed(f["phase_crossover_hz"], 4),
            fixed(f["max_sensitivity"], 6),
            fixed(f["disk_margin"], 6),
            duration(time),
        ])  # fmt: skip
    head = ["route", "PM (deg)", "at (Hz)", "GM (dB)", "at (Hz)", "Ms", "disk", "time"]
    d = m["against_reference"]
    notes = sorted({f["note"] for f in m["routes"].values() if f["note"]})
    said = "".join(f"\n\npython-control says: \"{note}\"." for note in notes)
    return (
        f"## Margins of one loop\n\nHealthy machine (order {m['order']} and delay), nominal controller. "
        "Of several crossings the one smallest in absolute value.\n\n"
        + table(head, rows)
        + "\n\nservotune against the reference, over all "
        f"{d['gain_crossings']} gain and {d['phase_crossings']} phase crossings: at most "
        f"{d['deg']:.1e} deg, {d['db']:.1e} dB, {d['hz']:.1e} Hz; Ms {d['max_sensitivity_relative']:.1e} "
        f"and disk margin {d['disk_margin_relative']:.1e} relative. The reference shares no code with servotune: "
        "scipy's matrix exponential, 10^6 points, roots by Brent's method.\n\n"
        f"In process servotune's exact margins take {_both(_time_of(r, EXACT_MARGINS))}; the whole command, "
        f"process start and JSON included, {duration(m['command_time']['median_s'])}." + said
    )


def _write(r: dict) -> str:
    w = r["write"]
    rows = [
        [
            name,
            f"{f['quiet_pes_difference']:.1e}",
            f"{f['noise_pes_difference']:.1e}",
            f"{f['noise_amplitude_difference']:.1e}",
            duration(f["time"]["median_s"]),
        ]
        for name, f in w["routes"].items()
    ]
    head = ["route", "PES difference, no noise (track)", "with noise (track)", "DFT amplitude (track)", "time"]
    return (
        f"## PES of a spiral write\n\n{w['samples']} servo samples between controller samples, "
        f"PES range {number(w['pes_range'])} track, DFT norms {number(w['dft_low'])} and {number(w['dft_high'])} track. "
        "Largest differences from `servotune simulate`; DFT by numpy's FFT. "
        "The noise is drawn in Python by its own implementation of the same generator.\n\n"
        + table(head, rows)
        + f"\n\nIn process servotune takes {_both(_time_of(r, WRITE))}, sampling of the plant included; the whole "
        f"command {duration(w['command_time']['median_s'])}. The peers' times leave out the sampling of the plant and "
        "the preparation of the readings."
    )


def _candidate(r: dict) -> str:
    ours = _time_of(r, CANDIDATE)
    rows = [
        [
            name,
            _both(t),
            duration(t["cpu_s"]),
            f"{t['median_s'] / ours['median_s']:,.0f}",
            f"{t['fastest_s'] / ours['fastest_s']:,.0f}",
            f"{t['cpu_s'] / ours['cpu_s']:,.0f}",
        ]
        for name, t in r["candidate_times"].items()
    ]
    rows.append(["servotune, search", _both(ours), duration(ours["cpu_s"]), "1", "1", "1"])
    head = ["route", "median (fastest)", "processor", "times servotune: medians", "fastest", "processor"]
    return (
        "## One candidate of a search\n\nMargins, Ms, stability, write up to the end of the window, DFT, "
        "expected power of the noise; "
        "all that does not depend on the gains is prepared before.\n\n" + table(head, rows)
    )


def _discretisation(r: dict) -> str:
    out = [
        "## Exact sampling\n\n"
        f"{r['discretisation']['plants']} random plants for each order, zero-order hold at 39.6 us, delay removed "
        "(the peers have none). Worst relative error of P(e^{jwT}) over frequency, against partial fractions in 50 digits."
    ]
    for order, part in r["discretisation"]["orders"].items():
        rows = []
        for name, f in part["routes"].items():
            refused = "0" if not f["refused_count"] else f"{f['refused_count']} ({', '.join(f['refused'])})"
            rows.append([
                name, refused, str(f["not_a_number_count"]), number(f["median_of_worst"], 2), number(f["worst"], 2)
            ])  # fmt: skip
        head = ["route", "plants refused", "NaN or infinite", "median plant", "worst plant"]
        out.append(
            f"Order {order}, {part['points']} frequencies. The reference agrees with the aliasing sum of the product form "
            f"within {part['reference_against_aliasing_sum']:.1e}.\n\n" + table(head, rows)
        )
    return "\n\n".join(out)


def _identification(r: dict) -> str:
    s = r["identification"]["settings"]
    rows = [
        [
            name,
            share(f["median_error"]),
            share(f["p95_error"]),
            share(f["worst_p95_error"]),
            duration(f["median_time_s"]),
            duration(f["longest_time_s"]),
        ]
        for name, f in r["identification"]["routes"].items()
    ]
    head = ["route", "median error", "95th percentile", "worst plant's", "time", "longest"]
    fixed_order, auto = _time_of(r, IDENTIFY), _time_of(r, IDENTIFY_AUTO)
    return (
        f"## Identification\n\n{s['plants']} random plants, {s['points']} points at "
        f"{s['band_hz'][0]:.0f}-{s['band_hz'][1]:.0f} Hz, {share(s['noise'])} relative noise; the same sweeps for every "
        "route. Relative error of the fitted response against the noise-free truth, on a grid ten times finer; columns: "
        "median over plants of each plant's median, of each plant's 95th percentile, and the largest 95th percentile.\n\n"
        + table(head, rows)
        + "\n\nTimes of servotune are of the whole command: process, reading, writing. In process, 500 points: "
        f"{_both(fixed_order)} with the order given, {_both(auto)} with the order chosen on held-out frequencies."
    )


def _tuning(r: dict) -> str:
    t = r["tuning"]
    t1, t2 = _time_of(r, TUNE_1), _time_of(r, TUNE_2)

    def row(f: dict, time: str) -> list[str]:
        return [
            f["route"],
            str(f.get("evaluations", "-")),
            time,
            number(f["objective"], 5),
            f"{100 * f['largest_miss'] + 0.0:+.4f} %",
            fixed(f["phase_margin_deg"], 2),
            fixed(f["gain_margin_db"], 2),
            fixed(f["max_sensitivity"], 3),
        ]

    rows = [row({"route": "nominal controller, where all start", **t["start"]}, "-")]
    rows += [row(f, duration(f["time_s"])) for f in t["peers"]]
    rows.append(row(t["servotune"], _both(t1)))
    control = next(x for name, x in r["candidate_times"].items() if name.startswith("python-control"))
    evaluations = t["servotune"]["evaluations"]
    head = ["route", "evaluations", "time", "objective", "largest miss", "PM (deg)", "GM (dB)", "Ms"]
    command = ""
    if t["command_time"] is not None:
        command = f" The whole command takes {duration(t['command_time']['median_s'])}."
    return (
        "## One full tuning\n\nHealthy machine, `benches/peers/spec.toml`, seven parameters. Objective: dft_low/limit + "
        "dft_high/limit with the noise as its expected power, smaller is better; a miss above 0 breaks a limit. Every result is judged by the reference, not by "
        "the tuner that found it.\n\n"
        + table(head, rows)
        + f"\n\nservotune's verdict: {t['verdict']}.{command} The scipy optimisers run around the hand-written NumPy "
        "candidate, the cheapest peer above. Around python-control's candidate the same "
        f"{evaluations} evaluations would take {duration(evaluations * control['median_s'])} (computed from the time of "
        "one, not run). Time of two threads: "
        f"{_both(t2)}; the work is split by starts."
    )


def _speed(r: dict) -> str:
    def row(t: dict) -> list[str]:
        times = [duration(t[key]) for key in ("median_s", "fastest_s", "cpu_s")]
        return [t["what"], *times, f"{t['repeats']} x {t['batch']}"]

    rows = [row(t) for t in r["speed"]["times"]]
    return "## servotune's own times\n\n`cargo bench --bench speed`, in the same run.\n\n" + table(
        ["what", "median", "fastest", "processor", "repeats x calls"], rows
    )


def _caveats() -> str:
    # Long lines stay: they are text, not code.
    return """## What is equal, and what is not

- Equal: plant, controller, write, noise draws, limits, box of the search, machine, run. One thread, but for the row that says two; the processor time of that row is of all
  threads together.
- Margins: the peers work on 1000 points and interpolate. servotune's search also works on a grid (of its own choice) and judges its answer exactly at the end; its
  exact margins are a separate row. The peers' routes list no Nyquist count; their stability comes from eigenvalues, which are in the times per candidate.
- The hand-written NumPy route is nobody's library: it is the least that a careful user must write, and it is the fairest opponent on time.
- Discretisation: python-control and scipy have no delay in their sampling; it is added by hand where a loop needs it, from scipy's matrix exponential.
- The hand-built block-diagonal form is work that the peers leave to the user. With it they are as accurate as servotune.
- Vector fitting: scikit-rf is meant for scattering parameters, without weights; the raw row uses it outside that purpose. The row with the true body and delay gives it
  what no user has, which is why its median error is the smaller one. servotune gets the sweep alone.
- Noise in a candidate: both sides add the expected power of the noise, by density on points a quarter of a bin apart; servotune's are coarser away from the bins. The reference that judges the tunings sums the squared share of
  every draw in the time domain and neglects nothing.
- Tuning: scipy offers optimisers, not a servo tuner; price of a miss and starts were chosen here and not tuned for either side. Starts, polish and derivatives of
  servotune are counted as evaluations. A miss of some 0.02 % in a scipy row is the penalty's and the grid's, not a fault of the optimiser.
- Other programs on the machine lengthen the wall times of both sides; the load stands above."""
