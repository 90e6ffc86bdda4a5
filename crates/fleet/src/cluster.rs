//! Tables for groups of machines: pilots that look alike are tuned together, at several numbers of groups.
//!
//! In: the pilots with their cases. Out: groups with their centres, and a table each. Alike is near in ln P(jw) over the frequencies that a loop
//! of this kind feels; groups are those of k-means from starts that lie farthest apart (Gonzalez, TCS 38, 1985), so no draw is needed.

use super::look::{distance, nearest};
use super::slot::Prepared;
use super::{Context, Ready};
use servotune::controller::Controller;
use servotune::tune::{Machine, TuningProblem, table_with_most_room};

/// Numbers of groups.
pub const LEVELS: [usize; 6] = [1, 2, 3, 4, 6, 8];
/// Members that a group's table is tuned on at most: those farthest apart.
const MEMBERS: usize = 5;
/// Rounds of k-means.
const ROUNDS: usize = 30;
/// Tables from which a group's polish starts.
const STARTS: usize = 2;
const STEPS: usize = 25;

/// `count` of the looks that lie farthest apart, beginning with the one nearest to the mean.
fn apart(looks: &[&Vec<f64>], count: usize) -> Vec<usize> {
    let mean = mean(looks);
    let first = (0..looks.len()).min_by(|&a, &b| distance(looks[a], &mean).total_cmp(&distance(looks[b], &mean)));
    let mut chosen: Vec<usize> = first.into_iter().collect();
    while chosen.len() < count.min(looks.len()) {
        let far = |i: usize| chosen.iter().map(|&c| distance(looks[i], looks[c])).fold(f64::INFINITY, f64::min);
        let next =
            (0..looks.len()).filter(|i| !chosen.contains(i)).max_by(|&a, &b| far(a).total_cmp(&far(b)).then(b.cmp(&a)));
        chosen.extend(next);
    }
    chosen
}

fn mean(looks: &[&Vec<f64>]) -> Vec<f64> {
    let n = looks.len().max(1) as f64;
    let width = looks.first().map_or(0, |l| l.len());
    (0..width).map(|j| looks.iter().map(|l| l[j]).sum::<f64>() / n).collect()
}

/// Centres and members of `k` groups; a group that loses all its members is left out.
pub(super) fn groups(looks: &[Vec<f64>], k: usize) -> (Vec<Vec<f64>>, Vec<Vec<usize>>) {
    let all: Vec<&Vec<f64>> = looks.iter().collect();
    let mut centres: Vec<Vec<f64>> = apart(&all, k).into_iter().map(|i| looks[i].clone()).collect();
    let mut members: Vec<Vec<usize>> = Vec::new();
    for _ in 0..ROUNDS {
        let mut next = vec![Vec::new(); centres.len()];
        for (i, look) in looks.iter().enumerate() {
            if let Some(c) = nearest(look, &centres) {
                next[c].push(i);
            }
        }
        next.retain(|m| !m.is_empty());
        centres = next.iter().map(|m| mean(&m.iter().map(|&i| &looks[i]).collect::<Vec<_>>())).collect();
        if next == members {
            break;
        }
        members = next;
    }
    (centres, members)
}

/// The table of a group: the one with the most room on its most different members at once, from the tables that miss least there.
pub(super) fn group_table(
    context: &Context,
    pilots: &[Prepared],
    looks: &[Vec<f64>],
    members: &[usize],
    from: &[Controller],
) -> Option<Controller> {
    let own: Vec<&Vec<f64>> = members.iter().map(|&i| &looks[i]).collect();
    let chosen: Vec<usize> = apart(&own, MEMBERS).into_iter().map(|i| members[i]).collect();
    let machines: Vec<Machine<'_>> = chosen.iter().flat_map(|&i| pilots[i].evidence.machines()).collect();
    let problem = TuningProblem::around(&machines, &context.guarded, &context.base).ok()?;
    let mut work = problem.work();
    let score = |c: &Controller, work: &mut _| problem.score(&problem.parameters().vector(c), work).violation;
    let mut starts: Vec<(f64, usize)> = from.iter().enumerate().map(|(i, c)| (score(c, &mut work), i)).collect();
    starts.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let polished =
        starts.iter().take(STARTS).filter_map(|(_, i)| table_with_most_room(&problem, &from[*i], STEPS, &mut work));
    polished.min_by(|a, b| a.1.violation.total_cmp(&b.1.violation)).map(|(c, _)| c)
}

/// Candidates that add most to what the pilots are served by, in the order in which they add it, until nothing more is added thrice over.
pub(super) fn useful(
    context: &Context,
    pilots: &[Prepared],
    tables: &[Controller],
    fixed: usize,
    most: usize,
) -> Vec<usize> {
    let serves: Vec<Vec<bool>> = pilots
        .iter()
        .map(|p| match Ready::of(&p.evidence, &context.spec, &context.guarded, &context.base) {
            Ok(mut ready) => tables.iter().map(|t| ready.quick(t).violation <= 0.0).collect(),
            Err(_) => vec![false; tables.len()],
        })
        .collect();
    let mut chosen: Vec<usize> = (0..fixed.min(tables.len())).collect();
    let mut times: Vec<usize> = serves.iter().map(|s| chosen.iter().filter(|&&i| s[i]).count()).collect();
    // The first service of a slot counts most, the third least.
    let worth = |times: usize| [100usize, 10, 1].get(times).copied().unwrap_or(0);
    while chosen.len() < most {
        let gain = |i: usize| serves.iter().zip(&times).filter(|(s, _)| s[i]).map(|(_, t)| worth(*t)).sum::<usize>();
        let best =
            (0..tables.len()).filter(|i| !chosen.contains(i)).max_by(|&a, &b| gain(a).cmp(&gain(b)).then(b.cmp(&a)));
        let Some(i) = best.filter(|&i| gain(i) > 0) else { break };
        chosen.push(i);
        times.iter_mut().zip(&serves).filter(|(_, s)| s[i]).for_each(|(t, _)| *t += 1);
    }
    chosen
}
