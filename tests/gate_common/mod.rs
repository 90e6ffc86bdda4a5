//! Tables of made-up machines for the tests of the gate: classes and unknown kinds that differ in many features.
#![allow(clippy::unwrap_used, dead_code)]

use servotune::numeric::random::Random;
use std::path::PathBuf;

/// A world of machines: which features each class and each unknown kind moves.
pub struct World {
    features: usize,
    class: Vec<Vec<f64>>,
    kind: Vec<Vec<f64>>,
    mix: Vec<f64>,
}

const COMMON: usize = 4;

impl World {
    /// Every class moves a third of the features by about `shift` deviations; five unknown kinds move a fifth by three.
    pub fn new(seed: u64, features: usize, classes: usize, shift: f64) -> World {
        let mut random = Random::new(seed);
        let mut moved = |share: f64, by: f64| -> Vec<f64> {
            (0..features).map(|_| if random.uniform() < share { by * random.normal() } else { 0.0 }).collect()
        };
        let class = (0..classes).map(|k| if k == 0 { vec![0.0; features] } else { moved(0.33, shift) }).collect();
        let kind = (0..5usize)
            .map(|k| (0..features).map(|j| [0.0, 3.0, -3.0][if (j + k) % 5 == 0 { 1 + j % 2 } else { 0 }]).collect())
            .collect();
        let mix = (0..features * COMMON).map(|_| 0.4 * random.normal()).collect();
        World { features, class, kind, mix }
    }

    /// One machine: amplitudes (positive, skewed) and plain numbers in turn, with common causes.
    pub fn machine(&self, class: usize, kind: Option<usize>, random: &mut Random) -> Vec<f64> {
        let cause: Vec<f64> = (0..COMMON).map(|_| random.normal()).collect();
        (0..self.features)
            .map(|j| {
                let common: f64 = cause.iter().zip(&self.mix[j * COMMON..]).map(|(c, m)| c * m).sum();
                let z = self.class[class][j] + kind.map_or(0.0, |k| self.kind[k][j]) + common + 0.7 * random.normal();
                if j % 2 == 0 { (0.4 * z).exp() } else { z }
            })
            .collect()
    }

    /// The plant's three columns for a class, at the paper's places.
    pub fn plant(class: usize, random: &mut Random) -> [f64; 3] {
        let [gain, resonance, crossover] =
            [[37.5, 1230.0, 540.0], [38.4, 1230.0, 600.0], [37.5, 665.0, 540.0], [36.1, 1110.0, 470.0]][class % 4];
        [
            gain + 0.15 * random.normal(),
            resonance * (0.01 * random.normal()).exp(),
            crossover * (0.01 * random.normal()).exp(),
        ]
    }

    /// A table as text; `rows` gives class and unknown kind of each row, `label` the text of a class.
    pub fn csv(
        &self,
        rows: &[(usize, Option<usize>)],
        label: impl Fn(usize) -> String,
        plant: bool,
        seed: u64,
    ) -> String {
        let mut random = Random::new(seed);
        let mut text = "id,label".to_owned();
        (0..self.features).for_each(|j| text += &format!(",f{j}"));
        if plant {
            text += ",plant_dc_gain_db,plant_first_resonance_hz,plant_crossover_hz";
        }
        text.push('\n');
        for (i, &(class, kind)) in rows.iter().enumerate() {
            text += &format!("m{i},{}", label(class));
            self.machine(class, kind, &mut random).iter().for_each(|v| text += &format!(",{v}"));
            if plant {
                World::plant(class, &mut random).iter().for_each(|v| text += &format!(",{v}"));
            }
            text.push('\n');
        }
        text
    }
}

/// Rows of known classes, `counts` of each.
pub fn known(counts: &[usize]) -> Vec<(usize, Option<usize>)> {
    counts.iter().enumerate().flat_map(|(c, &n)| std::iter::repeat_n((c, None), n)).collect()
}

/// An empty folder of this test's own.
pub fn folder(name: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}
