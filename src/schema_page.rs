//! Every key of every file as a page.
//!
//! In: the lists of keys. Out: Markdown, which `specs/keys.md` carries and `servotune init` writes.

use servotune::document::KeyFile;

const HEAD: &str = "# Every key of every file

Printed by `servotune schema --page` from the lists that stand beside the readers. A test walks through every key: left out, at each end of its range and beyond, of a wrong type.
Keys whose range depends on others are named in `tests/key_walk.rs`; numbers of gains.toml are asked for their type alone.
`servotune schema plant|controller|gains|spec|profile|case|fleet` prints the same as a JSON schema, with which editors complete and check keys.
Editors with Taplo want `#:schema spec.schema.json` in the first line of the file.

Units: `pos` is the file's `position_unit`, `cmd` its `command_unit`. Every number is finite. A range is `[from, to]`. An unknown key is refused with its line and the nearest known one.
";

/// The page.
pub(super) fn text(files: &[KeyFile]) -> String {
    let mut out = String::from(HEAD);
    for file in files {
        out += &format!("\n## {}\n", file.name);
        if !file.about.is_empty() {
            out += &format!("\n{}", file.about);
        }
        for table in file.tables {
            let heading = if table.heading.is_empty() { "top" } else { table.heading };
            out += &format!(
                "\n### {heading}\n\n| key | type | unit | default | range | means |\n|---|---|---|---|---|---|\n"
            );
            for k in table.keys {
                let name = format!("`{}`", k.name);
                let cells = [&name, &k.kind.text(), k.unit, &k.need.text(), &k.asked(), k.means];
                for cell in cells {
                    let blank = if cell.is_empty() { "" } else { " " };
                    out += &format!("|{blank}{}{blank}", cell.replace('|', "\\|"));
                    out += if cell.is_empty() { " " } else { "" };
                }
                out += "|\n";
            }
        }
    }
    out
}
