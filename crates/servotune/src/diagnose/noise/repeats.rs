//! What repeats differ by: series that hold noise only, the levels that fit them and the filter that makes them white.
//!
//! In: errors record by record, each with the run it belongs to. Out: the same with starts, constant torques and the mean of a group taken out.

use super::whitening::{NoiseLevels, Whitener};
use crate::diagnose::data::run::Run;
use crate::diagnose::data::stacked_records::{NuisanceBasis, StackedRecords};
use crate::lti::Body;
use std::collections::BTreeMap;

/// Series that hold noise only: each repeat less the mean of its group, scaled back to the noise of one record.
pub(in crate::diagnose) fn noise_series(errors: &[(usize, Vec<f64>)], runs: &[Run]) -> Vec<(usize, Vec<f64>)> {
    let mut out = Vec::new();
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (i, (r, e)) in errors.iter().enumerate() {
        let same = |g: &Vec<usize>| {
            let (other, o) = &errors[g[0]];
            runs[*other].group == runs[*r].group && o.len() == e.len()
        };
        match groups.iter_mut().find(|g| same(g)) {
            Some(g) => g.push(i),
            None => groups.push(vec![i]),
        }
    }
    for g in groups.iter().filter(|g| g.len() > 1) {
        let n = g.len() as f64;
        let len = errors[g[0]].1.len();
        let mean: Vec<f64> = (0..len).map(|k| g.iter().map(|&i| errors[i].1[k]).sum::<f64>() / n).collect();
        let scale = (n / (n - 1.0)).sqrt();
        out.extend(g.iter().map(|&i| {
            let (run, error) = &errors[i];
            (*run, error.iter().zip(&mean).map(|(e, m)| scale * (e - m)).collect::<Vec<f64>>())
        }));
    }
    out
}

pub(in crate::diagnose) fn values(series: &[(usize, Vec<f64>)]) -> Vec<Vec<f64>> {
    series.iter().map(|s| s.1.clone()).collect()
}

/// Series with each record's own start and constant torque taken out, all of it seen through a filter.
pub(in crate::diagnose) fn without_start(
    series: &[(usize, Vec<f64>)],
    free: &dyn Fn(usize) -> Vec<Vec<f64>>,
    filter: &dyn Fn(&mut Vec<f64>),
) -> Vec<(usize, Vec<f64>)> {
    let mut out = series.to_vec();
    // Records of one length start in the same motions.
    let mut starts: BTreeMap<usize, NuisanceBasis> = BTreeMap::new();
    for (_, e) in &mut out {
        let basis = starts.entry(e.len()).or_insert_with(|| {
            let mut basis = NuisanceBasis::default();
            for mut c in free(e.len()) {
                filter(&mut c);
                basis.add_local(0, c);
            }
            basis
        });
        filter(e);
        basis.project(e);
    }
    out
}

/// Errors of records that were not repeated but whose drive repeats inside, lap by lap, as if the laps were repeats. Of three or more the first is left
/// out: how a record begins rings on in it, and would look like a line that differs from lap to lap.
pub(in crate::diagnose) fn in_laps(errors: &[(usize, Vec<f64>)], runs: &[Run]) -> Vec<(usize, Vec<f64>)> {
    let mut out = Vec::new();
    for (r, e) in errors {
        let alone = errors.iter().filter(|(o, _)| runs[*o].group == runs[*r].group).count() == 1;
        match runs[*r].lap().filter(|_| alone) {
            Some(n) => {
                let from = if e.len() / n > 2 { n } else { 0 };
                out.extend(e[from..].chunks_exact(n).map(|lap| (*r, lap.to_vec())));
            }
            None => out.push((*r, e.clone())),
        }
    }
    out
}

/// Levels and filter of series that hold noise only, but for each record's own start; and the series, filtered.
pub(in crate::diagnose) fn noise_of(
    series: &[(usize, Vec<f64>)],
    free: &dyn Fn(usize) -> Vec<Vec<f64>>,
    body: &Body,
    sample_time_s: f64,
    from_repeats: bool,
) -> (NoiseLevels, Whitener, Vec<(usize, Vec<f64>)>) {
    let levels = NoiseLevels::fit(&values(&without_start(series, free, &|_| {})), body, sample_time_s, from_repeats);
    let mut whitener = Whitener::new(&levels, body, sample_time_s);
    let filtered = without_start(series, free, &|x| whitener.apply(x));
    whitener.refine(&values(&filtered));
    let filtered = without_start(series, free, &|x| whitener.apply(x));
    (levels, whitener, filtered)
}

/// Weights for the noise of each segment as its own repeats show it: a fast move may be noisier than a slow one.
pub(in crate::diagnose) fn weigh(stack: &mut StackedRecords, repeats: &[(usize, Vec<f64>)]) {
    for s in &mut stack.segments {
        let own = repeats.iter().filter(|(r, _)| s.runs.contains(r));
        let (sum, n) = own.fold((0.0, 0), |(sum, n), (_, e)| (sum + e.iter().map(|v| v * v).sum::<f64>(), n + e.len()));
        if n > 0 && sum > 0.0 {
            s.weight /= (sum / n as f64).sqrt();
        }
    }
}
