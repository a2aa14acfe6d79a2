//! The example engine draws its picture: a device with exactly the requirements, the engine's own memory and command buffer,
//! and rays by the header that it includes.

#[path = "../examples/engine.rs"]
mod example;

use example::{EYE, HEIGHT, LAMP, Model, PLACES, WIDTH};
use glam::Vec3;
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::layout::Bvh2;
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::lbvh;
use hedgerow::trace::twin::tracer as host;
use hedgerow::trace::{Hit, Ray};

/// How bright the light of the lamp makes a pixel, and whether there is anything: engine.comp, with the host's tracer.
fn light(tree: &Bvh2, corners: &dyn Fn(u32) -> [Vec3; 3], pixel: u32) -> Option<f32> {
    let [x, y] =
        [(pixel % WIDTH, WIDTH), (pixel / WIDTH, HEIGHT)].map(|(at, of)| (at as f32 + 0.5) / of as f32 * 2.0 - 1.0);
    let (eye, lamp) = (Vec3::from(EYE), Vec3::from(LAMP));
    let forward = (-eye).normalize();
    let right = forward.cross(Vec3::Y).normalize();
    let up = right.cross(forward);
    let direction = forward + 0.4 * (x * right * WIDTH as f32 / HEIGHT as f32 - y * up);
    let trace = |origin: Vec3, direction: Vec3, t_max: f32| -> Hit {
        host::closest_hit(tree, &Ray { origin: origin.into(), t_min: 0.0, direction: direction.into(), t_max })
    };
    let hit = trace(eye, direction, 1e30);
    hit.is_some().then(|| {
        let [a, b, c] = corners(hit.primitive);
        let normal = (b - a).cross(c - a).normalize();
        let normal = if normal.dot(direction) > 0.0 { -normal } else { normal };
        let point = eye + hit.t * direction + 1e-3 * normal;
        let shadowed = trace(point, lamp - point, 1.0).is_some();
        0.2 + if shadowed { 0.0 } else { 0.8 * normal.dot((lamp - point).normalize()).max(0.0) }
    })
}

#[test]
fn a_foreign_engine_draws_what_the_host_traces() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("engine.png");
    example::draw(&path).expect("the engine draws");
    let picture = image::open(&path).expect("a picture").into_rgb8();
    assert_eq!(picture.dimensions(), (WIDTH, HEIGHT));

    // Every instance written out.
    let model = Model::knot_and_floor();
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for (part, rows) in PLACES {
        let first = positions.len() as u32;
        positions.extend(model.positions.iter().map(|p| rows.map(|[a, b, c, d]| a * p[0] + b * p[1] + c * p[2] + d)));
        let part = model.parts[part].start as usize..model.parts[part].end as usize;
        triangles.extend(model.triangles[part].iter().map(|t| t.map(|v| v + first)));
    }
    let tree = lbvh::build(&positions, &triangles, Code::Mc63.full(), Collapse::OFF);
    let corners = |triangle: u32| triangles[triangle as usize].map(|vertex| Vec3::from(positions[vertex as usize]));
    let expected: Vec<Option<f32>> = (0..WIDTH * HEIGHT).map(|pixel| light(&tree, &corners, pixel)).collect();
    let (lit, dark) = expected.iter().flatten().partition::<Vec<f32>, _>(|&&light| light > 0.2);
    assert!(
        lit.len() > 10_000 && dark.len() > 3_000,
        "the picture shows {} lit and {} dark pixels",
        lit.len(),
        dark.len()
    );

    // Rays through the middle of an edge or along a shadow's border may differ by the last bit of their direction.
    let differs = |(pixel, light): (usize, &Option<f32>)| {
        let [red, _, blue] = picture.get_pixel(pixel as u32 % WIDTH, pixel as u32 / WIDTH).0.map(f32::from);
        match light {
            None => red >= blue,
            Some(light) => (red - 255.0 * (0.9 * light).sqrt()).abs() > 2.0,
        }
    };
    let different = expected.iter().enumerate().filter(|&at| differs(at)).count();
    assert!(different <= 40, "{different} of {} pixels differ", expected.len());
}
