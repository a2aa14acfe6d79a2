//! Whether hits are right: against each other, and against brute force.
//!
//! Two tracers may differ where arithmetic decides: at equal distance, on an edge that two triangles share, at the very end
//! of a ray. Anything else is an error of one of them, and brute force says whose.

use hedgerow::bvh::layout::Bvh2;
use hedgerow::trace::twin::tracer::closest_hit_by_brute_force;
use hedgerow::trace::{Hit, Query, Ray};
use rayon::prelude::*;

/// Distances this close are the same, relative to the greater.
const SAME_DISTANCE: f32 = 1e-4;
/// Barycentric weights below this are on an edge.
const ON_EDGE: f32 = 1e-4;

/// Whether both hits say the same: nothing met, something met (any-hit), or the same distance.
pub fn agree(query: Query, a: &Hit, b: &Hit) -> bool {
    if a.is_some() != b.is_some() {
        return false;
    }
    query == Query::AnyHit || !a.is_some() || same_distance(a.t, b.t)
}

fn same_distance(a: f32, b: f32) -> bool {
    (a - b).abs() <= SAME_DISTANCE * a.abs().max(b.abs())
}

/// Whether a hair's breadth more or less of the ray or the triangle would have been another hit.
///
/// A tracer may leave the weights of an any-hit away; a hit without any says nothing of where it lies, and excuses nothing.
fn on_the_edge(ray: &Ray, hit: &Hit) -> bool {
    let weights = [hit.u, hit.v, 1.0 - hit.u - hit.v];
    let tells_where = hit.t > 0.0 || (hit.u, hit.v) != (0.0, 0.0);
    hit.is_some()
        && tells_where
        && (weights.iter().any(|w| w.abs() <= ON_EDGE)
            || same_distance(hit.t, ray.t_max)
            || (ray.t_min > 0.0 && same_distance(hit.t, ray.t_min)))
}

/// Whether two hits of a ray may both be right, by arithmetic that is not the same: they agree, or one of them is on an edge.
pub fn may_both_be_right(query: Query, ray: &Ray, a: &Hit, b: &Hit) -> bool {
    agree(query, a, b) || on_the_edge(ray, a) || on_the_edge(ray, b)
}

/// The true hits of a sample of rays, spread over all of them.
pub struct Sample {
    query: Query,
    /// Which rays.
    indices: Vec<usize>,
    /// The nearest hit of each.
    truth: Vec<Hit>,
}

impl Sample {
    /// As many of `rays` as `budget` triangle tests allow, at least one, by testing every triangle of `tree`.
    pub fn take(tree: &Bvh2, rays: &[Ray], query: Query, budget: usize) -> Sample {
        let count = (budget / tree.records.len().max(1)).clamp(1, 256).min(rays.len());
        let indices: Vec<usize> = (0..count).map(|i| i * rays.len() / count).collect();
        let truth = indices.par_iter().map(|&i| closest_hit_by_brute_force(tree, &rays[i])).collect();
        Sample { query, indices, truth }
    }

    /// The first ray of the sample whose hit is wrong, and what it should have been.
    pub fn first_wrong(&self, rays: &[Ray], hits: &[Hit]) -> Option<(usize, Hit)> {
        let wrong = |(&i, truth): (&usize, &Hit)| {
            (!may_both_be_right(self.query, &rays[i], &hits[i], truth)).then_some((i, *truth))
        };
        self.indices.iter().zip(&self.truth).find_map(wrong)
    }
}

/// Hits of `hits` that differ from `reference` (both of `rays`) and are wrong by brute force over `tree`, as far as the first
/// `limit` differences go.
pub fn wrong_where_different(
    tree: &Bvh2,
    rays: &[Ray],
    query: Query,
    (hits, reference): (&[Hit], &[Hit]),
    limit: usize,
) -> usize {
    let different: Vec<usize> =
        (0..rays.len()).filter(|&i| !agree(query, &hits[i], &reference[i])).take(limit).collect();
    different
        .par_iter()
        .filter(|&&i| {
            let truth = closest_hit_by_brute_force(tree, &rays[i]);
            !may_both_be_right(query, &rays[i], &hits[i], &truth) && !on_the_edge(&rays[i], &reference[i])
        })
        .count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use hedgerow::bvh::codes::Code;
    use hedgerow::bvh::sah::Collapse;
    use hedgerow::bvh::twin::lbvh;

    fn hit(t: f32, u: f32, v: f32) -> Hit {
        Hit { t, primitive: 0, u, v }
    }

    /// Two unit squares across the z axis, at z = 1 and z = 2, and rays along z from the origin's plane.
    fn squares() -> (Bvh2, Vec<Ray>) {
        let square = |z: f32| [[-1.0, -1.0, z], [1.0, -1.0, z], [1.0, 1.0, z], [-1.0, 1.0, z]];
        let positions: Vec<_> = [square(1.0), square(2.0)].concat();
        let tree =
            lbvh::build(&positions, &[[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]], Code::Mc30.full(), Collapse::OFF);
        let ray = |x| Ray { origin: [x, 0.25, 0.0], t_min: 0.0, direction: [0.0, 0.0, 1.0], t_max: 10.0 };
        (tree, [-0.5, 0.5, 3.0].map(ray).to_vec())
    }

    #[test]
    fn hits_agree_within_one_in_ten_thousand_of_the_distance() {
        assert!(agree(Query::ClosestHit, &hit(1000.0, 0.2, 0.2), &hit(1000.05, 0.2, 0.2)));
        assert!(!agree(Query::ClosestHit, &hit(1000.0, 0.2, 0.2), &hit(1000.5, 0.2, 0.2)));
        assert!(!agree(Query::ClosestHit, &hit(1.0, 0.2, 0.2), &Hit::NONE));
        assert!(agree(Query::AnyHit, &hit(0.0, 0.2, 0.2), &hit(7.0, 0.2, 0.2)));
        assert!(agree(Query::AnyHit, &Hit::NONE, &Hit::NONE));
    }

    #[test]
    fn a_sample_finds_the_ray_whose_hit_is_wrong() {
        let (tree, rays) = squares();
        let sample = Sample::take(&tree, &rays, Query::ClosestHit, 1000);
        let mut hits: Vec<Hit> = rays.iter().map(|ray| closest_hit_by_brute_force(&tree, ray)).collect();
        assert_eq!(sample.first_wrong(&rays, &hits), None);
        assert!(!hits[2].is_some(), "the third ray passes beside the squares");
        // The farther square instead of the nearer one.
        hits[1].t = 2.0;
        assert_eq!(sample.first_wrong(&rays, &hits).map(|(i, truth)| (i, truth.t)), Some((1, 1.0)));
    }

    #[test]
    fn a_difference_counts_against_the_one_that_is_wrong() {
        let (tree, rays) = squares();
        let right: Vec<Hit> = rays.iter().map(|ray| closest_hit_by_brute_force(&tree, ray)).collect();
        let mut wrong = right.clone();
        wrong[0] = Hit::NONE;
        let count = |hits: &[Hit], reference: &[Hit]| {
            wrong_where_different(&tree, &rays, Query::ClosestHit, (hits, reference), 10)
        };
        assert_eq!(count(&wrong, &right), 1);
        assert_eq!(count(&right, &wrong), 0, "brute force is with the first");
    }

    #[test]
    fn an_any_hit_where_nothing_is_hit_is_wrong_though_it_says_not_where() {
        let (tree, rays) = squares();
        let sample = Sample::take(&tree, &rays, Query::AnyHit, 1000);
        let something = Hit { t: 0.0, primitive: 0, u: 0.0, v: 0.0 };
        assert_eq!(sample.first_wrong(&rays, &[something, something, Hit::NONE]), None);
        // The third ray passes beside the squares.
        assert_eq!(sample.first_wrong(&rays, &[something; 3]).map(|(i, _)| i), Some(2));
        let truth = [something, something, Hit::NONE];
        assert_eq!(wrong_where_different(&tree, &rays, Query::AnyHit, (&[something; 3], &truth), 10), 1);
    }

    #[test]
    fn a_hit_on_an_edge_may_go_either_way() {
        let (tree, _) = squares();
        // Along the squares' shared corner column x = y: on the diagonal edge.
        let rays = [Ray { origin: [1.0, 0.25, 0.0], t_min: 0.0, direction: [0.0, 0.0, 1.0], t_max: 10.0 }];
        let truth = closest_hit_by_brute_force(&tree, &rays[0]);
        let count = |hits: &[Hit]| wrong_where_different(&tree, &rays, Query::ClosestHit, (hits, &[truth]), 10);
        assert_eq!(count(&[Hit::NONE]), 0, "{truth:?}");
    }
}
