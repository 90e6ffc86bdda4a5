//! The fewest shared tables: which candidates serve the most slots, and a bound that says how far any choice could do better.
//!
//! In: for each slot the candidates accepted in it, and what each of them costs there. Out: for every number of tables K the best choice found,
//! its coverage, and an upper bound on the coverage of any K. Slots of equal rows are one with a weight, so that the work does not grow with
//! the floor. Choice: greedy, then exchanges until no single exchange helps, then branch and bound where that is small enough; the bound is
//! the Lagrangean one of maximal covering (Church & ReVelle, Papers of the Regional Science Association 32, 1974; Galvao & ReVelle, EJOR 88, 1996).

use std::collections::BTreeMap;

/// Candidates accepted in each slot, as sets; equal ones once, with how many slots have them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Coverage {
    /// Candidates.
    pub candidates: usize,
    /// Rows of equal sets: the set's words of 64 bits, and how many slots.
    rows: Vec<(Vec<u64>, usize)>,
    /// Slots in all.
    pub slots: usize,
}

/// A choice of tables.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Choice {
    /// The candidates chosen, rising.
    pub tables: Vec<usize>,
    /// Slots served.
    pub served: usize,
    /// No choice of as many candidates serves more than this.
    pub at_most: usize,
}

/// Rows that branch and bound may look at for one K, half a second's worth; beyond, the bound stays open and says so by its distance.
const LOOKS: usize = 200_000_000;
/// Steps of the Lagrangean bound.
const STEPS: usize = 200;

impl Coverage {
    /// From each slot's set: whether candidate `i` is accepted in it.
    pub fn of(candidates: usize, slots: impl Iterator<Item = Vec<bool>>) -> Coverage {
        let mut c = Collect::new(candidates);
        slots.for_each(|s| c.add(|i| s.get(i).copied().unwrap_or(false)));
        c.end()
    }

    /// Slots that at least one candidate serves.
    pub fn coverable(&self) -> usize {
        self.rows.iter().filter(|(set, _)| set.iter().any(|w| *w != 0)).map(|(_, n)| n).sum()
    }

    fn has(set: &[u64], i: usize) -> bool {
        set[i / 64] >> (i % 64) & 1 == 1
    }

    /// Slots that a choice serves.
    pub fn served(&self, tables: &[usize]) -> usize {
        self.rows.iter().filter(|(set, _)| tables.iter().any(|&t| Self::has(set, t))).map(|(_, n)| n).sum()
    }

    /// Choices of 1 to `most` tables, with bounds; ends early where all that can be served is.
    pub fn choices(&self, most: usize) -> Vec<Choice> {
        let mut all: Vec<Choice> = Vec::new();
        let mut tables: Vec<usize> = Vec::new();
        let coverable = self.coverable();
        for k in 1..=most.min(self.candidates) {
            self.add_best(&mut tables);
            self.exchange(&mut tables);
            let mut best = tables.clone();
            best.sort_unstable();
            let mut served = self.served(&best);
            let mut at_most = self.bound(k).min(coverable);
            if served < at_most
                && let Some((better, exact)) = self.branch(k, served)
            {
                if let Some(tables) = better {
                    served = self.served(&tables);
                    best = tables;
                }
                if exact {
                    at_most = served;
                }
            }
            tables.clone_from(&best);
            all.push(Choice { tables: best, served, at_most: at_most.max(served) });
            if served >= coverable {
                break;
            }
        }
        all
    }

    /// Adds the candidate that serves most of what is left; of equals the first.
    fn add_best(&self, tables: &mut Vec<usize>) {
        let mut gain = vec![0usize; self.candidates];
        for (set, n) in self.rows.iter().filter(|(set, _)| !tables.iter().any(|&t| Self::has(set, t))) {
            (0..self.candidates).filter(|&i| Self::has(set, i)).for_each(|i| gain[i] += n);
        }
        let best =
            (0..self.candidates).filter(|i| !tables.contains(i)).max_by(|&a, &b| gain[a].cmp(&gain[b]).then(b.cmp(&a)));
        tables.extend(best);
    }

    /// Exchanges one table for one other as long as that serves more.
    fn exchange(&self, tables: &mut [usize]) {
        let mut now = self.served(tables);
        loop {
            let mut better: Option<(usize, usize, usize)> = None;
            for place in 0..tables.len() {
                let before = tables[place];
                for i in (0..self.candidates).filter(|i| !tables.contains(i)).collect::<Vec<_>>() {
                    tables[place] = i;
                    let served = self.served(tables);
                    if served > better.map_or(now, |b| b.0) {
                        better = Some((served, place, i));
                    }
                }
                tables[place] = before;
            }
            let Some((served, place, i)) = better else { return };
            (tables[place], now) = (i, served);
        }
    }

    /// An upper bound for `k` tables: every row may give its weight to one table at most, priced by multipliers that are moved by subgradients.
    fn bound(&self, k: usize) -> usize {
        let mut price: Vec<f64> = self
            .rows
            .iter()
            .map(|(set, n)| *n as f64 / set.iter().map(|w| w.count_ones()).sum::<u32>().max(1) as f64)
            .collect();
        let mut best = f64::INFINITY;
        let mut value = vec![0.0; self.candidates];
        for step in 0..STEPS {
            // max sum n_r z_r + sum price_r (sum_i a_ri x_i - z_r), z_r in 0..1, k of the x_i are 1.
            value.fill(0.0);
            let mut total = 0.0;
            for ((set, n), p) in self.rows.iter().zip(&price) {
                if set.iter().all(|w| *w == 0) {
                    continue;
                }
                total += (*n as f64 - p).max(0.0);
                (0..self.candidates).filter(|&i| Self::has(set, i)).for_each(|i| value[i] += p);
            }
            let mut order: Vec<usize> = (0..self.candidates).collect();
            order.sort_by(|&a, &b| value[b].total_cmp(&value[a]).then(a.cmp(&b)));
            let chosen = &order[..k.min(order.len())];
            total += chosen.iter().map(|&i| value[i]).sum::<f64>();
            best = best.min(total);
            let length = 1.0 / (1.0 + step as f64 / 10.0);
            for ((set, n), p) in self.rows.iter().zip(&mut price) {
                let times = chosen.iter().filter(|&&i| Self::has(set, i)).count() as f64;
                let wanted = if *n as f64 > *p { 1.0 } else { 0.0 };
                *p = (*p + 0.5 * length * *n as f64 * (wanted - times)).clamp(0.0, *n as f64);
            }
        }
        // Rounding of a sum of whole numbers.
        (best + 1e-6).floor() as usize
    }

    /// A choice of `k` that serves more than `served`, if there is one; and whether every choice was ruled out or in.
    fn branch(&self, k: usize, served: usize) -> Option<(Option<Vec<usize>>, bool)> {
        let mut order: Vec<usize> = (0..self.candidates).collect();
        let alone: Vec<usize> = order.iter().map(|&i| self.served(&[i])).collect();
        order.sort_by(|&a, &b| alone[b].cmp(&alone[a]).then(a.cmp(&b)));
        let mut search = Branch { coverage: self, order, best: served, found: None, looks: 0 };
        let left: Vec<usize> = (0..self.rows.len()).collect();
        let exact = search.visit(0, k, 0, &left, &mut Vec::new());
        Some((search.found, exact))
    }
}

/// Rows gathered one slot at a time.
#[derive(Clone, Debug)]
pub struct Collect {
    candidates: usize,
    rows: BTreeMap<Vec<u64>, usize>,
    slots: usize,
}

impl Collect {
    /// Nothing gathered yet.
    pub fn new(candidates: usize) -> Collect {
        Collect { candidates, rows: BTreeMap::new(), slots: 0 }
    }

    /// One slot.
    pub fn add(&mut self, covers: impl Fn(usize) -> bool) {
        let mut set = vec![0u64; self.candidates.div_ceil(64).max(1)];
        (0..self.candidates).filter(|&i| covers(i)).for_each(|i| set[i / 64] |= 1 << (i % 64));
        *self.rows.entry(set).or_default() += 1;
        self.slots += 1;
    }

    /// All slots.
    pub fn end(self) -> Coverage {
        Coverage { candidates: self.candidates, rows: self.rows.into_iter().collect(), slots: self.slots }
    }
}

struct Branch<'a> {
    coverage: &'a Coverage,
    order: Vec<usize>,
    best: usize,
    found: Option<Vec<usize>>,
    looks: usize,
}

impl Branch<'_> {
    /// Chooses `k` more among `order[from..]`; false where the looks ran out.
    fn visit(&mut self, from: usize, k: usize, served: usize, left: &[usize], chosen: &mut Vec<usize>) -> bool {
        if k == 0 || from == self.order.len() {
            if served > self.best {
                let mut tables = chosen.clone();
                tables.sort_unstable();
                (self.best, self.found) = (served, Some(tables));
            }
            return true;
        }
        self.looks += left.len() * (self.order.len() - from);
        if self.looks > LOOKS {
            return false;
        }
        let rows = &self.coverage.rows;
        let gain =
            |i: usize| -> usize { left.iter().filter(|&&r| Coverage::has(&rows[r].0, i)).map(|&r| rows[r].1).sum() };
        let mut gains: Vec<usize> = self.order[from..].iter().map(|&i| gain(i)).collect();
        let first = gains[0];
        gains.sort_unstable_by(|a, b| b.cmp(a));
        // No k candidates can add more than the k largest gains, nor more than is left.
        let all: usize = left.iter().map(|&r| rows[r].1).sum();
        let hope = served + gains.iter().take(k).sum::<usize>().min(all);
        if hope <= self.best {
            return true;
        }
        let i = self.order[from];
        let mut exact = true;
        if first > 0 {
            let rest: Vec<usize> = left.iter().copied().filter(|&r| !Coverage::has(&rows[r].0, i)).collect();
            chosen.push(i);
            exact &= self.visit(from + 1, k - 1, served + first, &rest, chosen);
            chosen.pop();
        }
        exact && self.visit(from + 1, k, served, left, chosen)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use servotune::numeric::random::Random;

    fn random(seed: u64, slots: usize, candidates: usize, share: f64) -> Vec<Vec<bool>> {
        let mut r = Random::new(seed);
        (0..slots).map(|_| (0..candidates).map(|_| r.uniform() < share).collect()).collect()
    }

    #[test]
    fn greedy_is_beaten_where_it_must_be() {
        // Candidate 0 serves four of six; 1 and 2 serve three each and together all: greedy takes 0 first.
        let sets = [[1, 1, 0], [1, 1, 0], [0, 1, 0], [1, 0, 1], [1, 0, 1], [0, 0, 1]];
        let c = Coverage::of(3, sets.iter().map(|s| s.iter().map(|x| *x == 1).collect()));
        let all = c.choices(3);
        assert_eq!((all[0].tables.clone(), all[0].served), (vec![0], 4));
        assert_eq!((all[1].tables.clone(), all[1].served, all[1].at_most), (vec![1, 2], 6, 6));
        assert_eq!(all.len(), 2);
    }

    #[test]
    fn every_choice_is_the_best_of_all_by_trying_them() {
        for seed in 0..20 {
            let (slots, candidates) = (40, 9);
            let c = Coverage::of(candidates, random(seed, slots, candidates, 0.2).into_iter());
            for choice in c.choices(4) {
                let k = choice.tables.len();
                let best = (0u32..1 << candidates)
                    .filter(|m| m.count_ones() as usize == k)
                    .map(|m| c.served(&(0..candidates).filter(|i| m >> i & 1 == 1).collect::<Vec<_>>()))
                    .max()
                    .unwrap();
                assert_eq!((choice.served, choice.at_most), (best, best), "seed {seed}, {k} tables");
            }
        }
    }

    #[test]
    fn the_bound_holds_and_slots_that_nothing_serves_are_never_served() {
        let c = Coverage::of(70, random(3, 300, 70, 0.02).into_iter().chain(vec![vec![false; 70]; 5]));
        assert!(c.coverable() <= 300 && c.slots == 305);
        for choice in c.choices(8) {
            assert!(choice.served <= choice.at_most && choice.at_most <= c.coverable());
        }
    }
}
