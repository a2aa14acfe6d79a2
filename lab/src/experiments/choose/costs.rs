//! The table of costs: what a build and a ray of every candidate take on scenes of several sizes.

use super::SceneClass;
use crate::measure::record::Record;
use crate::measure::statistics::geometric_mean;
use crate::measure::total_time::Line;
use serde::{Deserialize, Serialize};

/// What a candidate takes, or is expected to take.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Cost {
    /// The candidate, as `-b` takes it.
    pub builder: String,
    /// Milliseconds of a build.
    pub build_ms: f64,
    /// Nanoseconds of a ray, over all kinds together.
    pub ray_ns: f64,
}

impl Cost {
    /// Milliseconds over rays a build.
    pub fn line(&self) -> Line {
        Line { build: self.build_ms, ray: self.ray_ns * 1e-6 }
    }

    /// Milliseconds of a build and `rays` rays.
    pub fn total_ms(&self, rays: f64) -> f64 {
        self.line().at(rays)
    }
}

/// What a candidate took on a scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SceneCost {
    /// The scene's name.
    pub scene: String,
    /// The candidate and its times.
    #[serde(flatten)]
    pub cost: Cost,
}

impl SceneCost {
    /// By the medians of a record; `None` where nothing was traced.
    pub fn of(record: &Record) -> Option<SceneCost> {
        let (builder, build_ms) = (record.builder.clone(), record.build.median_ms);
        let ray_ns = 1e3 / record.mrays_s()?;
        Some(SceneCost { scene: record.scene.clone(), cost: Cost { builder, build_ms, ray_ns } })
    }
}

/// What candidates take on a scene, or on scenes of about the same size.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CostRow {
    /// The scene.
    #[serde(flatten)]
    pub class: SceneClass,
    /// What each candidate takes.
    pub costs: Vec<Cost>,
}

impl CostRow {
    /// The geometric means over scenes of a kind, of each candidate that was measured on all of them.
    ///
    /// # Panics
    /// There is no scene.
    pub fn mean(scenes: &[CostRow]) -> CostRow {
        let first = &scenes[0];
        let triangles = scenes.iter().map(|scene| scene.class.triangles as f64);
        let triangles = geometric_mean(triangles).unwrap_or_default().round() as u64;
        let cost = |Cost { builder, .. }: &Cost| {
            let all: Vec<&Cost> = scenes.iter().map(|scene| scene.cost(builder)).collect::<Option<_>>()?;
            let mean = |of: fn(&Cost) -> f64| geometric_mean(all.iter().map(|cost| of(cost)));
            let (build_ms, ray_ns) = (mean(|cost| cost.build_ms)?, mean(|cost| cost.ray_ns)?);
            Some(Cost { builder: builder.clone(), build_ms, ray_ns })
        };
        let costs = first.costs.iter().filter_map(cost).collect();
        CostRow { class: SceneClass { triangles, ..first.class }, costs }
    }

    fn cost(&self, builder: &str) -> Option<&Cost> {
        self.costs.iter().find(|cost| cost.builder == builder)
    }

    /// What lies between this row and a larger scenes' one, of the candidates of both: times are powers of the triangle count.
    fn towards(&self, larger: &CostRow, triangles: u64) -> Vec<Cost> {
        let [from, to] = [self, larger].map(|row| (row.class.triangles as f64).ln());
        let part = ((triangles as f64).ln() - from) / (to - from);
        let between = |a: f64, b: f64| a.powf(1.0 - part) * b.powf(part);
        let cost = |a: &Cost| {
            let b = larger.cost(&a.builder)?;
            let (build_ms, ray_ns) = (between(a.build_ms, b.build_ms), between(a.ray_ns, b.ray_ns));
            Some(Cost { builder: a.builder.clone(), build_ms, ray_ns })
        };
        self.costs.iter().filter_map(cost).collect()
    }

    /// What scenes of another size take if a build takes a time for each triangle.
    fn in_proportion(&self, triangles: u64) -> Vec<Cost> {
        let times = triangles as f64 / self.class.triangles as f64;
        self.costs.iter().map(|cost| Cost { build_ms: times * cost.build_ms, ..cost.clone() }).collect()
    }
}

/// The costs of a device: rows of growing size.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CostTable {
    /// Rows of crowded scenes and of others, each from small to large.
    pub rows: Vec<CostRow>,
}

impl CostTable {
    /// What every candidate is expected to take on a scene: read between the two rows next to it. Scenes smaller than the first row
    /// count as that; larger than the last, a build takes the last row's time for each triangle.
    pub fn costs(&self, class: &SceneClass) -> Vec<Cost> {
        let alike: Vec<&CostRow> = self.rows.iter().filter(|row| row.class.is_crowded == class.is_crowded).collect();
        let next = alike.iter().position(|row| row.class.triangles >= class.triangles);
        match (next, alike.last()) {
            (Some(0), _) => alike[0].costs.clone(),
            (Some(next), _) => alike[next - 1].towards(alike[next], class.triangles),
            (None, Some(last)) => last.in_proportion(class.triangles),
            (None, None) => Vec::new(),
        }
    }

    /// The candidate whose build and `rays` rays are expected to take least; of equals, that which is listed first. `None` where
    /// there is none.
    pub fn choose(&self, class: &SceneClass, rays: f64) -> Option<Cost> {
        self.costs(class).into_iter().min_by(|a, b| a.total_ms(rays).total_cmp(&b.total_ms(rays)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cost(builder: &str, build_ms: f64, ray_ns: f64) -> Cost {
        Cost { builder: builder.into(), build_ms, ray_ns }
    }

    fn class(triangles: u64) -> SceneClass {
        SceneClass { triangles, is_crowded: false }
    }

    /// One that builds fast and traces slowly, and one that does the opposite; on crowded scenes only the second.
    fn table() -> CostTable {
        let crowded = SceneClass { triangles: 1000, is_crowded: true };
        CostTable {
            rows: vec![
                CostRow { class: class(1000), costs: vec![cost("fast", 1.0, 200.0), cost("good", 10.0, 100.0)] },
                CostRow { class: class(16_000), costs: vec![cost("fast", 16.0, 800.0), cost("good", 40.0, 400.0)] },
                CostRow { class: crowded, costs: vec![cost("good", 7.0, 70.0)] },
            ],
        }
    }

    fn assert_near(found: &[Cost], expected: &[Cost]) {
        assert_eq!(found.len(), expected.len(), "{found:?}");
        for (found, expected) in found.iter().zip(expected) {
            assert_eq!(found.builder, expected.builder);
            let (build, ray) = (found.build_ms / expected.build_ms, found.ray_ns / expected.ray_ns);
            assert!((build - 1.0).abs() < 1e-12 && (ray - 1.0).abs() < 1e-12, "{found:?} {expected:?}");
        }
    }

    #[test]
    fn costs_between_two_rows_are_powers_of_the_count() {
        // Half way between 1,000 and 16,000 in the logarithm: the geometric means.
        assert_near(&table().costs(&class(4000)), &[cost("fast", 4.0, 400.0), cost("good", 20.0, 200.0)]);
        assert_near(&table().costs(&class(16_000)), &[cost("fast", 16.0, 800.0), cost("good", 40.0, 400.0)]);
    }

    #[test]
    fn beyond_the_rows_the_nearest_one_counts() {
        assert_near(&table().costs(&class(10)), &[cost("fast", 1.0, 200.0), cost("good", 10.0, 100.0)]);
        assert_near(&table().costs(&class(160_000)), &[cost("fast", 160.0, 800.0), cost("good", 400.0, 400.0)]);
        assert_eq!(CostTable { rows: vec![] }.choose(&class(10), 1e6), None);
    }

    #[test]
    fn few_rays_take_the_fast_builder_and_many_the_good_tree() {
        // 20 − 4 ms of building over 200 ns of a ray: the two meet at 80,000 rays.
        let chosen = |rays| table().choose(&class(4000), rays).expect("two candidates").builder;
        assert_eq!((chosen(79_000.0), chosen(81_000.0)), ("fast".into(), "good".into()));
        let crowded = SceneClass { triangles: 4000, is_crowded: true };
        assert_eq!(table().choose(&crowded, 0.0).expect("one").builder, "good");
    }

    #[test]
    fn a_row_is_the_geometric_mean_of_whoever_was_measured_on_all_its_scenes() {
        let one = CostRow { class: class(100), costs: vec![cost("fast", 1.0, 100.0), cost("good", 5.0, 50.0)] };
        let other = CostRow { class: class(400), costs: vec![cost("fast", 4.0, 900.0)] };
        let mean = CostRow::mean(&[one, other]);
        assert_eq!(mean.class, class(200));
        assert_near(&mean.costs, &[cost("fast", 2.0, 300.0)]);
    }
}
