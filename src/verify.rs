//! `servotune verify`: a gain table proved again.

use super::outputs::Outputs;
use super::verify_arguments::VerifyArguments;
use super::{Ending, Failure, Screen, load};
use servotune::document::{check_target, read_text, write_text};
use servotune::frf::{Hold, Sweep};
use servotune::tune::{GainTable, Spec};
use servotune::verify::{
    Certificate, Inputs, SourceFile, VerifyError, VerifySettings, certify_watched, choices, table_clock_s,
};
use servotune_report::certificate::certificate_text;
use servotune_report::certificate_page::{CertificateView, certificate_page};
use servotune_report::tuned::Units;
use std::path::{Path, PathBuf};

/// The certificate that `tune` writes beside a table.
pub(super) fn beside(gains: &Path) -> PathBuf {
    gains.with_extension("certificate.json")
}

pub(super) fn run(a: &VerifyArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    a.out.as_deref().map_or(Ok(()), check_target)?;
    let outputs = outputs(a)?;
    let old = match &a.certificate {
        Some(file) => Some(file.clone()),
        None => Some(beside(&a.gains)).filter(|f| f.exists() && a.out.as_ref() != Some(f)),
    };
    let old = old.map(|file| read_text(&file).map(|text| (file, text))).transpose()?;
    let (word, uncertainty) = match &old {
        Some((file, text)) => choices(file, text)?,
        None => Default::default(),
    };
    let plants = a.plant.iter().map(|p| SourceFile::read(p)).collect::<Result<Vec<SourceFile>, VerifyError>>()?;
    let gains = SourceFile::read(&a.gains)?;
    let hold = if a.hold_included { Hold::of(Some(table_clock_s(&gains)?)) } else { Hold::NotIncluded };
    let taken =
        load::Taken { how: &a.taken, unstable_poles: a.unstable_poles, hold, controller: a.controller.as_deref() };
    if a.frf.is_empty() && a.taken.any() {
        return Err(Failure::MeasuredWithout);
    }
    let sweeps =
        a.frf.iter().map(|f| load::sweep(f, &a.reading, &taken, screen)).collect::<Result<Vec<Sweep>, Failure>>()?;
    let profile = Spec::profile_path(&a.spec).map_err(VerifyError::from)?;
    let profile = profile.map(|p| SourceFile::read(&p)).transpose()?;
    let inputs = Inputs {
        gains: &gains,
        plants: &plants,
        sweeps: &sweeps,
        least_damping: a.min_damping,
        spec: &SourceFile::read(&a.spec)?,
        profile: profile.as_ref(),
        word: a.word().unwrap_or(word),
        uncertainty: a.uncertainty.unwrap_or(uncertainty),
    };
    let pace = screen.pace();
    let watch = |done, of| pace.part("proof of the write, boxes", done, of);
    let mut c = certify_watched(&inputs, &VerifySettings::default(), &watch)?;
    drop(pace);
    if let Some(file) = &a.out {
        write_text(file, &c.text()?)?;
        screen.say(&format!("wrote {}", file.display()));
    }
    // A certificate is compared as it was made; asked for other words or boxes, it does not speak of them.
    if let Some((file, text)) = &old
        && a.word().is_none_or(|w| w == word)
        && a.uncertainty.is_none_or(|u| u == uncertainty)
    {
        screen.say(&format!("checked against {}", file.display()));
        let unfit = c.compare(file, text)?;
        c.proved &= unfit.is_empty();
        c.findings.extend(unfit);
    }
    if let Some(file) = &a.report {
        let page = page(a, &c, &inputs)?;
        outputs.keep_old(screen)?;
        write_text(file, &page)?;
        screen.say(&format!("wrote {}", file.display()));
    }
    screen.result(&c, &certificate_text(&c)?)?;
    Ok(if c.proved { Ending::Accepted } else { Ending::Rejected })
}

/// Permission to write the page.
fn outputs(a: &VerifyArguments) -> Result<Outputs, Failure> {
    let single = [&a.controller, &a.taken.measured_with, &a.certificate];
    let mut inputs: Vec<PathBuf> = single.into_iter().flatten().cloned().collect();
    inputs.extend([&a.plant[..], &a.frf, &[a.gains.clone(), a.spec.clone(), beside(&a.gains)]].concat());
    // A spec that cannot be read is refused by its reader, in its own words.
    inputs.extend(Spec::profile_path(&a.spec).ok().flatten());
    let written: Vec<&PathBuf> = a.report.iter().collect();
    let outputs = Outputs::new(&written, &inputs, a.force)?;
    if let (Some(report), Some(out)) = (&a.report, &a.out) {
        Outputs::new(&[report], std::slice::from_ref(out), true)?;
    }
    Ok(outputs)
}

fn page(a: &VerifyArguments, c: &Certificate, inputs: &Inputs<'_>) -> Result<String, Failure> {
    let table = GainTable::parse(&a.gains, &inputs.gains.text).map_err(VerifyError::from)?;
    let (position, command) = table.units().unwrap_or(("position unit", "command unit"));
    let name = |file: &Path| file.display().to_string();
    let machines: Vec<String> = a.plant.iter().chain(&a.frf).map(|f| name(f)).collect();
    let mut provenance = vec![("program".to_owned(), format!("servotune {}", c.program))];
    provenance.push((name(&a.gains), c.gains_sha256.clone()));
    provenance.extend(machines.iter().zip(&c.cases).map(|(m, case)| (m.clone(), case.sha256.clone())));
    provenance.push((name(&a.spec), c.spec_sha256.clone()));
    provenance.extend(c.profile_sha256.iter().map(|sha| ("profile".to_owned(), sha.clone())));
    let view = CertificateView {
        name: &name(&a.gains),
        certificate: c,
        machines: &machines,
        units: Units { position, command },
        provenance,
    };
    Ok(certificate_page(&view)?.html())
}
