//! What tuning must reach.

use crate::refusal::raise;
use crate::settings::named;
use pyo3::prelude::*;
use servotune::tune;
use servotune::verify::SourceFile;
use std::path::PathBuf;

/// A spec with the profile that it names.
#[pyclass(frozen, module = "servotune._core")]
pub struct Spec {
    /// What is asked.
    pub spec: tune::Spec,
    /// Its file.
    pub source: SourceFile,
    /// The profile's file.
    pub profile: Option<SourceFile>,
}

#[pymethods]
impl Spec {
    /// The spec in a spec.toml; paths in it are relative to the file's folder.
    #[staticmethod]
    fn read(path: PathBuf) -> PyResult<Spec> {
        let spec = tune::Spec::read(&path).map_err(raise)?;
        let profile = tune::Spec::profile_path(&path).map_err(raise)?;
        let profile = profile.map(|p| SourceFile::read(&p)).transpose().map_err(raise)?;
        Ok(Spec { spec, source: SourceFile::read(&path).map_err(raise)?, profile })
    }

    /// The spec in a text, with the text of the profile that it names.
    #[staticmethod]
    #[pyo3(signature = (text, profile = None))]
    fn parse(text: String, profile: Option<String>) -> PyResult<Spec> {
        let spec = tune::Spec::parse(&text, profile.as_deref()).map_err(raise)?;
        let profile = profile.map(|text| SourceFile { file: "profile".into(), text });
        Ok(Spec { spec, source: SourceFile { file: "spec".into(), text }, profile })
    }

    /// The text of its file.
    fn to_toml(&self) -> &str {
        &self.source.text
    }

    fn __repr__(&self) -> String {
        format!("Spec({})", named(&self.source.file))
    }
}
