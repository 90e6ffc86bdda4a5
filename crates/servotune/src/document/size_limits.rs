//! The one set of size limits that every reader holds: what no machine of this kind has is refused before work or memory grows with it.
//!
//! In: nothing. Out: constants with their units. Spec: `specs/files.md`, "Sizes". Settings of a reader may be lower, never higher.

/// Longest TOML or JSON document (bytes): a trained gate of hundreds of features has a tenth of it.
pub const DOCUMENT_BYTES: usize = 64 << 20;
/// Longest table of features or slots (bytes), read whole.
pub const TABLE_BYTES: usize = 1 << 30;
/// Longest sweep file as it lies on disk (bytes).
pub const SWEEP_BYTES: usize = 64 << 20;
/// Longest sweep file after decompression (bytes).
pub const SWEEP_BYTES_UNPACKED: usize = 128 << 20;
/// Longest record after decompression (bytes): the samples below at 100 characters a row, twice over.
pub const RECORD_BYTES_UNPACKED: u64 = 1 << 30;
/// Most samples of a record: 200 s at 25 kHz.
pub const RECORD_SAMPLES: usize = 5_000_000;
/// Longest row of a record (bytes), header included.
pub const ROW_BYTES: usize = 1 << 20;

/// Most points of a sweep.
pub const SWEEP_POINTS: usize = 1_000_000;
/// Lowest and highest frequency of a sweep (rad/s).
pub const SWEEP_RAD_S: [f64; 2] = [1e-6, 1e10];
/// Smallest and largest magnitude of a response, a gain or a recorded value other than 0: their fourth powers stay finite.
pub const VALUE: [f64; 2] = [1e-30, 1e30];
/// Largest phase as written (deg): beyond it a display of nine digits shows no single degree.
pub const PHASE_DEG: f64 = 1e7;

/// Slowest and fastest root of a plant (rad/s).
pub const PLANT_RAD_S: [f64; 2] = [1e-4, 1e9];
/// Largest damping ratio of a plant or a filter.
pub const DAMPING: f64 = 1e4;
/// Least damping ratio of a filter's poles: below it the filter rings for longer than any test of it lasts.
pub const FILTER_DAMPING: f64 = 1e-6;
/// Most modes of a plant.
pub const PLANT_MODES: usize = 200;
/// Longest dead time (samples of the controller).
pub const DELAY_SAMPLES: usize = 1000;
/// Longest simulated write (samples), 80 s at the paper's rate.
pub const WRITE_SAMPLES: usize = 2_000_000;
/// Most images of a plant's response at multiples of the sample rate that a proof sums one by one.
pub const ALIASES: usize = 256;

/// Longest piece of a file that a message quotes (characters).
pub const QUOTED: usize = 80;
/// Widest cell of a table on a terminal (characters).
pub const CELL: usize = 400;

/// `text` as a message quotes it: whole, or its beginning and how long it is.
pub fn quoted(text: &str) -> String {
    cut(text, QUOTED)
}

/// `text`, or its first `most` characters and how many it has.
pub fn cut(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        None => text.to_owned(),
        Some((end, _)) => format!("{}... ({} characters)", &text[..end], text.chars().count()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_piece_is_cut_between_characters() {
        assert_eq!(quoted("1.5 dB"), "1.5 dB");
        let long = "ä".repeat(1000);
        assert_eq!(quoted(&long), format!("{}... (1000 characters)", "ä".repeat(QUOTED)));
    }
}
