//! The CPU peers find the hits that our own host tracer finds, so that their figures are of the same work.
#![cfg(any(feature = "peer-obvhs", feature = "peer-embree"))]

use hedgerow::bvh::codes::Code;
use hedgerow::bvh::layout::Bvh2;
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::lbvh;
use hedgerow::trace::twin::tracer as host;
use hedgerow::trace::{Hit, Query, Ray};
use hedgerow_lab::measure::agreement::wrong_where_different;
use hedgerow_lab::scene::{self, Mesh};
use hedgerow_lab::subjects::Subject;

fn soup() -> Mesh {
    scene::load("gen:soup:3000:7", &scene::LoadOptions::default()).expect("a generator").mesh
}

fn tree_of(mesh: &Mesh) -> Bvh2 {
    lbvh::build(&mesh.positions, &mesh.triangles, Code::Mc30.full(), Collapse::OFF)
}

/// Rays from a sphere of points around the middle of the soup, through it; the even ones end half-way.
fn rays(mesh: &Mesh) -> Vec<Ray> {
    let bounds = mesh.bounds();
    let (middle, radius) = (bounds.centroid(), bounds.diagonal());
    let spiral = |i: u32| {
        let (z, angle) = (1.0 - (2 * i + 1) as f32 / 2000.0, 2.4 * i as f32);
        let across = (1.0 - z * z).sqrt();
        [across * angle.cos(), across * angle.sin(), z]
    };
    (0..2000)
        .map(|i| {
            let [from, to] = [spiral(i), spiral((i * 7) % 2000)];
            let origin: [f32; 3] = std::array::from_fn(|a| middle[a] + radius * from[a]);
            let direction = std::array::from_fn(|a| middle[a] + 0.2 * radius * to[a] - origin[a]);
            Ray { origin, t_min: 0.0, direction, t_max: if i % 2 == 0 { 1.0 } else { 3.0 } }
        })
        .collect()
}

fn finds_our_hits(mut peer: impl Subject) {
    let mesh = soup();
    let (tree, rays) = (tree_of(&mesh), rays(&mesh));
    // Twice, for what a first build leaves behind must not matter to the second.
    for _ in 0..2 {
        assert!(peer.build().expect("it builds").milliseconds > 0.0);
    }
    peer.set_rays(&rays).expect("the rays fit");
    for query in [Query::ClosestHit, Query::AnyHit] {
        assert!(peer.trace(query).expect("it traces") > 0.0);
        let hits = peer.hits().expect("one hit a ray");
        let ours: Vec<Hit> = rays.iter().map(|ray| host::trace(&tree, ray, query).0).collect();
        let met = ours.iter().filter(|hit| hit.is_some()).count();
        assert!((rays.len() / 10..rays.len() * 9 / 10).contains(&met), "{met} hits are no test");
        let wrong = wrong_where_different(&tree, &rays, query, (&hits, &ours), rays.len());
        assert_eq!(wrong, 0, "{} {query:?}", peer.builder());
        if query == Query::ClosestHit {
            let same =
                |(a, b): &(&Hit, &Hit)| a.primitive == b.primitive && (a.u - b.u).abs() + (a.v - b.v).abs() < 1e-3;
            let same = hits.iter().zip(&ours).filter(same).count();
            assert!(same * 1000 >= rays.len() * 999, "{}: triangle and weights of {same} hits", peer.builder());
        }
    }
    assert!(peer.memory().structure_bytes > Some(mesh.triangles.len() as u64 * 36), "more than the vertices alone");
}

#[cfg(feature = "peer-obvhs")]
mod obvhs {
    use super::*;
    use hedgerow_lab::subjects::peers::obvhs::{Obvhs, Preset};

    #[test]
    fn obvhs_finds_our_hits() {
        for preset in [Preset::Fastest, Preset::Fast, Preset::Medium] {
            finds_our_hits(Obvhs::new(&soup(), preset).expect("the mesh fits"));
        }
    }

    #[test]
    fn the_quality_of_obvhs_is_that_of_its_own_nodes() {
        let mesh = soup();
        let quality = |preset| {
            let mut peer = Obvhs::new(&mesh, preset).expect("the mesh fits");
            peer.build().expect("it builds");
            peer.quality(3.0, 2.0).expect("its nodes are public")
        };
        let fastest = quality(Preset::Fastest);
        assert_eq!(fastest.refs, Some(3000));
        assert_eq!((fastest.leaves, fastest.inner), (Some(3000), Some(2999)), "one triangle a leaf");
        assert_eq!(quality(Preset::Medium).refs, Some(3000));
        assert!(quality(Preset::Medium).leaves < fastest.leaves, "leaves are collapsed");
    }
}

#[cfg(feature = "peer-embree")]
mod embree {
    use super::*;
    use hedgerow_lab::measure::overlap::Epo;
    use hedgerow_lab::subjects::builders::Spec;
    use hedgerow_lab::subjects::peers::embree::{Embree, Preset};

    #[test]
    fn embree_finds_our_hits() {
        for preset in [Preset::Low, Preset::Medium, Preset::High] {
            finds_our_hits(Embree::new(&soup(), preset).expect("the mesh fits"));
        }
    }

    const TREES: [&str; 3] = ["embree-low-tree", "embree-medium-tree", "embree-high-tree"];

    #[test]
    fn trees_of_embree_are_valid_and_have_the_hits_of_brute_force() {
        for (scene, builder) in
            ["gen:soup:3000:7", "gen:needles:2000:3"].into_iter().flat_map(|s| TREES.map(|b| (s, b)))
        {
            let mesh = scene::load(scene, &scene::LoadOptions::default()).expect("a generator").mesh;
            let mut peer = builder.parse::<Spec>().expect("known").make(None, &mesh).expect("it fits");
            // Twice, for what a first build leaves behind must not matter to the second.
            for _ in 0..2 {
                let run = peer.build().expect("it builds");
                let phases: Vec<_> = run.phases.iter().map(|phase| phase.name).collect();
                assert_eq!(phases, ["boxes", "build", "convert"]);
                assert!(run.on_cpu.is_some_and(|on_cpu| on_cpu.milliseconds > 0.0), "{run:?}");
            }
            peer.validate().unwrap_or_else(|error| panic!("{scene}, {builder}: {error}"));
            let quality = peer.quality(3.0, 2.0).expect("its layout is ours");
            let refs = quality.refs.expect("told");
            match builder {
                "embree-high-tree" => assert!(refs > mesh.triangles.len() as u64, "{scene}: some are split"),
                _ => assert_eq!(refs, mesh.triangles.len() as u64),
            }
            assert!(quality.sah > Some(0.0) && peer.epo(3.0, 2.0, Epo::On).expect("on the host") > Some(0.0));
            let (plain, rays) = (tree_of(&mesh), rays(&mesh));
            let hits = peer.hits_of(&rays, Query::ClosestHit).expect("one hit a ray");
            let by_force: Vec<Hit> = rays.iter().map(|ray| host::closest_hit_by_brute_force(&plain, ray)).collect();
            assert_eq!(hits, by_force, "{scene}, {builder}");
            let any = peer.hits_of(&rays, Query::AnyHit).expect("one hit a ray");
            assert!(any.iter().zip(&by_force).all(|(a, b)| a.is_some() == b.is_some()), "{scene}, {builder}");
            let work = peer.work(Query::ClosestHit).expect("on the host").expect("our tracer counts");
            assert!(work.iter().any(|work| work.steps > 0 && work.tests > 0));
        }
    }

    #[test]
    fn trees_of_embree_leave_out_what_is_broken_and_hold_what_is_small() {
        for builder in TREES {
            let mut mesh = soup();
            mesh.positions[0] = [f32::NAN; 3];
            let broken = mesh.triangles.iter().filter(|triangle| triangle.contains(&0)).count();
            for count in [0, 1, 2, mesh.triangles.len()] {
                let part = Mesh { triangles: mesh.triangles[mesh.triangles.len() - count..].to_vec(), ..mesh.clone() };
                let mut peer = builder.parse::<Spec>().expect("known").make(None, &part).expect("it fits");
                peer.build().expect("it builds");
                peer.validate().unwrap_or_else(|error| panic!("{builder}, {count}: {error}"));
                let outcome = peer.outcome().expect("on the host").expect("our layout");
                let there = if count == mesh.triangles.len() { count - broken } else { count };
                assert!(outcome.active as usize >= there, "{builder}: {outcome:?}");
            }
        }
    }
}
