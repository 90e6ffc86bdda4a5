#!/bin/sh
# Builds the documentation site into target/site and looks whether every link in it leads to a file, and to a place in it where it names one.
#   scripts/site.sh            mdbook is used where it is installed, and installed by cargo where it is not. It is built without
#                              optimisation: that takes a third of the time, and the book is small.
# Ends with 3, and says so, where mdbook cannot be installed. The pictures are made by scripts/pictures.sh and stand in book/src/pictures.
set -eu
cd "$(dirname "$0")/.."
if ! command -v mdbook >/dev/null; then
    cargo install mdbook --debug --locked --version 0.5.4 --no-default-features --features search || { echo "no site: mdbook cannot be installed" >&2; exit 3; }
    PATH="${CARGO_HOME:-$HOME/.cargo}/bin:$PATH"
fi
mdbook build book
# Links within the site: every href and src that names no other host must be a file.
python3 - target/site <<'PY'
import html.parser, pathlib, sys, urllib.parse

root = pathlib.Path(sys.argv[1])
wrong, seen = [], 0
pages = {}

class Page(html.parser.HTMLParser):
    def __init__(self):
        super().__init__()
        self.links, self.ids = [], set()
    def handle_starttag(self, tag, attrs):
        for name, value in attrs:
            if name in ("href", "src", "srcset") and value:
                self.links.append(value)
            if name == "id":
                self.ids.add(value)

for file in sorted(root.rglob("*.html")):
    page = Page()
    page.feed(file.read_text(encoding="utf-8"))
    pages[file.resolve()] = page
for file, page in pages.items():
    if file.name in ("404.html", "print.html", "toc.html"):
        continue
    for link in page.links:
        parts = urllib.parse.urlsplit(link)
        if parts.scheme or parts.netloc:
            continue
        seen += 1
        target = (file.parent / urllib.parse.unquote(parts.path)).resolve() if parts.path else file
        if target.is_dir():
            target = target / "index.html"
        if not target.exists():
            wrong.append(f"{file.name}: {link}: no such file")
        elif parts.fragment and target in pages and urllib.parse.unquote(parts.fragment) not in pages[target].ids:
            wrong.append(f"{file.name}: {link}: no such place in the page")
print(f"{len(pages)} pages, {seen} links, {len(wrong)} wrong")
sys.exit("\n".join(wrong) if wrong else 0)
PY
