//! What might tell how fast a tree is traced: sums of its figures, with weights that are known or found.

use super::fit;
use super::own;
use super::samples::{EPO, FIGURES, LCV, OWN, Point, SAH, STEPS, TESTS, Weights};

/// α of Aila, Karras and Laine 2013 for all their scenes.
const ALPHA: f64 = 0.71;

/// A figure, or a sum of figures.
#[derive(Debug, Clone, Copy)]
pub struct Predictor {
    /// A short name.
    pub name: &'static str,
    /// What it is.
    pub what: &'static str,
    /// Where its weights come from.
    pub weights: Source,
    /// Whether no ray must go through the tree, but for the leaves of LCV.
    pub is_static: bool,
}

/// Where the weights of a predictor come from.
#[derive(Debug, Clone, Copy)]
pub enum Source {
    /// They are known.
    Known(Weights),
    /// They are found from points, where those tell; and told in words.
    Found(fn(&[Point<'_>]) -> Option<Weights>, fn(&Weights) -> String),
}

const fn one(figure: usize) -> Weights {
    two((figure, 1.0), (figure, 1.0))
}

const fn two((a, of_a): (usize, f64), (b, of_b): (usize, f64)) -> Weights {
    let mut weights = [0.0; FIGURES];
    weights[a] = of_a;
    weights[b] = of_b;
    weights
}

const fn known(name: &'static str, what: &'static str, weights: Weights) -> Predictor {
    let is_static = weights[STEPS] == 0.0 && weights[TESTS] == 0.0;
    Predictor { name, what, weights: Source::Known(weights), is_static }
}

const fn own(number: usize, what: &'static str) -> Predictor {
    known(own::NAMES[number], what, one(OWN + number))
}

/// All of them, in the order of the tables.
pub const ALL: [Predictor; 17] = [
    known("SAH", "SAH cost", one(SAH)),
    known("EPO", "end-point overlap", one(EPO)),
    known("SAH–EPO", "0.29 SAH + 0.71 EPO", two((SAH, 1.0 - ALPHA), (EPO, ALPHA))),
    Predictor {
        name: "SAH–EPO, best α",
        what: "(1 − α) SAH + α EPO with the α that correlates best",
        weights: Source::Found(fit::alpha, |weights| format!("α {:.2}", weights[EPO])),
        is_static: true,
    },
    Predictor {
        name: "SAH–EPO–LCV",
        what: "(1 − α − β) SAH + α EPO + β LCV with the α and β that correlate best",
        weights: Source::Found(fit::alpha_and_beta, |weights| format!("α {:.2}, β {:.2}", weights[EPO], weights[LCV])),
        is_static: true,
    },
    known("LCV", "leaf count variability over diffuse1 rays", one(LCV)),
    own(0, "cost to rays from anywhere in the scene, exact"),
    own(1, "the same by 26 cells"),
    own(2, "the same by six slabs"),
    own(3, "cost to the camera's rays"),
    own(4, "cost to a sample of rays, other ones than those that are timed"),
    own(5, "cost of going down to what rays end on"),
    own(6, "cost to a sample of shadow and ao rays that go left first, each to its first hit"),
    known("steps", "inner nodes that a ray visits", one(STEPS)),
    known("tests", "triangles that a ray tests", one(TESTS)),
    known("work", "3 steps + 2 tests", two((STEPS, 3.0), (TESTS, 2.0))),
    Predictor {
        name: "work, fitted prices",
        what: "steps and tests at the prices that fit the times best",
        weights: Source::Found(fit::prices, |weights| {
            format!("{:.2} ns a step, {:.2} ns a test", weights[STEPS], weights[TESTS])
        }),
        is_static: false,
    },
];
