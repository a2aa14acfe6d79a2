//! Figures of kd-trees that others have published, to be printed beside measured ones: context, never a result.

use crate::{Error, Result};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

/// Papay 2025, "Efficient ray tracing algorithms exploiting kd-trees on a GPU", appendix D.1: static scenes, on a Ryzen 5600 (one
/// thread) and a GeForce RTX 4080.
const PAPAY: &str = include_str!("papay2025.csv");
/// The same, dynamic scenes: means of their frames.
const PAPAY_DYNAMIC: &str = include_str!("papay2025_dynamic.csv");

/// One builder on one scene of somebody else.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// The scene's name there.
    pub scene: String,
    /// Its triangles.
    pub triangles: Option<u64>,
    /// The builder's name there.
    pub config: String,
    /// Figures by the names of the file.
    figures: BTreeMap<String, f64>,
}

impl Row {
    /// A figure by its name in the file.
    pub fn figure(&self, metric: &str) -> Option<f64> {
        self.figures.get(metric).copied()
    }
}

/// A line of the file.
#[derive(Debug, Deserialize)]
struct Line {
    kind: String,
    scene: String,
    config: String,
    metric: String,
    value: f64,
}

/// Published figures, and where they are from.
#[derive(Debug, Clone, PartialEq)]
pub struct Published {
    /// The file; `None` if they are those of Papay 2025.
    pub file: Option<String>,
    /// Smaller scenes first.
    pub rows: Vec<Row>,
}

/// Those of Papay 2025.
pub fn papay() -> Published {
    Published { file: None, rows: parse(PAPAY, "static", "nodes").expect("a file of our own") }
}

/// Those of Papay 2025 of scenes that move: by the way in which there is something to trace, on the host and on the device.
pub fn papay_dynamic() -> Vec<Row> {
    parse(PAPAY_DYNAMIC, "dynamic", "frame_s").expect("a file of our own")
}

/// Those of a file with the columns `table,kind,scene,config,metric,value`: of its static scenes the builders that have a tree.
///
/// # Errors
/// The file cannot be read, or a line is not one of those.
pub fn read(path: &Path) -> Result<Published> {
    let text = std::fs::read_to_string(path).map_err(Error::file(path))?;
    let rows = parse(&text, "static", "nodes").map_err(|error| {
        Error::Malformed(format!(
            "{}: {error}; published figures are lines of table,kind,scene,config,metric,value",
            path.display()
        ))
    })?;
    Ok(Published { file: Some(path.display().to_string()), rows })
}

/// The rows of a kind that have a figure: smaller scenes first, each builder where it first appears.
fn parse(text: &str, of: &str, needed: &str) -> std::result::Result<Vec<Row>, csv::Error> {
    let mut rows: Vec<Row> = Vec::new();
    let mut triangles = BTreeMap::new();
    for line in csv::Reader::from_reader(text.as_bytes()).into_deserialize() {
        let Line { kind, scene, config, metric, value } = line?;
        if metric == "static_triangles" {
            triangles.insert(scene, value as u64);
        } else if kind == of {
            let row = match rows.iter().position(|row| row.scene == scene && row.config == config) {
                Some(at) => &mut rows[at],
                None => {
                    rows.push(Row { scene, triangles: None, config, figures: BTreeMap::new() });
                    rows.last_mut().expect("just pushed")
                }
            };
            row.figures.insert(metric, value);
        }
    }
    rows.retain(|row| row.figures.contains_key(needed));
    for row in &mut rows {
        row.triangles = triangles.get(&row.scene).copied();
    }
    rows.sort_by_key(|row| row.triangles);
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_thesis_has_ten_scenes_and_three_builders() {
        let rows = papay().rows;
        assert_eq!(rows.len(), 30);
        assert!(rows.is_sorted_by_key(|row| row.triangles));
        let sibenik = &rows[0];
        assert_eq!((sibenik.scene.as_str(), sibenik.triangles), ("Sibenik", Some(75_284)));
        assert_eq!((sibenik.config.as_str(), sibenik.figure("cost")), ("CPU exact", Some(170.45)));
        assert!(rows.iter().all(|row| row.figure("steps_per_ray").is_some()), "trees and their rays are one row");
        let with_pool: Vec<&Row> = rows.iter().filter(|row| row.figure("pool_ms").is_some()).collect();
        assert_eq!(with_pool.len(), 10);
        let of_pool = ["pool_ms", "retrievals_k", "skipped_k"].map(|figure| with_pool[0].figure(figure));
        assert_eq!(of_pool, [Some(29.99), Some(206.0), Some(785.0)]);
    }

    #[test]
    fn the_thesis_has_seven_scenes_that_move_in_five_configurations() {
        let rows = papay_dynamic();
        assert_eq!(rows.len(), 35);
        let street = rows.iter().find(|row| (row.scene.as_str(), row.config.as_str()) == ("Street", "CPU merge"));
        let street = street.expect("a scene");
        assert_eq!(street.triangles, Some(961_430));
        assert!(
            rows.iter().all(|row| row.figure("build_dynamic_ms").is_some() && row.figure("steps_per_ray").is_some())
        );
    }

    #[test]
    fn a_file_that_is_none_is_refused_by_name() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("figures.csv");
        std::fs::write(&path, "scene,value\nsponza,1\n").expect("written");
        let error = read(&path).expect_err("other columns").to_string();
        assert!(error.contains("figures.csv") && error.contains("table,kind,scene,config,metric,value"), "{error}");
        std::fs::write(&path, "table,kind,scene,config,metric,value\nx,static,a,b,nodes,7\nx,static,a,c,mrays_s,1\n")
            .expect("written");
        let rows = read(&path).expect("figures").rows;
        assert_eq!((rows.len(), rows[0].figure("nodes"), rows[0].triangles), (1, Some(7.0), None));
    }
}
