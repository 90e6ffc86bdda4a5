//! The log of a machine, with what every factory log has: constants, copies, holes, units and drift by tester.
//!
//! In: a truth and its measurements. Out: numbers and words. Only FF_Factor says anything about the class beyond the PES.

use super::Truth;
use crate::gate::features::{LogEntry, PesRecord};
use crate::numeric::random::Random;
use crate::numeric::statistics::rms_of;

/// Numbers, which become features, and words, which do not.
pub(super) struct Log {
    pub entries: Vec<LogEntry>,
    pub words: Vec<(String, String)>,
}

/// Testers on the line; each controls four of the sixteen slots (section 2.1).
const TESTERS: f64 = 4.0;

/// Writes the log.
pub(super) fn log(truth: &Truth, factor: f64, record: &PesRecord, random: &mut Random) -> Log {
    let tester = (random.uniform() * TESTERS).floor();
    let mut entries: Vec<LogEntry> = Vec::new();
    let mut put = |key: &str, value: f64| entries.push(LogEntry { key: key.to_owned(), value });
    // The warm-up steps its factor by hundredths, and its own PES has noise.
    let stepped = ((factor + 0.01 * random.normal()) * 100.0).round() / 100.0;
    if random.uniform() > 0.02 {
        put("FF_Factor", stepped);
    }
    put("tester", tester);
    put("slot", 4.0 * tester + (random.uniform() * 4.0).floor());
    // Constants.
    put("controller_sample_time_us", truth.controller.sample_time_s * 1e6);
    put("spindle_speed_rpm", 7200.0);
    put("stroke_deg", 40.0);
    // Copies and near-copies: the same temperature by two sensors and in two units; PES in nanometres, cut off.
    let temperature = 24.0 + 0.8 * tester + 0.7 * random.normal();
    put("base_temperature_c", temperature);
    put("base_temperature_f", 32.0 + 1.8 * temperature);
    put("motor_temperature_c", temperature + 6.0 + 0.15 * random.normal());
    let rms = rms_of(record.pes.iter().copied());
    put("pes_rms_nm", (rms * 85.0 * 100.0).floor() / 100.0);
    // Unit by tester: the last one counts in milliseconds.
    let cycle_s = 48.0 + 2.0 * random.normal();
    put("cycle_time", if tester < TESTERS - 1.0 { cycle_s } else { 1e3 * cycle_s });
    // Drift: the pressure gauge of each tester has crept its own way.
    put("clamp_pressure_kpa", 420.0 + 6.0 * tester + 3.0 * random.normal());
    put("writes_since_service", (random.between(0.0, 4000.0) + 300.0 * tester).floor());
    put("humidity_percent", 45.0 + 4.0 * random.normal());
    put("supply_v", 24.0 + 0.05 * random.normal());
    // Holes: gauges that not every slot has.
    let (air, torque) = (random.uniform(), random.uniform());
    let (flow, check) = (12.0 + 0.4 * random.normal(), 1.0 + 0.02 * random.normal());
    if air > 0.35 {
        put("air_flow_l_per_min", flow);
    }
    if torque > 0.24 {
        put("torque_check", check);
    }
    if random.uniform() > 0.08 {
        put("arm_height_mm", 3.0 + 0.5 * (random.uniform() * 3.0).floor());
    }
    let mut words = vec![("firmware".to_owned(), format!("6.3.{tester}"))];
    if let Some(kind) = truth.kind {
        words.push(("found_later".to_owned(), kind.name().to_owned()));
    }
    Log { entries, words }
}
