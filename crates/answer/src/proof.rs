//! What the proof of a gain table came to.

use serde::Serialize;
use servotune::verify::Certificate;
use servotune_report::certificate::certificate_sentence;
use std::path::PathBuf;

/// As it stands in the document of `tune`.
#[derive(Clone, Debug, Serialize)]
pub struct Proof {
    /// The certificate; absent where it was not written.
    pub file: Option<PathBuf>,
    /// Every limit is proved on every machine given.
    pub proved: bool,
    /// The same in a sentence: what is not proved, and by how much.
    pub says: String,
}

impl Proof {
    /// Of a certificate, or of the reason why there can be none.
    pub fn of(certificate: &Result<Certificate, String>) -> Proof {
        match certificate {
            Ok(c) => Proof { file: None, proved: c.proved, says: certificate_sentence(c) },
            Err(reason) => Proof { file: None, proved: false, says: format!("No certificate: {reason}.") },
        }
    }
}
