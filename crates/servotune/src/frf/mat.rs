//! MATLAB files of level 5 (versions 5 to 7.2): the variables in them, nested fields included, numbers left as bytes until wanted.
//!
//! In: bytes of the file. Out: [`Variable`]s. Format: MAT-file level 5 (The MathWorks, "MAT-File Format"); spec: `specs/frf.md`, "MATLAB files".

use super::error::{FrfError, NotText};
use super::settings::ReadSettings;
use std::borrow::Cow;
use std::io::Read;

/// Bytes before the first element.
const HEADER: usize = 128;
/// Data types of elements.
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;
/// Deepest nesting of fields that is followed.
const DEEPEST: usize = 8;

/// Numbers as they lie in the file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Raw<'a> {
    kind: u32,
    bytes: &'a [u8],
    little: bool,
}

/// An array of numbers: its sizes, first index fastest, real parts and, where it is complex, imaginary parts.
#[derive(Clone, Debug)]
pub(super) struct Numbers<'a> {
    pub sizes: Vec<usize>,
    pub re: Raw<'a>,
    pub im: Option<Raw<'a>>,
}

/// What a variable or a field holds.
#[derive(Clone, Debug)]
pub(super) enum Value<'a> {
    Numbers(Numbers<'a>),
    Text(String),
    /// A structure of one element, or an object of the time before `classdef`: its fields.
    Fields(Vec<(String, Value<'a>)>),
    /// Nothing that a response could be in, in words.
    Other(String),
}

/// A name of the workspace and what it holds.
pub(super) type Variable<'a> = (String, Value<'a>);

/// Whether the bytes are a MATLAB file of level 5; one of level 7.3 is an HDF5 file and refused by name.
pub(super) fn is_mat(file: &str, bytes: &[u8]) -> Result<bool, FrfError> {
    let version = bytes.get(124..HEADER).unwrap_or_default();
    let hdf5 = bytes.starts_with(b"\x89HDF") || matches!(version, [0, 2, b'I', b'M'] | [2, 0, b'M', b'I']);
    if hdf5 {
        return Err(FrfError::NotText { file: file.to_owned(), found: NotText::Hdf5 });
    }
    Ok(matches!(version, [0, 1, b'I', b'M'] | [1, 0, b'M', b'I']))
}

/// The elements of a file.
pub(super) struct Elements<'a> {
    /// Compressed ones inflated.
    all: Vec<Cow<'a, [u8]>>,
    /// Whether their numbers have the low byte first.
    little: bool,
}

/// The elements of the file.
pub(super) fn elements<'a>(file: &str, bytes: &'a [u8], settings: &ReadSettings) -> Result<Elements<'a>, FrfError> {
    let little = bytes[126] == b'I';
    let mut rest = Cursor { bytes: &bytes[HEADER..], little };
    let mut left = settings.inflated_limit_bytes;
    let mut out = Vec::new();
    while !rest.bytes.is_empty() {
        let number = out.len() + 1;
        let before = rest.bytes;
        let (kind, inside) =
            rest.element().ok_or_else(|| damaged(file, number, "an element of the length it declares"))?;
        if kind != COMPRESSED {
            out.push(Cow::Borrowed(before));
            continue;
        }
        let mut all = Vec::new();
        let end = flate2::read::ZlibDecoder::new(inside).take(left as u64 + 1).read_to_end(&mut all);
        end.map_err(|_| damaged(file, number, "compressed data to their end"))?;
        left = left
            .checked_sub(all.len())
            .ok_or(FrfError::InflatedTooLarge { file: file.to_owned(), limit_bytes: settings.inflated_limit_bytes })?;
        out.push(Cow::Owned(all));
    }
    Ok(Elements { all: out, little })
}

/// The variables in those elements; what has no name belongs to MATLAB itself.
pub(super) fn variables<'a>(file: &str, elements: &'a Elements<'_>) -> Result<Vec<Variable<'a>>, FrfError> {
    let little = elements.little;
    let mut out = Vec::new();
    for (i, element) in elements.all.iter().enumerate() {
        let mut cursor = Cursor { bytes: element, little };
        let found = match cursor.element() {
            Some((MATRIX, inside)) => matrix(inside, little, DEEPEST),
            // Level 5 knows no other element out here; what it holds is passed over.
            Some(_) => continue,
            None => None,
        };
        let (name, value) = found.ok_or_else(|| damaged(file, i + 1, "an array with flags, sizes, name and data"))?;
        if !name.is_empty() {
            out.push((name, value));
        }
    }
    Ok(out)
}

fn damaged(file: &str, number: usize, expected: &'static str) -> FrfError {
    FrfError::MatDamaged { file: file.to_owned(), number, expected }
}

/// A place in a run of elements.
struct Cursor<'a> {
    bytes: &'a [u8],
    little: bool,
}

impl<'a> Cursor<'a> {
    fn word(&self, at: usize) -> Option<u32> {
        let word: [u8; 4] = self.bytes.get(at..at + 4)?.try_into().ok()?;
        Some(if self.little { u32::from_le_bytes(word) } else { u32::from_be_bytes(word) })
    }

    /// The next element, its type and its data. Small ones keep length and data within eight bytes; the others end on a multiple of eight.
    fn element(&mut self) -> Option<(u32, &'a [u8])> {
        let first = self.word(0)?;
        if first >> 16 != 0 {
            let length = (first >> 16) as usize;
            let data = self.bytes.get(4..8)?.get(..length)?;
            self.bytes = &self.bytes[8..];
            return Some((first & 0xffff, data));
        }
        let length = self.word(4)? as usize;
        let data = self.bytes.get(8..)?.get(..length)?;
        let end = if first == COMPRESSED { 8 + length } else { 8 + length.next_multiple_of(8) };
        // The last element of a file may lack its filling.
        self.bytes = &self.bytes[end.min(self.bytes.len())..];
        Some((first, data))
    }

    fn of_kind(&mut self, kinds: &[u32]) -> Option<Raw<'a>> {
        let little = self.little;
        self.element().filter(|(kind, _)| kinds.contains(kind)).map(|(kind, bytes)| Raw { kind, bytes, little })
    }

    fn name(&mut self) -> Option<String> {
        self.of_kind(&[1, 2, 16]).map(|raw| until_zero(raw.bytes))
    }
}

fn until_zero(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}

/// The array in the data of one matrix element.
fn matrix(bytes: &[u8], little: bool, deepest: usize) -> Option<Variable<'_>> {
    let mut at = Cursor { bytes, little };
    if bytes.is_empty() {
        return Some((String::new(), Value::Other("an empty array".into())));
    }
    let flags = at.of_kind(&[6])?;
    let word = Cursor { bytes: flags.bytes, little }.word(0)?;
    let (class, complex) = (word & 0xff, word & 0x800 != 0);
    if class == 17 {
        let (name, _, class) = (at.name()?, at.name()?, at.name()?);
        return Some((name, Value::Other(format!("an object of class {class}"))));
    }
    let sizes = at.of_kind(&[5])?;
    let sizes: Option<Vec<usize>> = (0..sizes.len()).map(|i| usize::try_from(sizes.at(i) as i64).ok()).collect();
    let sizes = sizes?;
    let name = at.name()?;
    let count = sizes.iter().try_fold(1usize, |n, size| n.checked_mul(*size))?;
    let value = match class {
        2 | 3 if count != 1 => Value::Other(format!("an array of {count} structures")),
        2 | 3 if deepest == 0 => Value::Other("a structure nested too deeply".into()),
        2 | 3 => {
            if class == 3 {
                at.name()?;
            }
            fields(&mut at, deepest)?
        }
        4 => match (sizes.first(), at.element()) {
            (Some(1), Some((kind, bytes))) => Value::Text(text(Raw { kind, bytes, little })),
            _ => Value::Other("text of several lines, or none".into()),
        },
        6..=15 => {
            let mut part = || at.of_kind(&[1, 2, 3, 4, 5, 6, 7, 9, 12, 13]).filter(|raw| raw.len() == count);
            let re = part()?;
            let im = if complex { Some(part()?) } else { None };
            Value::Numbers(Numbers { sizes, re, im })
        }
        1 => Value::Other("a cell array".into()),
        5 => Value::Other("a sparse matrix".into()),
        16 => Value::Other("a function".into()),
        _ => Value::Other(format!("an array of class {class}")),
    };
    Some((name, value))
}

fn fields<'a>(at: &mut Cursor<'a>, deepest: usize) -> Option<Value<'a>> {
    let width = at.of_kind(&[5]).filter(|raw| raw.len() == 1)?.at(0) as usize;
    let names = at.of_kind(&[1, 2])?.bytes;
    if width == 0 {
        return names.is_empty().then_some(Value::Fields(Vec::new()));
    }
    let each = names.chunks(width).map(|name| {
        let (kind, inside) = at.element()?;
        let (_, value) = if kind == MATRIX { matrix(inside, at.little, deepest - 1)? } else { return None };
        Some((until_zero(name), value))
    });
    each.collect::<Option<Vec<_>>>().map(Value::Fields)
}

/// Longest text that is looked at (characters): units are short.
const LONGEST: usize = 1000;

fn text(raw: Raw<'_>) -> String {
    match raw.kind {
        1 | 2 | 16 => String::from_utf8_lossy(&raw.bytes[..raw.bytes.len().min(LONGEST)]).into_owned(),
        _ => (0..raw.len().min(LONGEST)).filter_map(|i| char::from_u32(raw.at(i) as u32)).collect(),
    }
}

impl Raw<'_> {
    fn width(&self) -> usize {
        match self.kind {
            1 | 2 | 16 => 1,
            3 | 4 | 17 => 2,
            5 | 6 | 7 | 18 => 4,
            _ => 8,
        }
    }

    /// How many numbers there are.
    pub fn len(&self) -> usize {
        self.bytes.len() / self.width()
    }

    /// The number at a place; NaN outside.
    pub fn at(&self, index: usize) -> f64 {
        let width = self.width();
        let Some(found) = self.bytes.get(index * width..(index + 1) * width) else { return f64::NAN };
        let mut word = [0u8; 8];
        for (place, byte) in word.iter_mut().zip(found) {
            *place = *byte;
        }
        if !self.little {
            word[..width].reverse();
        }
        let whole = u64::from_le_bytes(word);
        match self.kind {
            1 => f64::from(whole as u8 as i8),
            3 => f64::from(whole as u16 as i16),
            5 => f64::from(whole as u32 as i32),
            7 => f64::from(f32::from_bits(whole as u32)),
            9 => f64::from_bits(whole),
            12 => whole as i64 as f64,
            _ => whole as f64,
        }
    }
}

impl Numbers<'_> {
    /// How many there are.
    pub fn len(&self) -> usize {
        self.re.len()
    }

    /// Whether at most one size is above 1.
    pub fn is_vector(&self) -> bool {
        self.sizes.iter().filter(|size| **size != 1).count() <= 1
    }

    /// Sizes and kind, as MATLAB's `whos` shows them.
    pub fn shape(&self) -> String {
        let sizes: Vec<String> = self.sizes.iter().map(usize::to_string).collect();
        format!("{}{}", sizes.join("x"), if self.im.is_some() { " complex" } else { "" })
    }
}
