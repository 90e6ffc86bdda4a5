//! How far a diagnosis is: the step, its share of the work and the time left.
//!
//! Shares are those of a case with one finding; further findings take longer, and the time left says so as it goes. A further search, and one for a
//! curve, have shares and time of their own.

use std::time::Instant;

/// How steps begin, the longer of two before the shorter, and the share of the work that is done when they do.
const STEPS: [(&str, f64); 13] = [
    ("checking the logs", 0.0),
    ("is the command held", 0.02),
    ("refit of the linear", 0.05),
    ("bootstrap", 0.1),
    ("scan of", 0.15),
    ("refit with", 0.3),
    ("rivals of", 0.6),
    ("fit by simulation", 0.7),
    ("simulating all", 0.9),
    (CURVE, 0.0),
    ("a curve without a name: torque over position and", 0.95),
    ("a curve without a name: at every port", 0.05),
    ("a curve without a name: sensor", 0.5),
];

/// How a search begins that is made once more, and how one for a curve does.
pub(super) const AGAIN: &str = "the search again";
const CURVE: &str = "a curve without a name: the linear plant";

/// The clock of a diagnosis.
pub(super) struct Pace {
    began: Instant,
    share: f64,
}

impl Pace {
    pub fn new() -> Pace {
        Pace { began: Instant::now(), share: 0.0 }
    }

    /// The step with its share and the time left; no time before a tenth is done.
    ///
    /// A search that is made again, and one for a curve, begin anew.
    pub fn says(&mut self, step: &str) -> String {
        if step.starts_with(AGAIN) || step.starts_with(CURVE) {
            *self = Pace::new();
        }
        let own = STEPS.iter().find(|(begins, _)| step.starts_with(begins)).map_or(self.share, |s| s.1);
        self.share = self.share.max(own);
        let spent = self.began.elapsed().as_secs_f64();
        match self.share >= 0.1 {
            true => {
                let left = spent * (1.0 - self.share) / self.share;
                format!("{step} ({:.0} %, about {left:.0} s left)", 100.0 * self.share)
            }
            false => step.to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Pace;

    #[test]
    fn the_share_never_falls_and_the_step_comes_first() {
        let mut pace = Pace::new();
        assert_eq!(pace.says("checking the logs"), "checking the logs");
        assert!(pace.says("rivals of the findings").starts_with("rivals of the findings (60 %, about "));
        assert!(pace.says("scan of 25 effects for finding 2").contains("(60 %"));
        assert_eq!(pace.says("the search again, without a run-out"), "the search again, without a run-out");
        assert!(pace.says("scan of 25 effects for finding 1").contains("(15 %"));
        assert_eq!(
            pace.says("a curve without a name: the linear plant by simulation"),
            super::CURVE.to_owned() + " by simulation"
        );
        assert!(pace.says("a curve without a name: torque over position and velocity").contains("(95 %"));
    }
}
