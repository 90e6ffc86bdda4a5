//! Features: one row of numbers from a machine's swept sine, PES and log.
