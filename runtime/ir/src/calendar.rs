//! Days and dates of the proleptic Gregorian calendar, counted from 1970-01-01.

/// Year, month, day of a day number.
pub(crate) fn date_of(day: i64) -> (i64, i64, i64) {
    // H. Hinnant, "chrono-compatible low-level date algorithms": eras of 400 years that start in March.
    let shifted = day + 719_468;
    let era = shifted.div_euclid(146_097);
    let of_era = shifted.rem_euclid(146_097);
    let year_of_era = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * of_year + 2) / 153;
    let day = of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = if month_from_march < 10 { month_from_march + 3 } else { month_from_march - 9 };
    (era * 400 + year_of_era + i64::from(month <= 2), month, day)
}

/// The day number of a date; `None` if there is no such day.
pub(crate) fn day_of(year: i64, month: i64, day: i64) -> Option<i64> {
    if !(0..=9999).contains(&year) || !(1..=12).contains(&month) || !(1..=31).contains(&day) {
        return None;
    }
    let from_march = year - i64::from(month <= 2);
    let (era, year_of_era) = (from_march.div_euclid(400), from_march.rem_euclid(400));
    let of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    let of_era = year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + of_year;
    let number = era * 146_097 + of_era - 719_468;
    (date_of(number) == (year, month, day)).then_some(number)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_and_day_numbers_agree() {
        for (day, date) in
            [(0, (1970, 1, 1)), (19_753, (2024, 1, 31)), (19_782, (2024, 2, 29)), (-1, (1969, 12, 31)), (11_016, (2000, 2, 29))]
        {
            assert_eq!(date_of(day), date);
            assert_eq!(day_of(date.0, date.1, date.2), Some(day));
        }
        for day in (-200_000..2_000_000).step_by(97) {
            let (y, m, d) = date_of(day);
            assert_eq!(day_of(y, m, d), (0..=9999).contains(&y).then_some(day));
        }
        for (y, m, d) in [(2023, 2, 29), (2100, 2, 29), (2024, 4, 31), (2024, 13, 1), (2024, 0, 1), (2024, 1, 0)] {
            assert_eq!(day_of(y, m, d), None);
        }
    }
}
