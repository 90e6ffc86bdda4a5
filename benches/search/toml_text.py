"""Documents of numbers, words, lists and tables as TOML text."""

from __future__ import annotations


def _value(v: object) -> str:
    if isinstance(v, bool):
        return "true" if v else "false"
    if isinstance(v, str):
        return f'"{v}"'
    if isinstance(v, (list, tuple)):
        return "[" + ", ".join(_value(x) for x in v) + "]"
    if isinstance(v, dict):
        return "{ " + ", ".join(f"{k} = {_value(x)}" for k, x in v.items()) + " }"
    if isinstance(v, int):
        return str(v)
    return repr(float(v))


def text(document: dict) -> str:
    """Plain keys first, then tables one level deep, `[[limits.curve]]` as tables of their own."""
    lines = [f"{k} = {_value(v)}" for k, v in document.items() if not isinstance(v, dict)]
    for name, table in document.items():
        if isinstance(table, dict):
            curves = table.get("curve", [])
            plain = {k: v for k, v in table.items() if k != "curve"}
            if plain or not curves:
                lines += ["", f"[{name}]"] + [f"{k} = {_value(v)}" for k, v in plain.items()]
            for c in curves:
                lines += ["", f"[[{name}.curve]]"] + [f"{k} = {_value(v)}" for k, v in c.items()]
    return "\n".join(lines) + "\n"
