//! Where a builder gives way, and where the thesis expects it to (Riemersma 2024, equations 13 and 14).

/// The relative cost from which on a tenth is lost.
pub const COST: f64 = 1.1;
/// The relative speed from which down a tenth is lost.
pub const SPEED: f64 = 0.9;
/// The codes whose drop mipping and binning move.
pub const BASE: &str = "emc64var-nosize";

/// The least e of `points` (e, figure) whose figure `is_lost`.
pub fn first(points: impl IntoIterator<Item = (u32, f64)>, is_lost: impl Fn(f64) -> bool) -> Option<u32> {
    points.into_iter().filter(|&(_, figure)| is_lost(figure)).map(|(e, _)| e).min()
}

/// By how much the grid of the builder's codes moves the drop: log2(cells) / d, where the bounds grow in d axes (equation 13).
/// `None` for codes without a grid.
pub fn shift(builder: &str, axes: u32) -> Option<f64> {
    let codes = option(builder, "codes")?;
    let bits: f64 = match (codes.strip_prefix("mip"), codes.strip_prefix("bin")) {
        (Some(rest), _) => rest.split(|c: char| !c.is_ascii_digit()).next()?.parse().ok()?,
        // The counting grid of binning has 7 bits, whatever the depth of the splits.
        (_, Some(rest)) if rest.starts_with(|c: char| c.is_ascii_digit()) => 7.0,
        _ => return None,
    };
    Some(bits / f64::from(axes))
}

/// The same builder with the codes whose drop is moved; `None` where it has no codes with a grid.
pub fn base(builder: &str) -> Option<String> {
    shift(builder, 1)?;
    let options = builder.split(':').map(|option| match option.split_once('=') {
        Some(("codes", _)) => format!("codes={BASE}"),
        _ => option.to_owned(),
    });
    Some(options.collect::<Vec<_>>().join(":"))
}

fn option<'a>(builder: &'a str, key: &str) -> Option<&'a str> {
    builder.split(':').filter_map(|option| option.split_once('=')).find(|(k, _)| *k == key).map(|(_, value)| value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_point_that_is_lost_counts() {
        let points = [(0, 1.0), (40, 1.03), (46, 1.08), (50, 1.38), (56, 5.6)];
        assert_eq!(first(points, |cost| cost >= COST), Some(50));
        assert_eq!(first(points, |cost| cost >= 9.0), None);
    }

    #[test]
    fn grids_move_the_drop_by_their_bits_over_the_axes() {
        // Riemersma 2024, section 4.3: mipping with b = 9 by 9 and 3, binning with 7 bits by 7 and 2.3.
        assert_eq!(shift("lbvh:codes=mip9:collapse=off", 1), Some(9.0));
        assert_eq!(shift("lbvh:codes=mip9+concise/40", 3), Some(3.0));
        assert_eq!(shift("lbvh:codes=bin4a5", 1), Some(7.0));
        assert_eq!(shift("lbvh:codes=bin4a5", 3), Some(7.0 / 3.0));
        for builder in ["lbvh", "lbvh:codes=mc63", "lbvh:codes=mipped", "lbvh:collapse=off"] {
            assert_eq!(shift(builder, 1), None, "{builder}");
        }
    }

    #[test]
    fn it_is_moved_from_the_same_builder_with_codes_without_a_grid() {
        let base_of = |builder| base(builder);
        assert_eq!(base_of("lbvh:codes=mip9:collapse=off"), Some("lbvh:codes=emc64var-nosize:collapse=off".into()));
        assert_eq!(base_of("ploc:radius=25:codes=bin2a3"), Some("ploc:radius=25:codes=emc64var-nosize".into()));
        assert_eq!(base_of("lbvh:codes=mc63"), None);
    }
}
