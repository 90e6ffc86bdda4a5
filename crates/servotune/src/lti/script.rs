//! The part of MATLAB's and Python's text in which plants are written: assignments of numbers, matrices and `tf`, `zpk`, `ss`.
//!
//! In: text. Out: the names assigned, in order. Nothing is run: what is not a number, a matrix or one of these calls is refused with its place.
//! Spec: `specs/files.md`, "Plants of other programs".

use super::script_words::{Language, Misread};
use super::script_words::{Place, Token, tokens};
use nalgebra::Complex;

/// A value.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Cell {
    Number(Complex<f64>),
    /// A row, or rows.
    List(Vec<Cell>),
    Text(String),
    Model(Call),
}

/// A call of `tf`, `zpk` or `ss`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Call {
    pub form: &'static str,
    pub given: Vec<Cell>,
    /// `'InputDelay', 1e-4` or `dt=0.1`.
    pub named: Vec<(String, Cell)>,
}

/// Deepest nesting of brackets.
const DEEPEST: usize = 24;

/// Most assignments: a plant needs ten.
const MOST: usize = 500;

/// The names that the text assigns, each with its value.
pub(super) fn names(text: &str, language: Language) -> Result<Vec<(String, Cell)>, Misread> {
    let tokens = tokens(text, language)?;
    let mut reader = Reader { tokens: &tokens, at: 0, language, names: Vec::new(), depth: 0, row: false, inside: 0 };
    reader.all()?;
    Ok(reader.names)
}

struct Reader<'a> {
    tokens: &'a [(Token, Place)],
    at: usize,
    language: Language,
    names: Vec<(String, Cell)>,
    depth: usize,
    /// Inside a MATLAB row, where a blank separates.
    row: bool,
    /// Open square brackets.
    inside: usize,
}

impl Reader<'_> {
    fn token(&self) -> &Token {
        self.tokens.get(self.at).map_or(&Token::End, |t| &t.0)
    }

    fn refuse<T>(&self, expected: &'static str) -> Result<T, Misread> {
        let (token, place) = &self.tokens[self.at.min(self.tokens.len() - 1)];
        Err(Misread { place: *place, found: token.to_string(), expected })
    }

    fn sign(&mut self, sign: &str) -> bool {
        let found = matches!(self.token(), Token::Sign(s) if *s == sign);
        self.at += usize::from(found);
        found
    }

    fn all(&mut self) -> Result<(), Misread> {
        loop {
            while matches!(self.token(), Token::Line) || self.sign(";") || self.sign(",") {
                self.at += usize::from(matches!(self.token(), Token::Line));
            }
            let name = match self.token() {
                Token::End => return Ok(()),
                Token::Name(name) => name.clone(),
                _ => return self.refuse("an assignment, such as P = tf(num, den)"),
            };
            self.at += 1;
            if !self.sign("=") {
                self.at -= 1;
                return self.refuse("an assignment, such as P = tf(num, den); nothing else is run");
            }
            let value = self.sum()?;
            self.names.push((name, value));
            if self.names.len() > MOST {
                return self.refuse("500 assignments at most");
            }
            if !matches!(self.token(), Token::Line | Token::End | Token::Sign(";" | ",")) {
                return self.refuse("the end of the assignment");
            }
        }
    }

    /// Whether a sign here joins two terms: in a MATLAB row `1 -2` are two numbers, `1 - 2` and `1-2` one.
    fn joins(&self, sign: &str) -> bool {
        let Some((Token::Sign(s), place)) = self.tokens.get(self.at) else { return false };
        *s == sign && !(self.row && place.blank_before && !place.blank_behind)
    }

    fn sum(&mut self) -> Result<Cell, Misread> {
        let mut left = self.product()?;
        loop {
            let sign = if self.joins("+") {
                1.0
            } else if self.joins("-") {
                -1.0
            } else {
                return Ok(left);
            };
            self.at += 1;
            let right = self.product()?;
            left = self.both(left, right, |a, b| a + sign * b)?;
        }
    }

    fn product(&mut self) -> Result<Cell, Misread> {
        let mut left = self.factor()?;
        loop {
            if self.sign("*") {
                let right = self.factor()?;
                left = self.both(left, right, |a, b| a * b)?;
            } else if self.sign("/") {
                let right = self.factor()?;
                left = self.both(left, right, |a, b| a / b)?;
            } else {
                return Ok(left);
            }
        }
    }

    fn both(
        &self,
        left: Cell,
        right: Cell,
        by: impl Fn(Complex<f64>, Complex<f64>) -> Complex<f64> + Copy,
    ) -> Result<Cell, Misread> {
        match (left, right) {
            (Cell::Number(a), Cell::Number(b)) => Ok(Cell::Number(by(a, b))),
            (Cell::List(all), Cell::Number(b)) => {
                let each = all.into_iter().map(|a| self.both(a, Cell::Number(b), by));
                each.collect::<Result<_, _>>().map(Cell::List)
            }
            (Cell::Number(a), Cell::List(all)) => {
                let each = all.into_iter().map(|b| self.both(Cell::Number(a), b, by));
                each.collect::<Result<_, _>>().map(Cell::List)
            }
            _ => self.refuse("numbers on both sides of a sign"),
        }
    }

    fn factor(&mut self) -> Result<Cell, Misread> {
        let mut sign = 1.0;
        while matches!(self.token(), Token::Sign("+" | "-")) {
            sign = if self.sign("-") { -sign } else { sign };
            self.sign("+");
        }
        let value = self.power()?;
        if sign > 0.0 {
            return Ok(value);
        }
        self.both(Cell::Number(Complex::new(-1.0, 0.0)), value, |a, b| a * b)
    }

    fn power(&mut self) -> Result<Cell, Misread> {
        let mut value = self.atom()?;
        while self.sign("'") {
            value = transposed(value);
        }
        if self.sign("^") {
            // 2^-3 as well; a tower of powers is nobody's plant.
            let less = self.sign("-");
            let power = self.atom()?;
            let power =
                if less { self.both(Cell::Number(Complex::new(-1.0, 0.0)), power, |a, b| a * b)? } else { power };
            return self.both(value, power, |a, b| if b.im == 0.0 { a.powf(b.re) } else { a.powc(b) });
        }
        Ok(value)
    }

    fn atom(&mut self) -> Result<Cell, Misread> {
        let token = self.token().clone();
        match token {
            Token::Number(x) => {
                self.at += 1;
                Ok(Cell::Number(x))
            }
            Token::Text(text) => {
                self.at += 1;
                Ok(Cell::Text(text))
            }
            Token::Sign("(") => {
                let row = std::mem::replace(&mut self.row, false);
                self.inward()?;
                let value = self.sum()?;
                self.row = row;
                self.depth -= 1;
                if self.sign(")") { Ok(value) } else { self.refuse("a closing bracket `)`") }
            }
            Token::Sign("[") => self.matrix(),
            Token::Name(name) => self.named(&name),
            _ => self.refuse("a number, a matrix in [ ], or tf(...), zpk(...), ss(...)"),
        }
    }

    /// One step past an opening bracket, and one level down.
    fn inward(&mut self) -> Result<(), Misread> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return self.refuse("fewer brackets within brackets");
        }
        self.at += 1;
        Ok(())
    }

    fn matrix(&mut self) -> Result<Cell, Misread> {
        let before = std::mem::replace(&mut self.row, self.language == Language::Matlab);
        self.inward()?;
        self.inside += 1;
        let (mut rows, mut row) = (Vec::new(), Vec::new());
        let mut several = false;
        loop {
            match self.token() {
                Token::Sign("]") => break,
                Token::Sign(",") => self.at += 1,
                Token::Line if self.language == Language::Python => self.at += 1,
                Token::Sign(";") | Token::Line => {
                    self.at += 1;
                    if !row.is_empty() {
                        rows.push(Cell::List(std::mem::take(&mut row)));
                        several = true;
                    }
                }
                Token::End => return self.refuse("a closing bracket `]`"),
                _ => {
                    row.push(self.sum()?);
                    let end = matches!(self.token(), Token::Sign("," | "]" | ";") | Token::Line);
                    if self.language == Language::Python && !end {
                        return self.refuse("a comma or `]`");
                    }
                }
            }
        }
        self.at += 1;
        self.row = before;
        self.depth -= 1;
        self.inside -= 1;
        if !several {
            return Ok(Cell::List(row));
        }
        if !row.is_empty() {
            rows.push(Cell::List(row));
        }
        Ok(Cell::List(rows))
    }

    /// A name: a value given above, `pi`, or a call.
    fn named(&mut self, name: &str) -> Result<Cell, Misread> {
        let last = name.rsplit('.').next().unwrap_or_default();
        let call = matches!(self.tokens.get(self.at + 1), Some((Token::Sign("("), place)) if !place.blank_before);
        if let Some((_, value)) = self.names.iter().rev().find(|(n, _)| n == name).filter(|_| !call) {
            // Lists within lists of lists would grow without end.
            if self.inside > 0 && !matches!(value, Cell::Number(_)) {
                return self.refuse("a number: within [ ] a name stands for one number only");
            }
            self.at += 1;
            return Ok(value.clone());
        }
        if last == "pi" && !call {
            self.at += 1;
            return Ok(Cell::Number(Complex::new(std::f64::consts::PI, 0.0)));
        }
        let form = match last {
            "tf" | "TransferFunction" => "tf",
            "zpk" => "zpk",
            "ss" | "StateSpace" => "ss",
            // What only wraps a matrix.
            "array" | "matrix" | "asarray" | "double" => "",
            _ => return self.refuse("a name given above, pi, or tf(...), zpk(...), ss(...)"),
        };
        if !call {
            return self.refuse("`(` behind this name");
        }
        self.at += 1;
        let row = std::mem::replace(&mut self.row, false);
        self.inward()?;
        let (mut given, mut named) = (Vec::new(), Vec::new());
        while !self.sign(")") {
            match (self.token().clone(), self.tokens.get(self.at + 1)) {
                (Token::Line | Token::Sign(","), _) => {
                    self.at += 1;
                    continue;
                }
                (Token::Name(key), Some((Token::Sign("="), _))) => {
                    self.at += 2;
                    named.push((key, self.sum()?));
                }
                _ => match self.sum()? {
                    Cell::Text(key) if !given.is_empty() => {
                        if !self.sign(",") {
                            return self.refuse("a comma and a value behind this word");
                        }
                        named.push((key, self.sum()?));
                    }
                    value => given.push(value),
                },
            }
            if !matches!(self.token(), Token::Line | Token::Sign("," | ")")) {
                return self.refuse("a comma or `)`");
            }
        }
        self.row = row;
        self.depth -= 1;
        match (form, given.len()) {
            ("", 1) => Ok(given.swap_remove(0)),
            ("", _) => self.refuse("one matrix between the brackets before"),
            _ => Ok(Cell::Model(Call { form, given, named })),
        }
    }
}

/// Rows for columns; the conjugate of MATLAB's `'` changes no list that holds its conjugates.
fn transposed(cell: Cell) -> Cell {
    let Cell::List(rows) = cell else { return cell };
    let lists: Option<Vec<&Vec<Cell>>> =
        rows.iter().map(|r| if let Cell::List(r) = r { Some(r) } else { None }).collect();
    match lists {
        None => Cell::List(rows.into_iter().map(|x| Cell::List(vec![x])).collect()),
        Some(lists) => {
            let width = lists.iter().map(|r| r.len()).max().unwrap_or(0);
            let column = |j: usize| Cell::List(lists.iter().filter_map(|r| r.get(j).cloned()).collect());
            Cell::List((0..width).map(column).collect())
        }
    }
}
