//! What a header word says about its column.
//!
//! In: one header cell. Out: [`Meaning`]. Spec: `specs/frf.md`, "Header words".

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    Frequency,
    Magnitude,
    Phase,
    Real,
    Imaginary,
    Std,
    Coherence,
    Other,
}

/// A unit that the cell names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unit {
    Hertz,
    Kilohertz,
    RadPerSec,
    Decibels,
    Linear,
    Degrees,
    Radians,
    Relative,
    Percent,
}

/// Role, unit and convention of one column.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Meaning {
    pub name: String,
    pub role: Role,
    pub unit: Option<Unit>,
    /// The cell calls its phase a margin.
    pub margin: bool,
}

impl Role {
    /// The role in words, for messages.
    pub(crate) fn words(self) -> &'static str {
        match self {
            Role::Frequency => "frequency",
            Role::Magnitude => "magnitude",
            Role::Phase => "phase",
            Role::Real => "real part",
            Role::Imaginary => "imaginary part",
            Role::Std => "standard deviation",
            Role::Coherence => "coherence",
            Role::Other => "other",
        }
    }
}

/// The meaning of a header cell.
pub(crate) fn meaning(cell: &str) -> Meaning {
    let name = cell.trim().to_owned();
    let lower = name.to_lowercase();
    let words: Vec<&str> =
        lower.split(|c: char| !c.is_alphanumeric() && c != '%' && c != '°').filter(|w| !w.is_empty()).collect();
    let has = |list: &[&str]| words.iter().any(|w| list.contains(w));
    let starts = |list: &[&str]| words.iter().any(|w| list.iter().any(|p| w.starts_with(p)));
    let pair = |a: &[&str], b: &[&str]| words.windows(2).any(|w| a.contains(&w[0]) && b.contains(&w[1]));
    let rad_per_s = pair(&["rad", "radians", "rads"], &["s", "sec", "second", "seconds", "per"])
        || has(&["rads", "radps", "radpersec", "omega", "ω"]);
    let decibels = has(&["db", "decibel", "decibels", "dbmag"]);
    let degrees = has(&["deg", "degs", "degree", "degrees", "°"]) || lower.contains('°');
    let role = if starts(&["std", "stdev", "sigma", "deviation", "uncert"]) {
        Role::Std
    } else if starts(&["coher", "gamma"]) || has(&["coh", "γ"]) {
        Role::Coherence
    } else if starts(&["phase", "phi", "angle"]) || has(&["arg", "ph", "pha", "φ", "∠"]) {
        Role::Phase
    } else if has(&["re", "real", "realpart"]) {
        Role::Real
    } else if has(&["im", "imag", "imaginary", "imagpart"]) {
        Role::Imaginary
    } else if starts(&["mag", "gain", "ampl", "modul", "betrag"])
        || has(&["abs", "amp", "ratio"])
        || lower.starts_with('|')
    {
        Role::Magnitude
    } else if starts(&["freq"]) || has(&["f", "hz", "khz", "omega", "ω"]) || (rad_per_s && !decibels) || words == ["w"]
    {
        Role::Frequency
    } else if decibels {
        Role::Magnitude
    } else if degrees {
        Role::Phase
    } else {
        Role::Other
    };
    let per_unit = lower.contains('/') || lower.contains("_per_");
    let unit = match role {
        Role::Frequency if rad_per_s => Some(Unit::RadPerSec),
        Role::Frequency if has(&["khz"]) => Some(Unit::Kilohertz),
        Role::Frequency if has(&["hz", "hertz"]) => Some(Unit::Hertz),
        Role::Magnitude | Role::Std if decibels => Some(Unit::Decibels),
        Role::Std if has(&["%", "percent"]) => Some(Unit::Percent),
        Role::Std if starts(&["rel"]) => Some(Unit::Relative),
        Role::Magnitude if has(&["abs", "lin", "linear", "ratio"]) || per_unit => Some(Unit::Linear),
        Role::Phase if degrees => Some(Unit::Degrees),
        Role::Phase if has(&["rad", "rads", "radian", "radians"]) => Some(Unit::Radians),
        _ => None,
    };
    let margin = role == Role::Phase && starts(&["margin"]);
    Meaning { name, role, unit, margin }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn common_headers_are_understood() {
        let cases = [
            ("Frequency (Hz)", Role::Frequency, Some(Unit::Hertz)),
            ("Freq [kHz]", Role::Frequency, Some(Unit::Kilohertz)),
            ("w (rad/s)", Role::Frequency, Some(Unit::RadPerSec)),
            ("frequency_rad_s", Role::Frequency, Some(Unit::RadPerSec)),
            ("f_Hz", Role::Frequency, Some(Unit::Hertz)),
            ("Magnitude (dB)", Role::Magnitude, Some(Unit::Decibels)),
            ("Magnitude (abs)", Role::Magnitude, Some(Unit::Linear)),
            ("gain", Role::Magnitude, None),
            ("Phase (deg)", Role::Phase, Some(Unit::Degrees)),
            ("phase_rad", Role::Phase, Some(Unit::Radians)),
            ("Phase [°]", Role::Phase, Some(Unit::Degrees)),
            ("G11_re_um_per_V", Role::Real, None),
            ("Imag(H)", Role::Imaginary, None),
            ("G11_total_std", Role::Std, None),
            ("coherence", Role::Coherence, None),
            ("|G| (track/V)", Role::Magnitude, Some(Unit::Linear)),
            ("temperature", Role::Other, None),
        ];
        for (cell, role, unit) in cases {
            let found = meaning(cell);
            assert_eq!((found.role, found.unit), (role, unit), "{cell}");
        }
        assert!(meaning("Phase margin (deg)").margin);
    }
}
