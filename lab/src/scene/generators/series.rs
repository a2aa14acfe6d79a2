//! Functions that the platform's mathematics library rounds as it likes, from sums and products, which are the same
//! everywhere: so that a generator's name means the same bytes on every machine.

/// Cosine and sine of an angle in radians, for angles up to a few turns.
pub fn turn(angle: f64) -> [f64; 2] {
    const HALVINGS: u32 = 6;
    let x = angle / f64::from(1 << HALVINGS);
    let (mut cosine, mut sine) = (sum(1.0, x, -1.0, 0), sum(x, x, -1.0, 1));
    // The short series holds for small angles; each doubling is cos 2x = cos² x − sin² x and sin 2x = 2 sin x cos x.
    for _ in 0..HALVINGS {
        (cosine, sine) = (cosine * cosine - sine * sine, 2.0 * sine * cosine);
    }
    [cosine, sine]
}

/// Hyperbolic cosine, for arguments up to about 2.
pub fn cosh(x: f64) -> f64 {
    sum(1.0, x, 1.0, 0)
}

/// `first` and the terms of a power series behind it, each the last times sign·x² / ((k + 1)(k + 2)), k = `power`, + 2 a term.
fn sum(first: f64, x: f64, sign: f64, power: u32) -> f64 {
    let mut term = first;
    (0..10).fold(first, |sum, step| {
        let k = f64::from(power + 2 * step);
        term *= sign * x * x / ((k + 1.0) * (k + 2.0));
        sum + term
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_are_the_functions_that_they_are_named_after() {
        for step in -700..=700 {
            let x = f64::from(step) / 100.0;
            let [cosine, sine] = turn(x);
            assert!((cosine - x.cos()).abs() < 1e-13 && (sine - x.sin()).abs() < 1e-13, "{x}");
        }
        for step in -200..=200 {
            let x = f64::from(step) / 100.0;
            assert!((cosh(x) - x.cosh()).abs() < 1e-13, "{x}");
        }
    }
}
