//! Sealing: SHA-256 of every answer with its nonce, and one Merkle root.

use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

pub fn answers(dir: &Path) -> Result<Vec<PathBuf>, String> {
    let folder = dir.join("answers");
    let entries = std::fs::read_dir(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut files: Vec<PathBuf> =
        entries.flatten().map(|e| e.path()).filter(|p| p.extension().is_some_and(|e| e == "json")).collect();
    files.sort();
    if files.is_empty() { Err(format!("{}: no answers", folder.display())) } else { Ok(files) }
}

fn leaf(answer: &[u8], nonce: &str) -> String {
    let mut h = Sha256::new();
    h.update(answer);
    h.update(nonce.as_bytes());
    hex(&h.finalize())
}

/// Root of the binary tree over the leaves; an odd one out rises unchanged.
fn root(leaves: &[String]) -> String {
    let mut level: Vec<String> = leaves.to_vec();
    while level.len() > 1 {
        level = level
            .chunks(2)
            .map(|c| if c.len() == 2 { hex(&Sha256::digest(format!("{}{}", c[0], c[1]))) } else { c[0].clone() })
            .collect();
    }
    level.pop().unwrap_or_default()
}

fn nonce() -> Result<String, String> {
    use std::io::Read;
    let mut bytes = [0u8; 32];
    let read = std::fs::File::open("/dev/urandom").and_then(|mut f| f.read_exact(&mut bytes));
    read.map(|()| hex(&bytes)).map_err(|e| format!("no source of nonces: {e}"))
}

/// Writes `commitment.json` (to publish) and `answers/nonces.txt` (to keep with the answers).
pub fn commit(dir: &Path) -> Result<(), String> {
    let file = dir.join("commitment.json");
    if file.exists() {
        return Err(format!("{} is there already: a set is committed once", file.display()));
    }
    let (mut leaves, mut cases, mut nonces) = (Vec::new(), Vec::new(), String::new());
    for path in answers(dir)? {
        let id = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let bytes = std::fs::read(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        let nonce = nonce()?;
        let digest = leaf(&bytes, &nonce);
        nonces += &format!("{id} {nonce}\n");
        cases.push(json!({"id": id, "sha256": digest}));
        leaves.push(digest);
    }
    std::fs::write(dir.join("answers/nonces.txt"), nonces).map_err(|e| e.to_string())?;
    let out = json!({"scheme": "sha256(answer.json || nonce in hex), Merkle root over the ids in order, sha256(left || right in hex)",
        "root": root(&leaves), "cases": cases});
    let text = serde_json::to_string_pretty(&out).map_err(|e| e.to_string())?;
    std::fs::write(&file, text).map_err(|e| e.to_string())?;
    println!("{}", root(&leaves));
    Ok(())
}

/// Checks every answer against the commitment; gives the root, or the ids that differ.
pub fn verify(dir: &Path) -> Result<String, String> {
    let read = |p: PathBuf| std::fs::read_to_string(&p).map_err(|e| format!("{}: {e}", p.display()));
    let told: Value = serde_json::from_str(&read(dir.join("commitment.json"))?).map_err(|e| e.to_string())?;
    let nonces = read(dir.join("answers/nonces.txt"))?;
    let mut leaves = Vec::new();
    for (path, case) in answers(dir)?.iter().zip(told["cases"].as_array().into_iter().flatten()) {
        let id = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let nonce = nonces.lines().find_map(|l| l.strip_prefix(&format!("{id} "))).ok_or(format!("{id}: no nonce"))?;
        let digest = leaf(&std::fs::read(path).map_err(|e| e.to_string())?, nonce);
        if case["id"] != json!(id) || case["sha256"] != json!(digest) {
            return Err(format!("{id}: the answer is not the one committed"));
        }
        leaves.push(digest);
    }
    let now = root(&leaves);
    if told["root"] == json!(now) && told["cases"].as_array().map(Vec::len) == Some(leaves.len()) {
        Ok(now)
    } else {
        Err("the Merkle root differs from the one committed".into())
    }
}
