//! `stability growth`: one far triangle makes the bounds of a scene 2^e times as long (Riemersma 2024, section 4.3).

use super::far::{self, Axes, Side};
use super::points::{Failure, Growth, Head};
use super::relative::{Part, Series, Stage, measure as measure_series};
use crate::Result;
use crate::scene::{Mesh, Scene};

/// In which manners and how far the bounds grow.
#[derive(Debug, Clone)]
pub struct Plan {
    /// In one axis, in three.
    pub axes: Vec<Axes>,
    /// To which sides.
    pub sides: Vec<Side>,
    /// The e, ascending, 0 first.
    pub steps: Vec<u32>,
}

/// Measures one scene; gives what a reader must know beside: the points that floats cannot hold.
///
/// # Errors
/// The scene has no triangles; those of `point`.
pub fn measure(
    stage: &Stage<'_>,
    scene: &Scene,
    plan: &Plan,
    failed: &mut dyn FnMut(Failure),
    point: &mut dyn FnMut(Growth) -> Result<()>,
) -> Result<Vec<String>> {
    let part = Part::new(stage, scene)?;
    let mut notes = Vec::new();
    for &axes in &plan.axes {
        for &side in &plan.sides {
            let (meshes, left_out) = grown(&part, axes, side, &plan.steps);
            notes.extend(left_out);
            let name = format!("{} {}", in_axes(axes.count()), on_side(side));
            let series = Series { name, meshes: &meshes };
            measure_series(stage, &part, &series, failed, &mut |spec, e, figures| {
                point(Growth {
                    head: Head::of::<Growth>(),
                    scene: scene.name.clone(),
                    builder: spec.to_string(),
                    axes: axes.count(),
                    side,
                    e,
                    relative_cost: figures.relative_cost,
                    relative_mrays: figures.relative_mrays,
                })
            })?;
        }
    }
    Ok(notes)
}

/// The meshes of all steps that floats can hold, and a word on the others.
fn grown(part: &Part<'_>, axes: Axes, side: Side, steps: &[u32]) -> (Vec<(u32, Mesh)>, Option<String>) {
    let mesh = |&e: &u32| Some((e, part.with(&[far::triangle(&part.bounds, axes, side, e)?])));
    let meshes: Vec<(u32, Mesh)> = steps.iter().map_while(mesh).collect();
    let left_out = steps.get(meshes.len()).map(|e| {
        format!(
            "{}, {} {}: from e = {e} on the far triangle would lie beyond the largest float; these points are left out.",
            part.scene.name,
            in_axes(axes.count()),
            on_side(side)
        )
    });
    (meshes, left_out)
}

/// As charts and messages have it.
pub fn in_axes(axes: u32) -> &'static str {
    if axes == 1 { "in one axis" } else { "in three axes" }
}

/// As charts and messages have it.
pub fn on_side(side: Side) -> &'static str {
    match side {
        Side::Positive => "to the positive side",
        Side::Negative => "to the negative side",
    }
}
