//! Numbers as people read them: three digits that count, thousands told apart, units by size.

/// Three significant digits, without an exponent: `0.0123`, `1.23`, `123`, `12345`.
pub fn three_digits(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    // The exponent after rounding: 0.9999 has that of 1.00.
    let rounded = format!("{value:.2e}");
    let exponent: i32 = rounded.split_once('e').and_then(|(_, e)| e.parse().ok()).unwrap_or(0);
    format!("{value:.*}", (2 - exponent).clamp(0, 9) as usize)
}

/// A number of an axis: no more digits than it needs, `0`, `0.5`, `120`.
pub fn tick(value: f64) -> String {
    let text = three_digits(value);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// Where a logarithmic axis has its numbers: 1, 2 and 5 times the powers of ten, the powers alone where those are many.
pub fn log_ticks(lo: f64, hi: f64) -> Vec<f64> {
    let steps: &[f64] = match (hi / lo).log10() {
        decades if decades < 2.2 => &[1.0, 2.0, 5.0],
        decades if decades < 4.2 => &[1.0, 3.0],
        _ => &[1.0],
    };
    let decades = lo.log10().floor() as i32..=hi.log10().ceil() as i32;
    let ticks = decades.flat_map(|decade| steps.iter().map(move |step| step * 10.0_f64.powi(decade)));
    ticks.filter(|tick| (lo..=hi).contains(tick)).collect()
}

/// With a thin space between thousands: `262 267`.
pub fn grouped(value: u64) -> String {
    let digits = value.to_string();
    let groups = digits.as_bytes().rchunks(3).rev();
    groups.map(String::from_utf8_lossy).collect::<Vec<_>>().join("\u{2009}")
}

/// A count of a table: [`grouped`].
pub fn count(value: f64) -> String {
    grouped(value as u64)
}

/// A number of a table without digits behind the point.
pub fn whole(value: f64) -> String {
    format!("{value:.0}")
}

/// With one digit behind the point.
pub fn one_decimal(value: f64) -> String {
    format!("{value:.1}")
}

/// With two digits behind the point.
pub fn two_decimals(value: f64) -> String {
    format!("{value:.2}")
}

/// A size of a table: [`bytes`].
pub fn size(value: f64) -> String {
    bytes(value as u64)
}

/// A count in thousands, millions or billions: `66 k`, `1.4 M`.
pub fn short_count(value: f64) -> String {
    let (scaled, unit) = match value.abs() {
        v if v >= 0.9995e9 => (value / 1e9, " G"),
        v if v >= 0.9995e6 => (value / 1e6, " M"),
        v if v >= 0.9995e3 => (value / 1e3, " k"),
        _ => (value, ""),
    };
    format!("{}{unit}", tick(scaled))
}

/// [`duration`] with no more digits than it needs, for axes.
pub fn duration_tick(milliseconds: f64) -> String {
    let text = duration(milliseconds);
    let (number, unit) = text.split_once(' ').unwrap_or((&text, ""));
    format!("{} {unit}", tick(number.parse().unwrap_or(milliseconds)))
}

/// Milliseconds in the unit that fits: `12.3 µs`, `4.56 ms`, `7.89 s`.
pub fn duration(milliseconds: f64) -> String {
    match milliseconds {
        ms if ms < 0.9995 => format!("{} µs", three_digits(ms * 1e3)),
        ms if ms < 999.5 => format!("{} ms", three_digits(ms)),
        ms => format!("{} s", three_digits(ms / 1e3)),
    }
}

/// Bytes in binary units: `16.0 MiB`.
pub fn bytes(value: u64) -> String {
    let value = value as f64;
    match value {
        b if b >= 1023.5 * 1024.0 * 1024.0 => format!("{} GiB", three_digits(b / (1 << 30) as f64)),
        b if b >= 1023.5 * 1024.0 => format!("{} MiB", three_digits(b / (1 << 20) as f64)),
        b if b >= 1024.0 => format!("{} KiB", three_digits(b / 1024.0)),
        b => format!("{b} B"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_digits_count_and_no_exponent_is_used() {
        for (value, text) in
            [(0.012345, "0.0123"), (1.0, "1.00"), (12.345, "12.3"), (123.45, "123"), (12345.6, "12346"), (0.0, "0")]
        {
            assert_eq!(three_digits(value), text);
        }
    }

    #[test]
    fn a_logarithmic_axis_has_a_handful_of_numbers_whatever_its_range() {
        assert_eq!(log_ticks(3.0, 150.0), [5.0, 10.0, 20.0, 50.0, 100.0]);
        assert_eq!(log_ticks(1e4, 1e10), [1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10]);
        assert_eq!(log_ticks(1.0, 1000.0).len(), 7, "1, 3, 10, 30, 100, 300, 1000");
    }

    #[test]
    fn thousands_are_told_apart() {
        assert_eq!(grouped(7), "7");
        assert_eq!(grouped(262_267), "262\u{2009}267");
        assert_eq!(grouped(1_000_000), "1\u{2009}000\u{2009}000");
    }

    #[test]
    fn units_follow_the_size() {
        assert_eq!(short_count(66_450.0), "66.5 k");
        assert_eq!(short_count(1_000_000.0), "1 M");
        assert_eq!(short_count(999_900.0), "1 M");
        assert_eq!(short_count(20.0), "20");
        assert_eq!(duration(0.0123), "12.3 µs");
        assert_eq!(duration(4.56), "4.56 ms");
        assert_eq!(duration(999.9), "1.00 s");
        assert_eq!((duration_tick(1000.0), duration_tick(0.25)), ("1 s".into(), "250 µs".into()));
        assert_eq!((tick(2.0), tick(0.5), tick(0.0)), ("2".into(), "0.5".into(), "0".into()));
        assert_eq!(bytes(512), "512 B");
        assert_eq!(bytes(16 << 20), "16.0 MiB");
    }
}
