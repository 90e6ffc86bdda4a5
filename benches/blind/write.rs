//! Writes a case folder as the contract has it.

use crate::fit::Recorded;
use crate::machine::{Plant, Units};
use crate::make::{Order, Stage};
use crate::random::Random;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

fn number(out: &mut String, x: f64) {
    if x == 0.0 {
        out.push('0');
    } else if (1e-3..1e4).contains(&x.abs()) {
        let digits = 8 - x.abs().log10().floor() as i32;
        let _ = write!(out, "{:.*}", digits.clamp(1, 12) as usize, x);
        while out.ends_with('0') {
            out.pop();
        }
        if out.ends_with('.') {
            out.pop();
        }
    } else {
        let _ = write!(out, "{x:.8e}");
    }
}

pub fn case(
    order: &Order,
    out: &Path,
    stage: &Stage,
    given: &Plant,
    recs: &[Recorded],
    s: &Units,
    r: &mut Random,
) -> std::io::Result<()> {
    let dir = out.join(&order.id);
    let _ = std::fs::remove_dir_all(&dir);
    std::fs::create_dir_all(dir.join("records"))?;
    std::fs::write(dir.join("plant.toml"), given.toml(s))?;
    if let Some(law) = &stage.law {
        std::fs::write(dir.join("controller.toml"), law.toml(s))?;
    }
    let with_pes = r.chance(0.35);
    let runout = order.effects.contains(&"repeatable_runout");
    let with_spindle = r.chance(if runout { 0.6 } else { 0.25 });
    let with_rate = order.plain || r.chance(0.8) || with_spindle;
    let mut text = format!("id = \"{}\"\nplant = \"plant.toml\"\n", order.id);
    if stage.law.is_some() {
        text.push_str("controller = \"controller.toml\"\n");
    }
    if with_rate {
        let _ = writeln!(text, "spindle_hz = {:?}", stage.base.spindle_hz);
    }
    for (plan, rec) in stage.plans.iter().zip(recs) {
        let file = format!("records/{}.csv.gz", plan.name);
        let role = if plan.holdout { "holdout" } else { "fit" };
        let _ =
            write!(text, "\n[[records]]\nfile = \"{file}\"\nrole = \"{role}\"\nrepeat_group = \"{}\"\n", plan.group);
        let mut csv = String::with_capacity(rec.clean.len() * 64);
        csv.push_str("time_s,reference,excitation,command,position");
        csv.push_str(if with_pes { ",pes" } else { "" });
        csv.push_str(if with_spindle { ",spindle_rad\n" } else { "\n" });
        let mut draw = Random::new(order.seed, 0xbe5 + plan.drive.seed);
        for i in 0..rec.clean.len() {
            let _ = write!(csv, "{:.9},", i as f64 * stage.ts);
            number(&mut csv, rec.reference[i] * s.length);
            csv.push(',');
            number(&mut csv, rec.excitation[i] * s.command);
            csv.push(',');
            number(&mut csv, rec.command[i] * s.command);
            csv.push(',');
            number(&mut csv, (rec.clean[i] + rec.noise[i]) * s.length);
            if with_pes {
                csv.push(',');
                number(&mut csv, (rec.reference[i] - rec.head[i] + stage.noise.sigma * draw.normal()) * s.length);
            }
            if with_spindle {
                let _ = write!(csv, ",{:.6}", rec.spindle[i].rem_euclid(std::f64::consts::TAU));
            }
            csv.push('\n');
        }
        let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        packed.write_all(csv.as_bytes())?;
        std::fs::write(dir.join(file), packed.finish()?)?;
    }
    std::fs::write(dir.join("case.toml"), text)
}
