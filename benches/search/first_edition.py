"""A spec in words that the program of before this bench understands, where there are any."""

from __future__ import annotations

import judge
import toml_text

MARGINS = {"phase_margin_deg", "gain_margin_db", "max_sensitivity", "gain_crossover_hz"}
LIMITS = {"dft_low", "dft_high", "harmonics", "command_peak"}


def translated(spec: dict) -> str | None:
    """The same limits with objective dft over the fixed bands; None where the first edition has no words for them."""
    objective = spec.get("objective", {})
    says_more = (
        objective.get("minimise") != "dft"
        or objective.get("bands_hz", judge.BANDS) != judge.BANDS
        or "profile" not in spec
        or "structure" in spec
        or judge.guard_of(spec) != 0.0
        or not set(spec.get("margins", {})) <= MARGINS
        or not set(spec.get("limits", {})) <= LIMITS
        or "bounds" not in spec.get("search", {})
    )
    if says_more:
        return None
    return toml_text.text({k: v for k, v in spec.items() if k in ("profile", "margins", "limits", "search")})
