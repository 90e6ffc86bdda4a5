//! Who does something, and when.
//!
//! In: a name, or the user's. Out: the stamp that a store keeps.

use servotune_fleet::Stamp;
use std::time::{SystemTime, UNIX_EPOCH};

/// Now, as RFC 3339 in universal time, to the second.
pub(super) fn now() -> String {
    let seconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs());
    let (days, rest) = (seconds / 86_400, seconds % 86_400);
    let (year, month, day) = civil(days);
    format!("{year:04}-{month:02}-{day:02}T{:02}:{:02}:{:02}Z", rest / 3600, rest / 60 % 60, rest % 60)
}

/// Who does it: as said, else the user's name, else `unknown`.
pub(super) fn stamp(who: Option<&str>) -> Stamp {
    let user = || ["USER", "USERNAME", "LOGNAME"].iter().find_map(|k| std::env::var(k).ok());
    let who = who.map(str::to_owned).or_else(user).unwrap_or_else(|| "unknown".into());
    Stamp { who, at: now() }
}

/// Year, month and day of a day counted from 1970-01-01, by the Gregorian calendar's 400-year cycle.
pub(super) fn civil(days: u64) -> (u64, u64, u64) {
    // Counted from 0000-03-01, so that the leap day ends a year.
    let z = days + 719_468;
    let (era, day_of_era) = (z / 146_097, z % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let m = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * m + 2) / 5 + 1;
    let month = if m < 10 { m + 3 } else { m - 9 };
    (era * 400 + year_of_era + u64::from(month <= 2), month, day)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_become_dates() {
        // 2000-02-29 is day 11016 and 2026-11-21 day 20778 since 1970-01-01.
        assert_eq!(civil(0), (1970, 1, 1));
        assert_eq!(civil(11_016), (2000, 2, 29));
        assert_eq!(civil(20_778), (2026, 11, 21));
    }
}
