//! Figures that van Kralingen 2023, "Evaluating Alternatives to the Surface Area Heuristic", has published: its tables 2 to 6 and A.1
//! to A.8. Pages of several experiments print them beside ours: context, never a result.
//!
//! The rows of Soda Hall of table 6 stand in the slides at the end alone: the slide with Conference's figures of table 6 has them.

use serde::Deserialize;
use std::sync::LazyLock;

/// A published figure.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Figure {
    /// What it is of.
    pub metric: String,
    /// The scene's name there.
    pub scene: String,
    /// The kind of rays there, or the cost.
    pub rays_or_cost: String,
    /// The heuristic's name there.
    pub heuristic: String,
    /// The figure.
    pub value: f64,
}

/// All of them.
pub static FIGURES: LazyLock<Vec<Figure>> = LazyLock::new(|| {
    let text = include_str!("vankralingen2023.csv");
    csv::Reader::from_reader(text.as_bytes()).into_deserialize().collect::<Result<_, _>>().expect("a file of our own")
});

/// The figure of `metric` on a scene, of a kind of rays or a cost and a heuristic; all named as there.
pub fn of(metric: &str, scene: &str, rays_or_cost: &str, heuristic: &str) -> Option<f64> {
    let is_it = |f: &&Figure| {
        (&*f.metric, &*f.scene, &*f.rays_or_cost, &*f.heuristic) == (metric, scene, rays_or_cost, heuristic)
    };
    FIGURES.iter().find(is_it).map(|figure| figure.value)
}

#[cfg(test)]
mod tests {
    use super::of;

    #[test]
    fn the_rows_that_the_thesis_left_out_are_there() {
        assert_eq!(of("ns_per_ray_static", "Dragon", "total", "OSAH"), Some(896.0));
        assert_eq!(of("ns_per_ray_animated_rebuild1", "Soda Hall", "total", "RDH"), Some(823.0));
        // Conference's columns on that slide are those of table 6, which is how the others are known.
        assert_eq!(of("ns_per_ray_animated_rebuild1", "Conference", "total", "RDH"), Some(1038.0));
    }
}
