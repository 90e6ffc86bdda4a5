//! Answers with the rules that were consulted for them: what a verdict says it was decided by.
//!
//! In: a value and a rule of the table. Out: yes or no, and the list. Convention: of `a & b` the second is consulted only where the first says yes,
//! of `a | b` only where it says no.

use std::ops::{BitAnd, BitOr, Not};

/// A rule that was consulted.
#[derive(Clone, Debug, PartialEq)]
pub struct Consulted {
    /// Its name in the table of rules.
    pub rule: &'static str,
    /// The value of its statistic, in the rule's unit; none where it is not at hand.
    pub value: Option<f64>,
    /// Whether the value lies on the side of the threshold that the rule speaks of.
    pub met: bool,
}

/// Yes or no, with the rules that it took.
#[derive(Clone, Debug)]
pub(in crate::diagnose) struct Answer {
    pub yes: bool,
    pub consulted: Vec<Consulted>,
}

impl Answer {
    /// The answer by one rule.
    pub fn by(rule: &'static str, value: impl Into<Option<f64>>, met: bool) -> Answer {
        Answer { yes: met, consulted: vec![Consulted { rule, value: value.into(), met }] }
    }

    /// The same list under this answer.
    fn then(mut self, next: Answer) -> Answer {
        self.consulted.extend(next.consulted);
        Answer { yes: next.yes, ..self }
    }
}

impl From<bool> for Answer {
    fn from(yes: bool) -> Answer {
        Answer { yes, consulted: Vec::new() }
    }
}

impl BitAnd for Answer {
    type Output = Answer;
    fn bitand(self, other: Answer) -> Answer {
        if self.yes { self.then(other) } else { self }
    }
}

impl BitOr for Answer {
    type Output = Answer;
    fn bitor(self, other: Answer) -> Answer {
        if self.yes { self } else { self.then(other) }
    }
}

impl Not for Answer {
    type Output = Answer;
    fn not(self) -> Answer {
        Answer { yes: !self.yes, ..self }
    }
}

/// An answer by a rule: a value against its threshold, or a value and whether it meets the rule.
macro_rules! asked {
    ($value:expr, < $rule:ident) => {
        $crate::diagnose::rules::Answer::by(stringify!($rule), $value, $value < $rule)
    };
    ($value:expr, > $rule:ident) => {
        $crate::diagnose::rules::Answer::by(stringify!($rule), $value, $value > $rule)
    };
    ($value:expr, >= $rule:ident) => {
        $crate::diagnose::rules::Answer::by(stringify!($rule), $value, $value >= $rule)
    };
    ($value:expr, $rule:ident: $met:expr) => {{
        // A name that is no rule does not compile.
        let _ = $rule;
        $crate::diagnose::rules::Answer::by(stringify!($rule), $value, $met)
    }};
}
pub(in crate::diagnose) use asked;
