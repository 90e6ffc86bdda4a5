//! Peaks of a sampled curve, with their prominence.
//!
//! In: ordinates in order. Out: local maxima that stand out by at least a given height.

/// A local maximum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Index of the maximum; the middle one of a flat top.
    pub index: usize,
    /// The ordinate there.
    pub height: f64,
    /// Height above the higher of the two lowest points between this peak and higher ground on either side.
    pub prominence: f64,
}

/// All local maxima with at least `prominence`, in the order of their index. End points are no peaks.
///
/// Prominence is the topographic one: walk to both sides until the ground is higher or the data end.
///
/// ```
/// let peaks = servotune::numeric::peaks::find_peaks(&[0.0, 3.0, 1.0, 2.0, 0.0], 0.5);
/// assert_eq!((peaks[0].index, peaks[0].prominence), (1, 3.0));
/// assert_eq!((peaks[1].index, peaks[1].prominence), (3, 1.0));
/// ```
pub fn find_peaks(y: &[f64], prominence: f64) -> Vec<Peak> {
    let mut peaks = Vec::new();
    let mut i = 1;
    while i + 1 < y.len() {
        if y[i] <= y[i - 1] {
            i += 1;
            continue;
        }
        let mut end = i;
        while end + 1 < y.len() && y[end + 1] == y[i] {
            end += 1;
        }
        if end + 1 < y.len() && y[end + 1] < y[i] {
            let height = y[i];
            let lowest = |it: &mut dyn Iterator<Item = &f64>| {
                it.take_while(|v| **v <= height).fold(height, |low, v| low.min(*v))
            };
            let left = lowest(&mut y[..i].iter().rev());
            let right = lowest(&mut y[end + 1..].iter());
            let stands_out = height - left.max(right);
            if stands_out >= prominence {
                peaks.push(Peak { index: usize::midpoint(i, end), height, prominence: stands_out });
            }
        }
        i = end + 1;
    }
    peaks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flat_tops_edges_and_small_ripples() {
        let p = find_peaks(&[5.0, 1.0, 2.0, 2.0, 2.0, 1.5, 1.6, 0.0, 9.0], 0.3);
        // The ends are higher but are no peaks; the ripple of 0.1 is below the limit.
        assert_eq!(p, vec![Peak { index: 3, height: 2.0, prominence: 1.0 }]);
    }

    #[test]
    fn too_short_for_a_peak() {
        assert!(find_peaks(&[], 0.0).is_empty());
        assert!(find_peaks(&[1.0, 2.0], 0.0).is_empty());
    }
}
