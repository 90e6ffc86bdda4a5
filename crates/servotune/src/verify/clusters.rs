//! Neighbouring cells that may hold a crossing, as one crossing each.

use super::Interval;
use super::bounds::ProvenCrossing;

/// Crossings met from low to high angles.
#[derive(Clone, Debug, Default)]
pub(super) struct Clusters {
    done: Vec<ProvenCrossing>,
    now: Option<ProvenCrossing>,
    /// Side of the level before the cluster.
    side: Option<bool>,
}

impl Clusters {
    /// A cell that may hold a crossing.
    pub fn inside(&mut self, angle: Interval, value: Interval, certain: bool) {
        self.now = Some(match self.now {
            None => ProvenCrossing { hz: angle, value, certain },
            Some(c) => {
                ProvenCrossing { hz: c.hz.hull(angle), value: c.value.hull(value), certain: c.certain || certain }
            }
        });
    }

    /// A cell that holds none and lies on one side.
    pub fn outside(&mut self, side: bool) {
        if let Some(mut c) = self.now.take() {
            // From one side to the other there is a crossing somewhere in between.
            c.certain |= self.side.is_some_and(|s| s != side);
            self.done.push(c);
        }
        self.side = Some(side);
    }

    /// All of them, angles and values turned into other units.
    pub fn list(&mut self, hz: impl Fn(f64) -> f64, unit: impl Fn(Interval) -> Interval) -> Vec<ProvenCrossing> {
        self.done.extend(self.now.take());
        let turned = |c: &ProvenCrossing| ProvenCrossing {
            hz: Interval { low: hz(c.hz.low), high: hz(c.hz.high) },
            value: unit(c.value),
            certain: c.certain,
        };
        self.done.iter().map(turned).collect()
    }
}
