//! Generators of instances: what is shared, where it stands, and which boxes overlap.

use hedgerow::geometry::Aabb;
use hedgerow_lab::Error;
use hedgerow_lab::scene::{self, Instances, LoadOptions};

type Triangle = [[f64; 3]; 3];

fn generate(spec: &str) -> Instances {
    scene::load_instances(spec, &LoadOptions::default()).expect(spec)
}

/// The triangles of an instance in world space.
fn placed(scene: &Instances, instance: usize) -> Vec<Triangle> {
    let instance = &scene.instances[instance];
    let part = &scene.parts[instance.part as usize];
    let rows = instance.transform.map(|row| row.map(f64::from));
    let place = |p: [f32; 3]| {
        let [x, y, z] = p.map(f64::from);
        rows.map(|[a, b, c, d]| a * x + b * y + c * z + d)
    };
    (0..part.triangles.len()).map(|t| part.corners(t).map(place)).collect()
}

/// A box, as its least and its greatest corner.
type Bounds = [[f64; 3]; 2];

fn bounds(triangles: &[Triangle]) -> Bounds {
    let corners = || triangles.iter().flatten();
    let least = |i: usize| corners().map(|c| c[i]).fold(f64::INFINITY, f64::min);
    let greatest = |i: usize| corners().map(|c| c[i]).fold(f64::NEG_INFINITY, f64::max);
    [[least(0), least(1), least(2)], [greatest(0), greatest(1), greatest(2)]]
}

fn all_bounds(scene: &Instances) -> Vec<Bounds> {
    (0..scene.instances.len()).map(|i| bounds(&placed(scene, i))).collect()
}

/// How far two boxes overlap along an axis; negative: the gap between them.
fn overlap(a: &Bounds, b: &Bounds, axis: usize) -> f64 {
    a[1][axis].min(b[1][axis]) - a[0][axis].max(b[0][axis])
}

fn overlaps(a: &Bounds, b: &Bounds) -> bool {
    (0..3).all(|axis| overlap(a, b, axis) >= 0.0)
}

fn is_inside(point: &[f64; 3], bounds: &Bounds) -> bool {
    (0..3).all(|i| bounds[0][i] <= point[i] && point[i] <= bounds[1][i])
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The area of all triangles over that of the box around them.
fn fullness(triangles: &[Triangle]) -> f64 {
    let area = |[a, b, c]: &Triangle| {
        let n = cross(minus(*b, *a), minus(*c, *a));
        0.5 * dot(n, n).sqrt()
    };
    let [lo, hi] = bounds(triangles);
    let [x, y, z] = minus(hi, lo);
    triangles.iter().map(area).sum::<f64>() / (2.0 * (x * y + y * z + z * x))
}

/// Whether the segment from `p` to `q` meets a triangle, by the signs of the volumes that they span.
fn meets([p, q]: [[f64; 3]; 2], [a, b, c]: &Triangle) -> bool {
    let volume = |a, b, c, d| dot(minus(a, d), cross(minus(b, d), minus(c, d)));
    let sides = [volume(*a, *b, *c, p), volume(*a, *b, *c, q)];
    let around = [volume(p, q, *a, *b), volume(p, q, *b, *c), volume(p, q, *c, *a)];
    sides[0] * sides[1] <= 0.0 && (around.iter().all(|&v| v >= 0.0) || around.iter().all(|&v| v <= 0.0))
}

/// Whether two closed surfaces have no point in common and neither is inside the other.
fn are_separate(a: &[Triangle], b: &[Triangle]) -> bool {
    let boxes = [bounds(a), bounds(b)];
    let near = |triangles: &[Triangle], other: &Bounds| -> Vec<Triangle> {
        triangles.iter().copied().filter(|t| overlaps(&bounds(&[*t]), other)).collect()
    };
    let crosses = |edges: &[Triangle], faces: &[Triangle]| {
        edges.iter().any(|t| {
            let around = bounds(&[*t]);
            let edges = [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]];
            faces.iter().any(|f| overlaps(&around, &bounds(&[*f])) && edges.iter().any(|&edge| meets(edge, f)))
        })
    };
    // From inside, every way out goes through the surface an odd number of times.
    let holds = |surface: &[Triangle], point: [f64; 3]| {
        let far = [point[0] + 97.0, point[1] + 61.3, point[2] + 73.9];
        surface.iter().filter(|t| meets([point, far], t)).count() % 2 == 1
    };
    let (near_a, near_b) = (near(a, &boxes[1]), near(b, &boxes[0]));
    !crosses(&near_a, &near_b) && !crosses(&near_b, &near_a) && !holds(a, b[0][0]) && !holds(b, a[0][0])
}

#[test]
fn there_are_as_many_instances_as_asked_of_a_few_parts() {
    // The triangles of each part as the folder of scenes' README tells them.
    let generators: [(&str, &[usize]); 4] =
        [("forest", &[412, 628, 964]), ("city", &[1020, 940]), ("cables", &[600; 4]), ("cells", &[80, 320, 1280])];
    for (name, triangles) in generators {
        for count in [1, 2, 7, 8, 9, 100] {
            let spec = format!("gen:{name}:{count}");
            let scene = generate(&spec);
            assert_eq!((scene.name.as_str(), scene.instances.len()), (spec.as_str(), count));
            assert_eq!(scene.parts.iter().map(|p| p.triangles.len()).collect::<Vec<_>>(), triangles);
            let flat = scene.flatten().expect(&spec);
            assert_eq!(flat.triangles.len() as u64, scene.triangle_count());
            assert_eq!(flat.bounds(), scene.bounds(), "{spec}");
            let mesh = scene::load(&spec, &LoadOptions::default()).expect(&spec);
            assert_eq!((mesh.name.as_str(), mesh.camera), (spec.as_str(), scene.camera));
            // Outside, beyond every triangle along each axis, and looking at the middle; in the city in its midst.
            let (bounds, camera) = (scene.bounds(), scene.camera);
            let is_outside = (0..3).all(|i| camera.eye[i] > bounds.hi[i]) && camera.look == bounds.centroid();
            assert!(is_outside || name == "city", "{camera:?}");
            assert!(mesh.mesh.positions == flat.positions && mesh.mesh.triangles == flat.triangles, "{spec}");
        }
        let scene = generate(&format!("gen:{name}:100"));
        for part in 0..triangles.len() as u32 {
            assert!(scene.instances.iter().filter(|i| i.part == part).count() > 5, "{name}: part {part} is shared");
        }
    }
}

#[test]
fn the_same_name_gives_the_same_instances_and_no_two_stand_alike() {
    for name in ["forest", "city", "cables", "cells"] {
        let [a, b] = [(); 2].map(|()| generate(&format!("gen:{name}:200")));
        assert_eq!(a.instances, b.instances);
        for (a, b) in a.parts.iter().zip(&b.parts) {
            assert!(a.positions == b.positions && a.triangles == b.triangles, "{name}");
        }
        for (i, instance) in a.instances.iter().enumerate() {
            assert!(!a.instances[..i].iter().any(|other| other.transform == instance.transform), "{name} {i}");
        }
    }
}

#[test]
fn instances_are_not_mirrored_and_keep_angles_on_the_ground() {
    for name in ["forest", "city", "cables", "cells"] {
        for instance in generate(&format!("gen:{name}:100")).instances {
            let [x, y, z]: [[f64; 3]; 3] =
                std::array::from_fn(|column| std::array::from_fn(|row| f64::from(instance.transform[row][column])));
            assert!(dot(cross(x, y), z) > 0.0, "{name}: {instance:?}");
            assert!((dot(x, x) - dot(z, z)).abs() < 1e-6 && dot(x, z).abs() < 1e-6, "{name}: {instance:?}");
            if name == "forest" {
                // No part is bent, and the trunk is 26 to 51 degrees off the vertical.
                assert!((dot(x, x) - dot(y, y)).abs() < 1e-6 && dot(x, y).abs() < 1e-6, "{instance:?}");
                let lean = (y[1] / dot(y, y).sqrt()).acos().to_degrees();
                assert!((26.0..51.0).contains(&lean), "{lean}");
            } else {
                assert_eq!((y[0], y[2]), (0.0, 0.0));
            }
        }
    }
}

#[test]
fn trees_lean_all_ways_and_over_each_other() {
    const SIDE: usize = 20;
    let scene = generate("gen:forest:400");
    let trees: Vec<Vec<Triangle>> = (0..SIDE * SIDE).map(|i| placed(&scene, i)).collect();
    let boxes: Vec<Bounds> = trees.iter().map(|t| bounds(t)).collect();
    let mut depths = Vec::new();
    let mut quarters = [0; 4];
    for (i, tree) in trees.iter().enumerate() {
        assert!(fullness(tree) < 0.25, "{i}: a thin trunk and a small crown, but {}", fullness(tree));
        // A foot on the ground, in the midst of others' boxes.
        assert!((-0.5..0.5).contains(&boxes[i][0][1]), "{i}: {:?}", boxes[i]);
        let is_inner = [i % SIDE, i / SIDE].iter().all(|c| (5..SIDE - 5).contains(c));
        let middle = std::array::from_fn(|k| 0.5 * (boxes[i][0][k] + boxes[i][1][k]));
        if is_inner {
            depths.push(boxes.iter().filter(|b| is_inside(&middle, b)).count());
        }
        let transform = scene.instances[i].transform;
        quarters[usize::from(transform[0][1] > 0.0) + 2 * usize::from(transform[2][1] > 0.0)] += 1;
    }
    // A trunk 19 m long that leans by 38 degrees reaches 12 m; its box covers 43 m² on average, and a tree has 4.8.
    let mean = depths.iter().sum::<usize>() as f64 / depths.len() as f64;
    assert!(mean > 7.0, "{mean}: {depths:?}");
    assert!(quarters.iter().all(|&n| n > 70), "{quarters:?}");
}

#[test]
fn blocks_stand_in_each_others_boxes_and_touch_nowhere() {
    const COUNT: usize = 100;
    let scene = generate("gen:city:100");
    let blocks: Vec<Vec<Triangle>> = (0..COUNT).map(|i| placed(&scene, i)).collect();
    let boxes: Vec<Bounds> = blocks.iter().map(|t| bounds(t)).collect();
    let mut depths = Vec::new();
    for i in 0..COUNT {
        let mut shares = Vec::new();
        for j in (0..COUNT).filter(|&j| j != i && overlaps(&boxes[i], &boxes[j])) {
            assert!(j < i || are_separate(&blocks[i], &blocks[j]), "{i} and {j}");
            let ground = |b: &Bounds| overlap(b, b, 0) * overlap(b, b, 2);
            shares.push(overlap(&boxes[i], &boxes[j], 0) * overlap(&boxes[i], &boxes[j], 2) / ground(&boxes[i]));
        }
        // Each stands nearly all in its neighbour's box, and in the middle of it, still in others', nine on average.
        assert!(shares.iter().any(|&share| share > 0.75), "{i}: {shares:?}");
        let middle = [0, 2].map(|k| 0.5 * (boxes[i][0][k] + boxes[i][1][k]));
        let holds = |b: &Bounds| [0, 2].iter().zip(middle).all(|(&k, x)| b[0][k] <= x && x <= b[1][k]);
        depths.push((0..COUNT).filter(|&j| j != i && holds(&boxes[j])).count());
        assert!(fullness(&blocks[i]) < 1.0, "{i}: walls on two sides of four, but {}", fullness(&blocks[i]));
    }
    assert!(depths.iter().all(|&n| n >= 3) && depths.iter().sum::<usize>() > 8 * COUNT, "{depths:?}");
    // All four quarters of a circle, give or take a few degrees.
    let quarters = scene.instances.iter().map(|i| (i.transform[0][0], i.transform[2][0])).map(|(c, s)| {
        assert!(c.abs().min(s.abs()) < 0.1, "{c} {s}");
        (c.round() as i32, s.round() as i32)
    });
    assert_eq!(quarters.collect::<std::collections::HashSet<_>>().len(), 4);
    // The camera stands in a street: between walls, and in the boxes of many.
    let camera = scene.camera.eye.map(f64::from);
    assert!(boxes.iter().filter(|b| is_inside(&camera, b)).count() >= 8, "{camera:?}");
    let ahead = [camera, [camera[0], camera[1], camera[2] - 0.1]];
    assert!(!blocks.iter().flatten().any(|t| meets(ahead, t)), "the camera looks at a wall");
}

#[test]
fn what_tests_for_separate_blocks_sees_those_that_are_not() {
    let block = placed(&generate("gen:city:8"), 0);
    let moved = |triangles: &[Triangle], by: [f64; 3]| -> Vec<Triangle> {
        triangles.iter().map(|t| t.map(|c| std::array::from_fn(|i| c[i] + by[i]))).collect()
    };
    assert!(!are_separate(&block, &moved(&block, [0.05, 0.0, 0.01])));
    assert!(!are_separate(&block, &moved(&block, [0.0, 0.01, 0.0])));
    assert!(are_separate(&block, &moved(&block, [2.0, 0.0, 0.0])));
    // A column in a column: no surface crosses, but one is inside.
    let column = placed(&generate("gen:twist:12:1"), 0);
    let half: Vec<Triangle> = column.iter().map(|t| t.map(|c| c.map(|x| 0.5 * x))).collect();
    assert!(!are_separate(&column, &moved(&half, [0.0, 1.0, 0.0])));
    assert!(are_separate(&column, &moved(&half, [0.0, 5.0, 0.0])));
}

#[test]
fn cables_are_thin_and_nearly_all_of_their_boxes_overlap() {
    let scene = generate("gen:cables:60");
    let boxes = all_bounds(&scene);
    let pairs = (0..60).flat_map(|i| (0..i).map(move |j| (i, j)));
    let overlapping = pairs.filter(|&(i, j)| overlaps(&boxes[i], &boxes[j])).count();
    assert!(overlapping > 60 * 59 / 2 * 6 / 10, "{overlapping}");
    for (i, [lo, hi]) in boxes.into_iter().enumerate() {
        let cable = placed(&scene, i);
        assert!(fullness(&cable) < 0.01, "{i}: {}", fullness(&cable));
        // Along a diagonal of the ground: as far in x as in z, up to a quarter.
        let [x, _, z] = minus(hi, lo);
        assert!((0.75..1.34).contains(&(x / z)), "{i}: {x} {z}");
    }
}

#[test]
fn a_cable_hangs_in_a_catenary() {
    // Of span 1 with y = cosh((x − 1/2) / t) · t for t = 1/2: it sags by t · (cosh 1 − 1), and is t · 2 · sinh 1 long.
    let scene = generate("gen:cables:1");
    let rings: Vec<[f64; 3]> = scene.parts[0]
        .positions
        .chunks(5)
        .map(|ring| std::array::from_fn(|i| ring.iter().map(|p| f64::from(p[i])).sum::<f64>() / 5.0))
        .collect();
    let lowest = rings.iter().map(|p| p[1]).fold(f64::INFINITY, f64::min);
    assert!((lowest + 0.5 * (1_f64.cosh() - 1.0)).abs() < 1e-5, "{lowest}");
    let length: f64 = rings.windows(2).map(|w| minus(w[1], w[0])).map(|d| dot(d, d).sqrt()).sum();
    assert!((length - 1_f64.sinh()).abs() < 1e-4, "{length}");
}

#[test]
fn cells_keep_to_themselves() {
    for count in [8, 200] {
        let boxes = all_bounds(&generate(&format!("gen:cells:{count}")));
        for i in 0..count {
            for j in 0..i {
                // Radii are at most 0.9 in cells of 2.
                assert!((0..3).any(|axis| overlap(&boxes[i], &boxes[j], axis) < -0.19), "{i} {j}");
            }
        }
    }
}

#[test]
fn millions_of_instances_are_no_mesh_but_a_scene_all_the_same() {
    let spec = "gen:cells:1000000";
    let scene = generate(spec);
    assert_eq!(scene.instances.len(), 1_000_000);
    // A cube of 100 cells of 2 along each side; spheres fill at least half a cell's width.
    let Aabb { lo, hi } = scene.bounds();
    assert!((0..3).all(|i| (0.0..0.5).contains(&lo[i]) && (199.5..200.0).contains(&hi[i])), "{lo:?} {hi:?}");
    let error = scene::load(spec, &LoadOptions::default()).expect_err("too many triangles for a mesh");
    assert!(
        matches!(&error, Error::Scene(what) if what.starts_with(spec) && what.contains("fewer instances")),
        "{error}"
    );
}
