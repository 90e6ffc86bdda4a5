//! A machine of another make: laws that the library does not hold in this form, stepped by the midpoint rule.
//!
//! In: what acts, a controller's numbers, reference and excitation. Out: a record as a logger would write it. Nothing of `physics` or `lti` is
//! used: what a diagnosis finds here, it finds in a machine that it does not know.

use servotune::numeric::random::Random;

/// Sample time (s).
pub(super) const T: f64 = 39.6e-6;
/// Steps of the integrator a sample.
const STEPS: usize = 40;
const H: f64 = T / STEPS as f64;
/// Sliders of the bearing.
const SLIDERS: usize = 12;

/// A second mass behind a joint with play: springs on both sides of the gap, damped while they touch.
#[derive(Clone, Copy)]
pub(super) struct Joint {
    pub gap: f64,
    /// Frequency of the two masses in contact (Hz).
    pub contact_hz: f64,
    /// Share of the inertia behind the joint.
    pub share: f64,
    /// Whether the encoder sits behind the joint.
    pub behind: bool,
}

/// What acts. Torques are in command units; 0 and infinity are absent.
#[derive(Clone, Copy)]
pub(super) struct Foreign {
    /// Gain (position/s² per command), stiffness (1/s²), viscous rate (1/s).
    pub body: [f64; 3],
    /// Delay in steps of the integrator.
    pub delay: usize,
    /// Level and deflection of the bristles (LuGre: dz/dt = v - |v| z/length).
    pub bristles: [f64; 2],
    /// Level and sliding length of a bearing of parallel sliders whose levels fall off.
    pub bearing: [f64; 2],
    /// Half width of the dead band, rounded at its ends.
    pub dead_band: f64,
    /// Limit that the amplifier comes to softly.
    pub limit: f64,
    /// Torque noise: rms and corner (Hz).
    pub wind: [f64; 2],
    /// Amplitude and frequency of a run-out (Hz).
    pub runout: [f64; 2],
    /// Amplitude and period of the encoder's cyclic error.
    pub cyclic: [f64; 2],
    /// Step of the encoder's count.
    pub lattice: f64,
    pub joint: Option<Joint>,
    /// A detent: torque, place, width; a bump of Gauss.
    pub detent: [f64; 3],
    /// A drag in one direction alone: its level at speed, and the speed over which it comes.
    pub one_sided: [f64; 2],
    /// Share by which the amplifier is weaker for negative commands.
    pub lopsided: f64,
    /// A push: time, width (s), peak.
    pub push: [f64; 3],
    /// White noise of the encoder, rms.
    pub noise: f64,
}

/// A machine with nothing beside its linear part.
pub(super) const SOUND: Foreign = Foreign {
    body: [75.0 * 369.0 * 369.0, 369.0 * 369.0, 2.0 * 0.22 * 369.0],
    delay: 66,
    bristles: [0.0, 1.0],
    bearing: [0.0, 1.0],
    dead_band: 0.0,
    limit: f64::INFINITY,
    wind: [0.0, 1.0],
    runout: [0.0, 1.0],
    cyclic: [0.0, 1.0],
    lattice: 0.0,
    joint: None,
    detent: [0.0, 0.0, 1.0],
    one_sided: [0.0, 1.0],
    lopsided: 0.0,
    push: [0.0, 1.0, 0.0],
    noise: 0.003,
};

/// Proportional, integral and derivative gain, filter of the derivative (s).
pub(super) const GAINS: [f64; 4] = [0.27, 60.0, 3.7e-4, 12e-6];
/// Limit of the controller's output.
pub(super) const OUTPUT: f64 = 10.0;

/// Position, speed, position and speed behind the joint, bristles.
type State = [f64; 5];

impl Foreign {
    fn amplified(&self, u: f64) -> f64 {
        let u = if u < 0.0 { (1.0 - self.lopsided) * u } else { u };
        let u = if self.dead_band > 0.0 {
            // The ends are round over a twentieth of the band.
            let soft = |x: f64| 0.05 * self.dead_band * (x / (0.05 * self.dead_band)).min(500.0).exp().ln_1p();
            let over = |x: f64| if x > 25.0 * self.dead_band { x } else { soft(x) };
            u.signum() * (over(u.abs() - self.dead_band) - over(-self.dead_band - u.abs()))
        } else {
            u
        };
        if self.limit.is_finite() { u.signum() * self.limit * soft_limit(u.abs() / self.limit) } else { u }
    }

    /// Torques over place and speed that have no name.
    fn nameless(&self, x: f64, v: f64) -> f64 {
        let ([peak, place, width], [level, slow]) = (self.detent, self.one_sided);
        let bump = if peak == 0.0 { 0.0 } else { peak * (-0.5 * ((x - place) / width).powi(2)).exp() };
        let drag = if level == 0.0 || v <= 0.0 { 0.0 } else { level * (1.0 - (-v / slow).exp()) };
        bump - drag
    }

    /// Slope of the state under a command and a torque that stays over the step.
    fn slope(&self, s: &State, push: f64) -> State {
        let [b, k, c] = self.body;
        let [x, v, x2, v2, z] = *s;
        let [level, length] = self.bristles;
        let torque = push + self.nameless(x, v) - if level > 0.0 { level * z } else { 0.0 };
        let dz = if level > 0.0 { (v - v.abs() * z) / length } else { 0.0 };
        let Some(j) = self.joint else { return [v, b * torque - k * x - c * v, v, 0.0, dz] };
        // Two masses of shares 1 - s and s: w² = kc/(s (1 - s)) over the whole inertia.
        let wc = std::f64::consts::TAU * j.contact_hz;
        let stiff = wc * wc * j.share * (1.0 - j.share);
        let apart = x - x2;
        let over = if apart.abs() > 0.5 * j.gap { apart - 0.5 * j.gap * apart.signum() } else { 0.0 };
        let damp = if over == 0.0 { 0.0 } else { 0.05 * stiff / wc * (v - v2) };
        let force = stiff * over + damp;
        let front = (b * torque - k * x - 0.5 * c * v - force) / (1.0 - j.share);
        [v, front, v2, (force - 0.5 * c * v2) / j.share, dz]
    }

    fn step(&self, s: &State, push: f64) -> State {
        let moved = |d: &State, h: f64| -> State { std::array::from_fn(|i| s[i] + h * d[i]) };
        let half = moved(&self.slope(s, push), 0.5 * H);
        let mut next = moved(&self.slope(&half, push), H);
        next[4] = next[4].clamp(-1.0, 1.0);
        next
    }

    fn read(&self, s: &State, t: f64, noise: &mut Random) -> f64 {
        let x = match self.joint {
            Some(j) if j.behind => s[2],
            _ => s[0],
        };
        let tau = std::f64::consts::TAU;
        let y = x
            + self.runout[0] * (tau * self.runout[1] * t).cos()
            + self.cyclic[0] * (tau * x / self.cyclic[1]).sin()
            + self.noise * noise.normal();
        if self.lattice > 0.0 { self.lattice * (y / self.lattice).floor() } else { y }
    }

    /// Reference and excitation to command and position, in closed loop from rest. The seed draws noise and wind.
    pub fn record(&self, reference: &[f64], excitation: &[f64], seed: u64) -> [Vec<f64>; 2] {
        let (mut noise, mut wind) = (Random::stream(seed, 0), Random::stream(seed, 1));
        let mut sliders = Sliders::new(self.bearing);
        let [kp, ki, kd, filter] = GAINS;
        let (mut sum, mut rate, mut last) = (0.0, 0.0, 0.0);
        let mut s: State = [0.0; 5];
        let fall = (-std::f64::consts::TAU * self.wind[1] * T).exp();
        let mut blown = self.wind[0] * wind.normal();
        let (mut command, mut position, mut inputs) = (Vec::new(), Vec::new(), Vec::new());
        for (k, (r, x)) in reference.iter().zip(excitation).enumerate() {
            let y = self.read(&s, k as f64 * T, &mut noise);
            let e = r - y;
            sum += ki * T * e;
            rate = (filter * rate + kd * (e - last)) / (T + filter);
            last = e;
            let u = (kp * e + sum + rate).clamp(-OUTPUT, OUTPUT);
            command.push(u);
            position.push(y);
            inputs.push(self.amplified(u + x));
            for i in 0..STEPS {
                let at = k * STEPS + i;
                let held = at.checked_sub(self.delay).map_or(0.0, |at| inputs[at / STEPS]);
                let since = at as f64 * H - self.push[0];
                let pushed = if since > 0.0 && since < self.push[1] {
                    self.push[2] * (1.0 - (std::f64::consts::TAU * since / self.push[1]).cos()) * 0.5
                } else {
                    0.0
                };
                let before = s[0];
                s = self.step(&s, held + blown + pushed - sliders.torque());
                sliders.slide(s[0] - before);
            }
            blown = fall * blown + self.wind[0] * (1.0 - fall * fall).sqrt() * wind.normal();
        }
        [command, position]
    }
}

/// A limit that is met softly: x (1 + x¹²)^(-1/12).
fn soft_limit(x: f64) -> f64 {
    x / (1.0 + x.powi(12)).powf(1.0 / 12.0)
}

/// Parallel springs that slide, the weak ones early; one number stands for all that have not slid.
struct Sliders {
    stiffness: [f64; SLIDERS],
    level: [f64; SLIDERS],
    force: [f64; SLIDERS],
}

impl Sliders {
    fn new([level, length]: [f64; 2]) -> Sliders {
        // Slider i slides at (i + 1)² of the length, and its share falls as 1/(i + 1).
        let whole: f64 = (0..SLIDERS).map(|i| 1.0 / (i + 1) as f64).sum();
        let share = |i: usize| level / (i + 1) as f64 / whole;
        let at = |i: usize| length * ((i + 1) as f64 / SLIDERS as f64).powi(2);
        Sliders {
            stiffness: std::array::from_fn(|i| share(i) / at(i)),
            level: std::array::from_fn(share),
            force: [0.0; SLIDERS],
        }
    }

    fn torque(&self) -> f64 {
        self.force.iter().sum()
    }

    fn slide(&mut self, by: f64) {
        for i in 0..SLIDERS {
            self.force[i] = (self.force[i] + self.stiffness[i] * by).clamp(-self.level[i], self.level[i]);
        }
    }
}
