#!/bin/sh
# Builds the documentation site into target/site and looks whether every link in it leads somewhere.
#   scripts/site.sh            mdbook is used where it is installed, and installed by cargo where it is not (some minutes)
set -eu
cd "$(dirname "$0")/.."
if ! command -v mdbook >/dev/null; then
    cargo install mdbook --locked --version 0.5.4 --no-default-features --features search
    PATH="${CARGO_HOME:-$HOME/.cargo}/bin:$PATH"
fi
mdbook build book
# Pictures of the pages are made by the program and are in no commit; without Chromium or the program the site stands without them.
pictures=yes
scripts/pictures.sh target/site/pictures || { [ $? = 3 ] && pictures=no; }
# Links within the site: every href and src that names no other host must be a file.
python3 - target/site $pictures <<'PY'
import html.parser, pathlib, sys, urllib.parse

root = pathlib.Path(sys.argv[1])
wrong, seen = [], 0
pictures = sys.argv[2] == "yes"
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
        if parts.scheme or parts.netloc or (parts.path.startswith("pictures/") and not pictures):
            continue
        seen += 1
        target = (file.parent / urllib.parse.unquote(parts.path)).resolve() if parts.path else file
        if target.is_dir():
            target = target / "index.html"
        if not target.exists():
            wrong.append(f"{file.name}: {link}: no such file")
        elif parts.fragment and target in pages and urllib.parse.unquote(parts.fragment) not in pages[target].ids:
            wrong.append(f"{file.name}: {link}: no such place in the page")
print(f"{len(pages)} pages, {seen} links" + ("" if pictures else "; without pictures of the pages"))
sys.exit("\n".join(wrong) if wrong else 0)
PY
