//! The features of one machine, each with its name.

/// Names and values in a fixed order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    names: Vec<String>,
    values: Vec<f64>,
}

impl Row {
    /// Adds a feature. What is not finite is missing.
    pub(super) fn push(&mut self, name: impl Into<String>, value: f64) {
        self.names.push(name.into());
        self.values.push(if value.is_finite() { value } else { f64::NAN });
    }

    /// The names.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The values; NaN is missing.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// The value of a name; NaN where it is missing or there is no such name.
    pub fn get(&self, name: &str) -> f64 {
        self.names.iter().position(|n| n == name).map_or(f64::NAN, |i| self.values[i])
    }
}
