//! A key of a file: its name, type and unit, what its reader takes, what it is when it is left out, what it means.
//!
//! Each room lists the keys of its files beside their readers. `servotune schema` prints these lists as JSON schemas, and as `specs/keys.md`. A test
//! walks through every key and holds the lists against the readers.

/// The keys of one file.
#[derive(Clone, Copy, Debug)]
pub struct KeyFile {
    /// The file's usual name.
    pub name: &'static str,
    /// What stands above its tables on the page (Markdown).
    pub about: &'static str,
    /// A file all of whose keys it has too.
    pub base: Option<&'static KeyFile>,
    /// Its tables, in their order.
    pub tables: &'static [KeyTable],
}

/// One table of a file.
#[derive(Clone, Copy, Debug)]
pub struct KeyTable {
    /// Its heading in TOML: `[limits]`, `[[limits.curve]]`; empty at the top.
    pub heading: &'static str,
    /// Its keys.
    pub keys: &'static [FileKey],
}

/// One key of a table.
#[derive(Clone, Copy, Debug)]
pub struct FileKey {
    /// Name.
    pub name: &'static str,
    /// Type.
    pub kind: KeyKind,
    /// Unit; `pos` and `cmd` are the file's own.
    pub unit: &'static str,
    /// What happens where it is left out.
    pub need: Need,
    /// Numbers that it takes; in a list each of them.
    pub range: Range,
    /// How many a list takes, least and most.
    pub items: [usize; 2],
    /// What else is asked of it, in words: it depends on other keys.
    pub also: &'static str,
    /// What it is.
    pub means: &'static str,
}

/// Type of a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the words of the page")]
pub enum KeyKind {
    Number,
    Integer,
    Bool,
    Text,
    /// Relative to the file's folder.
    Path,
    /// One of these words.
    Choice(&'static [&'static str]),
    Numbers,
    Texts,
    /// [from, to], not falling.
    Pair,
    Pairs,
    /// [first, last].
    Integers,
    NumberOrPair,
    /// Each a number, or [real part, imaginary part].
    Roots,
    /// Numbers, plain or one in each row.
    Vector,
    Matrix,
    /// Plain, or in brackets.
    NumberOrMatrix,
    Table,
    Tables,
}

/// Whether a file gives a key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Need {
    /// It must.
    Always,
    /// It must, unless it gives one of these.
    Unless(&'static [&'static str]),
    /// It must where the words say, and nowhere else.
    Where(&'static str),
    /// It may; else the key is this number.
    Or(f64),
    /// It may; else the key is this, as TOML writes it.
    OrToml(&'static str),
    /// It may; else the key is what the words say.
    OrElse(&'static str),
    /// It may, and that says nothing: reports make it from the other keys.
    Reported,
}

/// Numbers that a key takes; all are finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Range {
    /// Any.
    Any,
    /// Any but 0.
    NotZero,
    /// Between two ends.
    Between(End, End),
    /// Of either sign, of a size from one to the other.
    Size(f64, f64),
}

/// An end of a range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum End {
    /// None.
    Open,
    /// It belongs to the range.
    With(f64),
    /// It does not.
    Without(f64),
}

/// The shorter way to write a number.
fn short(x: f64) -> String {
    let (plain, scientific) = (format!("{x}"), format!("{x:e}"));
    if scientific.len() < plain.len() { scientific } else { plain }
}

impl Range {
    /// In words.
    pub fn text(self) -> String {
        use End::{Open, With, Without};
        match self {
            Range::Any => "finite".into(),
            Range::NotZero => "finite, not 0".into(),
            Range::Size(0.0, most) => format!("size up to {}", short(most)),
            Range::Size(least, most) => format!("size {} to {}", short(least), short(most)),
            Range::Between(With(a), With(b)) if a == b => short(a),
            Range::Between(With(a), With(b)) => format!("{} to {}", short(a), short(b)),
            Range::Between(With(a), Without(b)) => format!("{} to below {}", short(a), short(b)),
            Range::Between(low, high) => {
                let low = match low {
                    Open => None,
                    With(a) => Some(format!("at least {}", short(a))),
                    Without(a) => Some(format!("above {}", short(a))),
                };
                let high = match high {
                    Open => None,
                    With(b) => Some(format!("at most {}", short(b))),
                    Without(b) => Some(format!("below {}", short(b))),
                };
                low.into_iter().chain(high).collect::<Vec<_>>().join(", ")
            }
        }
    }
}

impl KeyKind {
    /// Whether its values are numbers or lists of them.
    pub fn of_numbers(self) -> bool {
        use KeyKind::{Bool, Choice, Path, Table, Tables, Text, Texts};
        !matches!(self, Bool | Text | Path | Choice(_) | Texts | Table | Tables)
    }

    /// Whether a text stands there.
    pub fn of_text(self) -> bool {
        matches!(self, KeyKind::Text | KeyKind::Path | KeyKind::Choice(_))
    }

    /// In words.
    pub fn text(self) -> String {
        match self {
            KeyKind::Number => "number",
            KeyKind::Integer => "integer",
            KeyKind::Bool => "bool",
            KeyKind::Text => "text",
            KeyKind::Path => "path",
            KeyKind::Choice(words) => return words.join(", "),
            KeyKind::Numbers => "numbers",
            KeyKind::Texts => "texts",
            KeyKind::Pair => "range",
            KeyKind::Pairs => "ranges",
            KeyKind::Integers => "range of integers",
            KeyKind::NumberOrPair => "number or range",
            KeyKind::Roots => "roots",
            KeyKind::Vector => "vector",
            KeyKind::Matrix => "matrix",
            KeyKind::NumberOrMatrix => "number or matrix",
            KeyKind::Table => "table",
            KeyKind::Tables => "tables",
        }
        .into()
    }
}

impl Need {
    /// What stands in the column of defaults.
    pub fn text(self) -> String {
        match self {
            Need::Always => "required".into(),
            Need::Unless(others) => format!("required, or `{}`", others.join("` or `")),
            Need::Where(words) => format!("required: {words}"),
            Need::Or(number) => short(number),
            Need::OrToml("{}") => "those of its keys".into(),
            Need::OrToml("[]") => "none".into(),
            Need::OrToml(text) | Need::OrElse(text) => text.into(),
            Need::Reported => "reported".into(),
        }
    }
}

impl FileKey {
    /// A key that a file must give.
    pub const fn new(name: &'static str, kind: KeyKind, unit: &'static str, means: &'static str) -> FileKey {
        let range = match kind {
            KeyKind::Integer | KeyKind::Integers => Range::Between(End::With(0.0), End::Open),
            _ => Range::Any,
        };
        FileKey { name, kind, unit, need: Need::Always, range, items: [0, usize::MAX], also: "", means }
    }

    /// A number.
    pub const fn number(name: &'static str, unit: &'static str, means: &'static str) -> FileKey {
        FileKey::new(name, KeyKind::Number, unit, means)
    }

    /// A whole number of at least 0.
    pub const fn integer(name: &'static str, unit: &'static str, means: &'static str) -> FileKey {
        FileKey::new(name, KeyKind::Integer, unit, means)
    }

    /// A text.
    pub const fn of_text(name: &'static str, means: &'static str) -> FileKey {
        FileKey::new(name, KeyKind::Text, "", means)
    }

    /// A path.
    pub const fn path(name: &'static str, means: &'static str) -> FileKey {
        FileKey::new(name, KeyKind::Path, "", means)
    }

    /// A table below this one.
    pub const fn table(name: &'static str, means: &'static str) -> FileKey {
        FileKey::new(name, KeyKind::Table, "", means)
    }

    /// A list of tables.
    pub const fn tables(name: &'static str, means: &'static str) -> FileKey {
        FileKey::new(name, KeyKind::Tables, "", means)
    }

    /// The same, needed as this says.
    pub const fn need(self, need: Need) -> FileKey {
        FileKey { need, ..self }
    }

    /// The same with a default.
    pub const fn or(self, default: f64) -> FileKey {
        self.need(Need::Or(default))
    }

    /// The same with a default as TOML writes it.
    pub const fn or_toml(self, default: &'static str) -> FileKey {
        self.need(Need::OrToml(default))
    }

    /// The same with a default in words.
    pub const fn or_else(self, default: &'static str) -> FileKey {
        self.need(Need::OrElse(default))
    }

    /// The same, absent unless it is given.
    pub const fn or_none(self) -> FileKey {
        self.or_else("none")
    }

    /// The same with numbers that it takes.
    pub const fn takes(self, range: Range) -> FileKey {
        FileKey { range, ..self }
    }

    /// The same, above a number.
    pub const fn above(self, low: f64) -> FileKey {
        self.takes(Range::Between(End::Without(low), End::Open))
    }

    /// The same, a number or above.
    pub const fn at_least(self, low: f64) -> FileKey {
        self.takes(Range::Between(End::With(low), End::Open))
    }

    /// The same, from a number to another.
    pub const fn within(self, low: f64, high: f64) -> FileKey {
        self.takes(Range::Between(End::With(low), End::With(high)))
    }

    /// The same, so many of a list.
    pub const fn items(self, least: usize, most: usize) -> FileKey {
        FileKey { items: [least, most], ..self }
    }

    /// The same with what else is asked.
    pub const fn also(self, also: &'static str) -> FileKey {
        FileKey { also, ..self }
    }

    /// All that is asked of its value, in words.
    pub fn asked(&self) -> String {
        let range = if self.kind.of_numbers() { self.range.text() } else { String::new() };
        let items = match self.items {
            [0, usize::MAX] => String::new(),
            [0, most] => format!("at most {most}"),
            [least, usize::MAX] => format!("at least {least} of them"),
            [least, most] => format!("{least} to {most} of them"),
        };
        // "finite" goes without saying beside more.
        let beside = !items.is_empty() || !self.also.is_empty();
        let range = if range == "finite" && beside { String::new() } else { range };
        [range, items, self.also.to_owned()].into_iter().filter(|s| !s.is_empty()).collect::<Vec<_>>().join("; ")
    }
}
