//! Dates and times of day of their parts, in the proleptic Gregorian calendar from 1970.
//!
//! Parts that no day has (month 13, 30 February, hour 24) give the start of the type: 1 January 1970, midnight.

#![allow(clippy::too_many_arguments, reason = "the standard gives CONCAT_DT seven inputs")]

use takt_abi::{FnDesc, StDate, StDateTime, StLdateTime, StLtimeOfDay, StTimeOfDay, native_fn};

/// All of them.
pub const FUNCTIONS: &[&FnDesc] =
    &[DateOf::DESC, TodOf::DESC, LtodOf::DESC, DtOf::DESC, LdtOf::DESC, DateTod::DESC, DateLtod::DESC, DayOfWeek::DESC, CivilDate::DESC];

/// Nanoseconds of a second.
pub(super) const SECOND_NANOS: u64 = 1_000_000_000;
/// Seconds of a day.
pub(super) const DAY_SECONDS: u64 = 86_400;

/// Year, month and day of the day number from 1970-01-01.
pub(super) fn civil(day: u64) -> (u64, u64, u64) {
    // Years that begin in March put the leap day last; they repeat every 400 of them (146 097 days).
    let shifted = day + 719_468;
    let era = shifted / 146_097;
    let of_era = shifted % 146_097;
    let year_of_era = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let from_march = (5 * of_year + 2) / 153;
    let month = if from_march < 10 { from_march + 3 } else { from_march - 9 };
    (era * 400 + year_of_era + u64::from(month <= 2), month, of_year - (153 * from_march + 2) / 5 + 1)
}

/// The day number from 1970-01-01, if there is such a day from then on.
pub(super) fn day(year: i64, month: i64, day: i64) -> Option<u64> {
    let (year, month, day) = (u64::try_from(year).ok()?, u64::try_from(month).ok()?, u64::try_from(day).ok()?);
    if !(1970..=9999).contains(&year) || !(1..=12).contains(&month) || !(1..=31).contains(&day) {
        return None;
    }
    let from_march = year - u64::from(month <= 2);
    let of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    let number = from_march * 365 + from_march / 4 - from_march / 100 + from_march / 400 + of_year - 719_468;
    (civil(number) == (year, month, day)).then_some(number)
}

/// Nanoseconds from midnight, if there is such a time.
pub(super) fn clock(hour: i64, minute: i64, second: i64, nanos: i64) -> Option<u64> {
    let inside = |value: i64, limit: i64| (0..limit).contains(&value).then_some(value as u64);
    let seconds = inside(hour, 24)? * 3600 + inside(minute, 60)? * 60 + inside(second, 60)?;
    Some(seconds * SECOND_NANOS + inside(nanos, 1_000_000_000)?)
}

fn millis(ms: i16) -> i64 {
    i64::from(ms) * 1_000_000
}

native_fn! {
    /// The date of year, month and day (IEC 61131-3, table 36).
    pub fn CONCAT_DATE as DateOf(_cx, YEAR: i16, MONTH: i16, DAY: i16) -> StDate {
        Ok(StDate((day(YEAR.into(), MONTH.into(), DAY.into()).unwrap_or(0) * DAY_SECONDS) as u32))
    }
}
native_fn! {
    /// The time of day of its parts.
    pub fn CONCAT_TOD as TodOf(_cx, HOUR: i16, MINUTE: i16, SECOND: i16, MILLISECOND: i16) -> StTimeOfDay {
        let nanos = clock(HOUR.into(), MINUTE.into(), SECOND.into(), millis(MILLISECOND)).unwrap_or(0);
        Ok(StTimeOfDay((nanos / 1_000_000) as u32))
    }
}
native_fn! {
    /// The time of day of its parts, in nanoseconds.
    pub fn CONCAT_LTOD as LtodOf(_cx, HOUR: i16, MINUTE: i16, SECOND: i16, MILLISECOND: i16) -> StLtimeOfDay {
        Ok(StLtimeOfDay(clock(HOUR.into(), MINUTE.into(), SECOND.into(), millis(MILLISECOND)).unwrap_or(0)))
    }
}
native_fn! {
    /// Date and time of their parts; DT has no milliseconds, they are dropped.
    pub fn CONCAT_DT as DtOf(_cx, YEAR: i16, MONTH: i16, DAY: i16, HOUR: i16, MINUTE: i16, SECOND: i16, MILLISECOND: i16) -> StDateTime {
        let date = day(YEAR.into(), MONTH.into(), DAY.into());
        let time = clock(HOUR.into(), MINUTE.into(), SECOND.into(), millis(MILLISECOND));
        Ok(StDateTime(date.zip(time).map_or(0, |(d, t)| d * DAY_SECONDS + t / SECOND_NANOS) as u32))
    }
}
native_fn! {
    /// Date and time of their parts, in nanoseconds.
    pub fn CONCAT_LDT as LdtOf(_cx, YEAR: i16, MONTH: i16, DAY: i16, HOUR: i16, MINUTE: i16, SECOND: i16, MILLISECOND: i16) -> StLdateTime {
        let date = day(YEAR.into(), MONTH.into(), DAY.into());
        let time = clock(HOUR.into(), MINUTE.into(), SECOND.into(), millis(MILLISECOND));
        let nanos = date.zip(time).and_then(|(d, t)| (d * DAY_SECONDS).checked_mul(SECOND_NANOS)?.checked_add(t));
        Ok(StLdateTime(nanos.unwrap_or(0)))
    }
}
native_fn! {
    /// Date and time of day together.
    pub fn CONCAT_DATE_TOD as DateTod(_cx, DATE: StDate, TOD: StTimeOfDay) -> StDateTime {
        Ok(StDateTime((DATE.0 - DATE.0 % DAY_SECONDS as u32).wrapping_add(TOD.0 / 1000)))
    }
}
native_fn! {
    /// Date and time of day together, in nanoseconds.
    pub fn CONCAT_DATE_LTOD as DateLtod(_cx, DATE: StDate, LTOD: StLtimeOfDay) -> StLdateTime {
        let date = u64::from(DATE.0) / DAY_SECONDS * DAY_SECONDS;
        Ok(StLdateTime((date * SECOND_NANOS).wrapping_add(LTOD.0)))
    }
}
native_fn! {
    /// Day of the week: 0 is Sunday, 6 Saturday.
    pub fn DAY_OF_WEEK as DayOfWeek(_cx, IN: StDate) -> i16 { Ok(((u64::from(IN.0) / DAY_SECONDS + 4) % 7) as i16) }
}
native_fn! {
    /// The date of a day number from 1970-01-01 in decimal digits: 20240229.
    pub fn CIVIL_DATE as CivilDate(_cx, DAYS: u32) -> u32 {
        let (year, month, day) = civil(DAYS.into());
        Ok((year * 10_000 + month * 100 + day) as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_and_dates_agree() {
        assert_eq!((civil(0), civil(11_016), civil(19_782)), ((1970, 1, 1), (2000, 2, 29), (2024, 2, 29)));
        for number in (0..2_900_000).step_by(13) {
            let (y, m, d) = civil(number);
            assert_eq!(day(y as i64, m as i64, d as i64), Some(number));
        }
        for (y, m, d) in [(2023, 2, 29), (2100, 2, 29), (2024, 4, 31), (2024, 13, 1), (2024, 0, 1), (2024, 1, 0), (1969, 12, 31)] {
            assert_eq!(day(y, m, d), None);
        }
    }

    #[test]
    fn a_time_that_no_clock_shows_is_none() {
        assert_eq!(clock(23, 59, 59, 999_000_000), Some(86_399_999_000_000));
        assert_eq!((clock(24, 0, 0, 0), clock(0, 60, 0, 0), clock(0, 0, -1, 0)), (None, None, None));
    }
}
