//! The reference of a spiral write: rest, constant acceleration, constant speed, constant deceleration, rest.

use super::Spiral;

/// The reference as a function of time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    start_s: f64,
    /// Time at acceleration, the same at deceleration (s).
    ramp_s: f64,
    /// Time at full speed (s).
    cruise_s: f64,
    /// Signed acceleration (position_unit/s²).
    acceleration: f64,
}

impl Reference {
    /// The reference of a checked spiral. A move too short for the full speed turns back at the speed it reaches.
    pub fn of(s: &Spiral) -> Reference {
        let speed = s.velocity.abs();
        let acceleration = speed / s.acceleration_time_s;
        let full = s.distance >= speed * s.acceleration_time_s;
        let (ramp_s, cruise_s) = if full {
            (s.acceleration_time_s, s.distance / speed - s.acceleration_time_s)
        } else {
            ((s.distance / acceleration).sqrt(), 0.0)
        };
        Reference { start_s: s.start_s, ramp_s, cruise_s, acceleration: acceleration.copysign(s.velocity) }
    }

    /// When the move ends (s).
    pub fn end_s(&self) -> f64 {
        self.start_s + 2.0 * self.ramp_s + self.cruise_s
    }

    /// Position at time `t` (position_unit).
    pub fn at(&self, t: f64) -> f64 {
        let since = t - self.start_s;
        if since <= 0.0 {
            return 0.0;
        }
        let (ramp, a) = (self.ramp_s, self.acceleration);
        if since <= ramp {
            0.5 * a * since * since
        } else if since <= ramp + self.cruise_s {
            a * ramp * (since - 0.5 * ramp)
        } else {
            let left = (2.0 * ramp + self.cruise_s - since).max(0.0);
            a * ramp * (ramp + self.cruise_s) - 0.5 * a * left * left
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spiral(distance: f64, velocity: f64) -> Spiral {
        Spiral { velocity, distance, acceleration_time_s: 2e-3, start_s: 8e-3, duration_s: 0.06 }
    }

    #[test]
    fn the_move_ends_at_its_distance_and_runs_at_its_speed() {
        for v in [350.0, -350.0] {
            let r = Reference::of(&spiral(15.0, v));
            // Rounding of sums of order 15.
            assert!((r.at(r.end_s()) - 15.0 * v.signum()).abs() < 1e-12);
            assert!(((r.at(0.03) - r.at(0.02)) / 0.01 - v).abs() < 1e-9);
            assert_eq!(r.at(8e-3), 0.0);
            assert!((r.end_s() - (8e-3 + 15.0 / 350.0 + 2e-3)).abs() < 1e-15);
        }
    }

    #[test]
    fn a_short_move_never_reaches_full_speed() {
        let r = Reference::of(&spiral(0.1, 350.0));
        assert!((r.at(1.0) - 0.1).abs() < 1e-15);
        let half = 0.5 * (r.end_s() + 8e-3);
        assert!((r.at(half) - 0.05).abs() < 1e-15);
    }
}
