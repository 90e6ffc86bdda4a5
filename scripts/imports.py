"""Which Rust file imports which, read as the compiler reads it: a re-export is followed to the file that holds the item.

In: the files of a workspace. Out: arrows between files of one crate, and the files that stand in circles. `tests/architecture_imports.rs` reads by the
same rule. A path counts wherever it stands in the code, inside functions too; comments and unit tests do not. A file that only hands out names of
others is no file of a circle; one that holds code of its own is, `mod.rs`, `lib.rs` and `main.rs` included. What it hands out and does not use itself
is no import. A glob that is handed out may mean any file behind it.
"""

import re
from pathlib import Path
from typing import NamedTuple

Place = tuple[str, ...]
USE = re.compile(r"^\s*(pub(?:\([^)]*\))? )?use ([^;]+);", re.M)


class Import(NamedTuple):
    """A name that a `use` brings in, `*` for all of a module."""

    public: bool
    path: Place
    name: str


class Text(NamedTuple):
    """A file's imports, the words and paths of the rest, and whether the rest is more than a list of modules."""

    imports: list[Import]
    words: list[Place]
    own: bool


def without_tests(text: str) -> str:
    """A file up to its unit tests."""
    return text.split("#[cfg(test)]\nmod ", 1)[0]


def read(text: str) -> Text:
    """What a file says."""
    code = "\n".join(line for line in without_tests(text).splitlines() if not line.lstrip().startswith("//"))
    imports = []
    for m in USE.finditer(code):
        for leaf in apart(re.sub(r"\s", "", m.group(2).replace(" as ", "@"))):
            path, _, name = leaf.partition("@")
            parts = tuple(p for p in path.split("::") if p not in ("", "self"))
            imports.append(Import(bool(m.group(1)), parts, name or parts[-1]))
    rest = re.sub(r"^(?:pub )?mod \w+;", "", re.sub(r"pub\([^)]*\)", "pub", USE.sub("", code)), flags=re.M)
    words = [tuple(w.rstrip(":").split("::")) for w in set(re.findall(r"[\w:]+", rest)) if not w.startswith(":")]
    return Text(imports, words, any(not line.startswith("#") for line in rest.splitlines() if line))


def apart(tree: str) -> list[str]:
    """`a::{b, c::{d, e}}` as `a::b`, `a::c::d`, `a::c::e`."""
    head, brace, group = tree.partition("{")
    if not brace:
        return [tree]
    depth, parts = 0, [""]
    for c in group[:-1]:
        depth += (c == "{") - (c == "}")
        parts += [""] if c == "," and not depth else []
        parts[-1] += c if c != "," or depth else ""
    return [head + p for part in parts if part for p in apart(part)]


def rooted(texts: dict[Place, Text], place: Place, path: Place) -> Place | None:
    """A path as it reads from the root of the crate; none where it begins in another crate."""
    if path[0] not in ("crate", "super", "self"):
        return (*place, *path) if (*place, path[0]) in texts else None
    full: list[str] = list(place)
    for part in path:
        full = [] if part == "crate" else full[:-1] if part == "super" else full if part == "self" else [*full, part]
    return tuple(full)


def meant(texts: dict[Place, Text], path: Place, seen: set[Place]) -> set[Place]:
    """Files that hold what a path from the root of the crate names."""
    if path in seen:
        return set()
    seen.add(path)
    module = next(path[:n] for n in range(len(path), -1, -1) if path[:n] in texts)
    # A path that ends at a module may also name an item of the same name that is handed out beside it.
    outer, rest = (module, path[len(module) :]) if module != path else (module[:-1], module[-1:])
    named = [i for i in texts[outer].imports if (i.name,) == rest[:1]]
    globs = [i for i in texts[outer].imports if i.name == "*" and outer == module and rest and not named]
    found = {module} if texts[module].own and (outer != module or not named) else set()
    for i in named + globs:
        behind = rooted(texts, outer, i.path)
        if behind is not None:
            found |= meant(texts, (*behind[:-1], *rest) if i in globs else (*behind, *rest[1:]), seen)
    return found


def arrows(source: Path) -> dict[Place, set[Place]]:
    """The files that each file of a crate uses."""
    texts: dict[Place, Text] = {}
    for file in sorted(source.rglob("*.rs")):
        place = file.relative_to(source).with_suffix("").parts
        texts.setdefault(place[:-1] if file.stem in ("mod", "lib", "main") else place, read(file.read_text()))
    found = {}
    for place, text in texts.items():
        used = {w[0] for w in text.words}
        paths = [i.path for i in text.imports if text.own and (not i.public or i.name in used)]
        for word in text.words if text.own else []:
            paths += [word] if len(word) > 1 else []
            paths += [(*i.path, *word[1:]) for i in text.imports if i.name == word[0] and len(word) > 1]
        full = {rooted(texts, place, p) for p in paths} - {None}
        found[place] = {f for p in full for f in meant(texts, p, set())} - {place}
    return found


def circles(root: Path) -> list[str]:
    """Files that import one another in a circle within their crate."""
    found = []
    for source in [root / "src", *sorted(root.glob("crates/*/src"))]:
        edges = arrows(source)
        for start in edges:
            seen, todo = set(), [start]
            while todo:
                for m in edges[todo.pop()] - seen:
                    seen.add(m)
                    todo.append(m)
            if start in seen:
                found.append(str(source.relative_to(root).joinpath(*start)))
    return found
