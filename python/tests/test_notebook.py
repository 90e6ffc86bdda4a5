"""Every result shows itself in a notebook."""

from __future__ import annotations

import base64

from conftest import swept

import servotune as st


def picture(result) -> str:
    html = result._repr_html_()
    assert html.startswith('<img alt="figure" src="data:image/svg+xml;base64,')
    return base64.b64decode(html.split("base64,")[1].split('"')[0]).decode()


def test_pictures(root, healthy, nominal):
    frf = swept(healthy, 3)
    assert "<svg" in picture(frf)
    assert "<svg" in picture(healthy)
    assert "<svg" in picture(nominal)
    assert "Measured response and model" in picture(st.identify(frf, order=4))
    assert "Open loop" in picture(st.margins(healthy, nominal))
    assert "Open loop" in picture(st.margins(frf, nominal))
    assert "Position error" in picture(st.simulate(healthy, nominal, root / "specs/profiles/spiral.toml"))
