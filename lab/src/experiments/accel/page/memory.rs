//! The section of memory.

use super::Part;
use crate::Result;
use crate::experiments::accel::points::MemoryPoint;
use crate::report::numbers::{count, three_digits};
use crate::report::{Section, Table};
use maud::html;

/// Bytes a triangle that a compacted structure in nodes of eight shall have at most, on nearly all scenes and on any.
const COMPACTED: [f64; 2] = [40.0, 44.0];
/// The same of a structure as asked for, with the scratch memory of its build.
const WITH_SCRATCH: f64 = 180.0;

pub(super) fn part(points: &[MemoryPoint]) -> Result<Option<Part>> {
    if points.is_empty() {
        return Ok(None);
    }
    let table = Table::new("Memory of bottom levels", points)
        .name("scene", |point| &point.scene)
        .number("triangles", "", |point| Some(point.triangles as f64), count)
        .text("whose", |point| point.maker.name())
        .text("nodes", |point| if point.of_eight { "of eight" } else { "of two" })
        .text("preference", |point| &point.flags)
        .spread("build", "ms", |point| Some(point.build_ms), three_digits)
        .number("structure", "bytes each", |point| Some(point.each(point.structure_bytes)), three_digits)
        .number("scratch", "bytes each", |point| Some(point.each(point.scratch_bytes)), three_digits)
        .number("both", "bytes each", |point| Some(point.with_scratch()), three_digits)
        .number("compacted", "bytes each", |point| point.compacted(), three_digits)
        .html();
    let body = html! {
        p {
            "One bottom level over all of a scene, with ALLOW_COMPACTION: what vkGetAccelerationStructureBuildSizesKHR asks for, and what a "
            "compacted copy takes, for each triangle; header and table of geometries included. In nodes of eight, two triangles that share an edge are one record."
        }
        p { (reading(points)) }
        (table)
    };
    Ok(Some((Section::new("memory", "Memory", body), Vec::new())))
}

/// How many scenes keep to the goals in nodes of eight, by each preference.
fn reading(points: &[MemoryPoint]) -> String {
    let mut preferences: Vec<&str> = Vec::new();
    for point in points.iter().filter(|point| point.of_eight) {
        if !preferences.contains(&point.flags.as_str()) {
            preferences.push(&point.flags);
        }
    }
    let of = |preference: &str| {
        let these: Vec<&MemoryPoint> = points.iter().filter(|p| p.of_eight && p.flags == preference).collect();
        let within = |most: f64| these.iter().filter(|p| p.compacted().is_some_and(|bytes| bytes <= most)).count();
        let small = these.iter().filter(|point| point.with_scratch() <= WITH_SCRATCH).count();
        format!(
            "preference {preference}: of {} scenes, {} have at most {} bytes a triangle compacted, {} at most {}; {small} at most {} with \
             the scratch memory",
            these.len(),
            within(COMPACTED[0]),
            COMPACTED[0],
            within(COMPACTED[1]),
            COMPACTED[1],
            WITH_SCRATCH,
        )
    };
    let all: Vec<String> = preferences.into_iter().map(of).collect();
    if all.is_empty() {
        "Nothing was built in nodes of eight.".into()
    } else {
        format!("In nodes of eight, {}.", all.join("; "))
    }
}
