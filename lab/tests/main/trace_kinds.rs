//! The ray kinds: what the contract says of each, and that they are the same with any number of threads.

use crate::common::shapes::{Corners, icosphere, placed, tree_of};
use hedgerow::bvh::layout::Bvh2;
use hedgerow::trace::twin::tracer as host;
use hedgerow::trace::{Hit, Query, Ray};
use hedgerow_lab::rays::files;
use hedgerow_lab::rays::kinds::{RayKind, RayOptions, generate};
use hedgerow_lab::scene::{Camera, Light, Mesh, Scene};

const OPTIONS: RayOptions = RayOptions { size: [24, 16], seed: 1 };

fn scene_of(corners: &Corners) -> Scene {
    Scene {
        name: "test".into(),
        mesh: Mesh {
            positions: corners.iter().flatten().copied().collect(),
            triangles: (0..corners.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        },
        camera: Camera { eye: [0.0, 0.0, 4.0], look: [0.0; 3], up: [0.0, 1.0, 0.0], fov: 40.0 },
        lights: Vec::new(),
    }
}

fn rays_of(kind: RayKind, scene: &Scene, tree: &Bvh2) -> Vec<Ray> {
    generate(kind, scene, &OPTIONS, &mut |rays| Ok(closest(tree, rays))).expect("the scene has triangles")
}

fn closest(tree: &Bvh2, rays: &[Ray]) -> Vec<Hit> {
    rays.iter().map(|ray| host::closest_hit(tree, ray)).collect()
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

fn length(a: [f32; 3]) -> f32 {
    dot(a, a).sqrt()
}

/// A sphere of radius 1 above a floor at y = −1.
fn sphere_on_floor() -> Corners {
    let mut corners = icosphere(3);
    let far = 50.0;
    corners.push([[-far, -1.0, -far], [far, -1.0, -far], [-far, -1.0, far]]);
    corners.push([[far, -1.0, far], [far, -1.0, -far], [-far, -1.0, far]]);
    corners
}

#[test]
fn primary_rays_go_through_the_centres_of_pixels_from_the_top_left() {
    let corners = icosphere(0);
    let rays = rays_of(RayKind::Primary, &scene_of(&corners), &tree_of(&corners));
    assert_eq!(rays.len(), 24 * 16);
    let tangent = 20f32.to_radians().tan();
    for (pixel, ray) in rays.iter().enumerate() {
        // The camera looks along −z: pixel centres lie on the plane z = −1 as a grid of squares.
        let [x, y] = [0, 1].map(|i| ray.direction[i] / -ray.direction[2]);
        let (column, row) = ((pixel % 24) as f32, (pixel / 24) as f32);
        assert!((x - tangent * (column - 11.5) / 8.0).abs() < 1e-6 && (y - tangent * (7.5 - row) / 8.0).abs() < 1e-6);
        assert!((length(ray.direction) - 1.0).abs() < 1e-6);
        assert_eq!((ray.origin, ray.t_min, ray.t_max), ([0.0, 0.0, 4.0], 0.0, f32::INFINITY));
    }
}

#[test]
fn counts_follow_from_the_hits_before() {
    let corners = sphere_on_floor();
    let (mut scene, tree) = (scene_of(&corners), tree_of(&corners));
    let count = |kind: RayKind, scene: &Scene| rays_of(kind, scene, &tree).len();
    let hits_of = |kind: RayKind, scene: &Scene| {
        closest(&tree, &rays_of(kind, scene, &tree)).iter().filter(|hit| hit.is_some()).count()
    };
    let primary = hits_of(RayKind::Primary, &scene);
    assert!(primary > 0 && primary < 24 * 16);
    assert_eq!(count(RayKind::Random, &scene), 24 * 16);
    assert_eq!(count(RayKind::Ao, &scene), 4 * primary);
    assert_eq!(count(RayKind::Reflection, &scene), primary);
    assert_eq!(count(RayKind::Diffuse1, &scene), primary);
    assert_eq!(count(RayKind::Diffuse2, &scene), hits_of(RayKind::Diffuse1, &scene));
    assert_eq!(count(RayKind::Shadow, &scene), primary);
    let light = |x| Light { corner: [x, 9.0, 0.0], edges: [[0.0; 3]; 2] };
    scene.lights = vec![light(-3.0), light(3.0)];
    assert_eq!(count(RayKind::Shadow, &scene), 2 * primary);
}

#[test]
fn shadow_rays_end_just_before_their_light() {
    let corners = sphere_on_floor();
    let mut scene = scene_of(&corners);
    scene.lights = vec![Light { corner: [1.0, 9.0, 2.0], edges: [[4.0, 0.0, 0.0], [0.0, 0.0, 2.0]] }];
    for ray in rays_of(RayKind::Shadow, &scene, &tree_of(&corners)) {
        let [x, y, z] = std::array::from_fn(|i| ray.origin[i] + ray.direction[i]);
        assert!((1.0..=5.0).contains(&x) && (y - 9.0).abs() < 1e-4 && (2.0..=4.0).contains(&z), "{ray:?}");
        assert!(ray.t_max < 1.0 && ray.t_max > 0.999);
    }
}

#[test]
fn random_rays_join_two_points_of_the_sphere_around_the_box() {
    let corners = placed(&icosphere(2), 2.0, [10.0, 0.0, 0.0]);
    let scene = scene_of(&corners);
    let bounds = scene.mesh.bounds();
    let radius = bounds.diagonal() / 2.0;
    for ray in rays_of(RayKind::Random, &scene, &tree_of(&corners)) {
        for t in [0.0, 1.0] {
            let from_centre = std::array::from_fn(|i| ray.origin[i] + t * ray.direction[i] - bounds.centroid()[i]);
            assert!((length(from_centre) - radius).abs() < 1e-4 * radius);
        }
        assert_eq!((ray.t_min, ray.t_max), (0.0, 1.0));
    }
}

/// Where the scene is and how large must not matter: what leaves a surface never meets the triangle that it left.
#[test]
fn no_ray_meets_the_triangle_it_leaves() {
    for (scale, offset) in
        [(1.0, [0.0; 3]), (1e-6, [0.0; 3]), (1e6, [0.0; 3]), (1.0, [1e4, 0.0, 0.0]), (1.0, [-300.0, 2e3, 5e4])]
    {
        let corners = placed(&sphere_on_floor(), scale, offset);
        let (mut scene, tree) = (scene_of(&corners), tree_of(&corners));
        let camera = &mut scene.camera;
        (camera.eye, camera.look) = (std::array::from_fn(|i| camera.eye[i] * scale + offset[i]), offset);
        let primary = rays_of(RayKind::Primary, &scene, &tree);
        let left: Vec<u32> = closest(&tree, &primary).iter().filter(|h| h.is_some()).map(|h| h.primitive).collect();
        for kind in [RayKind::Reflection, RayKind::Diffuse1, RayKind::Ao] {
            let rays = rays_of(kind, &scene, &tree);
            for (i, ray) in rays.iter().enumerate() {
                let own = left[i * left.len() / rays.len()];
                let met = host::closest_hit(&tree, ray);
                assert_ne!(met.primitive, own, "{kind} at scale {scale:e}, offset {offset:?}: {ray:?} {met:?}");
            }
        }
    }
}

/// The mean cosine of cosine-weighted directions is 2/3.
#[test]
fn diffuse_rays_are_cosine_weighted() {
    let floor = vec![[[-1e3, 0.0, -1e3], [1e3, 0.0, -1e3], [0.0, 0.0, 2e3]]];
    let mut scene = scene_of(&floor);
    (scene.camera.eye, scene.camera.up) = ([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    let rays = generate(RayKind::Diffuse1, &scene, &RayOptions { size: [200, 200], seed: 3 }, &mut |rays| {
        Ok(closest(&tree_of(&floor), rays))
    })
    .expect("the floor is there");
    let mean = rays.iter().map(|ray| f64::from(ray.direction[1])).sum::<f64>() / rays.len() as f64;
    // The deviation of one cosine is √(1/2 − 4/9) ≈ 0.24, of the mean of 40,000 about 0.0012.
    assert!((mean - 2.0 / 3.0).abs() < 0.006, "{mean}");
    assert!(rays.iter().all(|ray| ray.direction[1] >= 0.0 && ray.origin[1] > 0.0));
}

#[test]
fn rays_do_not_depend_on_the_number_of_threads_but_on_the_seed() {
    let corners = sphere_on_floor();
    let (scene, tree) = (scene_of(&corners), tree_of(&corners));
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool of one thread");
    for kind in RayKind::ALL {
        assert_eq!(rays_of(kind, &scene, &tree), alone.install(|| rays_of(kind, &scene, &tree)), "{kind}");
        assert_eq!(kind.name().parse::<RayKind>().expect("its own name"), kind);
    }
    let other = RayOptions { seed: 2, ..OPTIONS };
    let rays = generate(RayKind::Random, &scene, &other, &mut |rays| Ok(closest(&tree, rays))).expect("as before");
    assert_ne!(rays, rays_of(RayKind::Random, &scene, &tree));
    assert_eq!(RayKind::Ao.query(), Query::AnyHit);
    assert_eq!(RayKind::Diffuse2.query(), Query::ClosestHit);
}

#[test]
fn sizes_and_names_that_cannot_be_are_refused() {
    let scene = scene_of(&icosphere(0));
    for size in [[0, 5], [1 << 14, 1 << 14]] {
        let refused = generate(RayKind::Primary, &scene, &RayOptions { size, seed: 0 }, &mut |_| Ok(Vec::new()));
        assert!(refused.expect_err("too few or too many").to_string().contains("size"));
    }
    assert!("dust".parse::<RayKind>().expect_err("no such kind").to_string().contains("diffuse1"));
    let empty = Scene { mesh: Mesh::default(), ..scene };
    assert!(generate(RayKind::Primary, &empty, &OPTIONS, &mut |_| Ok(Vec::new())).is_err());
}

#[test]
fn files_give_back_what_was_written_and_say_when_they_are_cut_off() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("rays.bin");
    let corners = icosphere(1);
    let (scene, tree) = (scene_of(&corners), tree_of(&corners));
    let rays = rays_of(RayKind::Random, &scene, &tree);
    files::write_rays(&path, &rays).expect("the folder can be written");
    assert_eq!(std::fs::metadata(&path).expect("just written").len(), 32 * rays.len() as u64);
    assert_eq!(files::read_rays(&path).expect("just written"), rays);
    let hits = closest(&tree, &rays);
    files::write_hits(&path, &hits).expect("the folder can be written");
    assert_eq!(files::read_hits(&path).expect("just written"), hits);

    std::fs::write(&path, [0; 63]).expect("the folder can be written");
    let message = files::read_rays(&path).expect_err("not two rays").to_string();
    assert!(message.contains("rays.bin: 63 bytes") && message.contains("cut off"), "{message}");
    let nowhere = files::read_rays(folder.path().join("none.bin")).expect_err("no such file").to_string();
    assert!(nowhere.contains("none.bin"), "{nowhere}");
}
