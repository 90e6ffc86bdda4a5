//! Rows of a table on all cores: each alone, none waits for another, and the interpreter can still be interrupted.
//!
//! In: what to do with the row of a number. Out: a value or an error for each row, in the table's order, whatever the number of threads.

use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use rayon::prelude::*;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// A row's result and its error: one of them is there.
pub type Row<T> = (Option<T>, Option<String>);

/// Time between two looks at whether the interpreter was interrupted.
const LOOK: Duration = Duration::from_millis(50);

/// Works on rows 0 to n with so many threads (0: all cores); nothing of one row reaches another. The calling thread only waits: no row stands still for
/// another one, and an interrupt ends the call after the rows that are at work.
pub fn rows<T: Send>(
    py: Python<'_>,
    threads: usize,
    n: usize,
    one: impl Fn(usize) -> Result<T, String> + Sync + Send,
) -> PyResult<Vec<Row<T>>> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|e| PyValueError::new_err(format!("threads={threads}: {e}")))?;
    let interrupted = AtomicBool::new(false);
    let alone = |i: usize| -> Row<T> {
        if interrupted.load(Ordering::Relaxed) {
            return (None, None);
        }
        // Not even a fault of this program in one row may stop the others.
        let fault = |_| Err("this program failed on the row; please report it with its files".to_owned());
        match catch_unwind(AssertUnwindSafe(|| one(i))).unwrap_or_else(fault) {
            Ok(found) => (Some(found), None),
            Err(words) => (None, Some(words.replace('\n', " "))),
        }
    };
    py.detach(|| {
        let (done, waiting) = channel();
        pool.in_place_scope(|scope| {
            let alone = &alone;
            // The sender ends with its closure, so that no wait outlives the rows; the receiver is gone only where the call was interrupted.
            scope.spawn(move |_| drop(done.send((0..n).into_par_iter().map(alone).collect::<Vec<_>>())));
            loop {
                match waiting.recv_timeout(LOOK) {
                    Err(RecvTimeoutError::Timeout) => {
                        if let Err(e) = Python::attach(|py| py.check_signals()) {
                            interrupted.store(true, Ordering::Relaxed);
                            return Err(e);
                        }
                    }
                    Ok(all) => return Ok(all),
                    Err(e) => return Err(PyRuntimeError::new_err(format!("the rows' threads ended: {e}"))),
                }
            }
        })
    })
}
