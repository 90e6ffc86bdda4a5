//! The kinds of machines that no class knows.

/// The kinds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum UnknownKind {
    /// One half of the power stage has failed: half the gain, and its bandwidth has become a lag.
    Amplifier,
    /// The arm is cracked: two new modes with poles far from their zeros.
    CrackedArm,
    /// The base shakes: lines that are no multiples of the spindle, and strong windage.
    Vibration,
    /// The servo clock is off, and the record has lost samples.
    Clock,
    /// The bearing sticks: three times the stiffness at low frequency, more damping.
    StuckBearing,
}

impl UnknownKind {
    /// All kinds.
    pub const ALL: [UnknownKind; 5] = [
        UnknownKind::Amplifier,
        UnknownKind::CrackedArm,
        UnknownKind::Vibration,
        UnknownKind::Clock,
        UnknownKind::StuckBearing,
    ];

    /// The kind in one word.
    pub fn name(self) -> &'static str {
        match self {
            UnknownKind::Amplifier => "amplifier",
            UnknownKind::CrackedArm => "cracked_arm",
            UnknownKind::Vibration => "vibration",
            UnknownKind::Clock => "clock",
            UnknownKind::StuckBearing => "stuck_bearing",
        }
    }

    /// The kind of a word.
    pub fn named(word: &str) -> Option<UnknownKind> {
        UnknownKind::ALL.into_iter().find(|k| k.name() == word)
    }
}
