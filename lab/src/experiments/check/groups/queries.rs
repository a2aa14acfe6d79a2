//! What queries report through top levels, in a shader that is not ours: against brute force in double precision.

use crate::device::Device;
use crate::experiments::check::agree::assert_agrees;
use crate::experiments::check::backend::{Backend, Ours};
use crate::experiments::check::cases::{Cases, Found, same};
use crate::experiments::check::matrices::{Matrix, moved, rotation, scaled};
use crate::experiments::check::probe::{
    CONFIRM, CONFIRM_ODD, IGNORE, Probe, ProbeRay, ProbeReport, TERMINATE, Told, flags,
};
use crate::experiments::check::shapes::{Corners, boxes as random_boxes, icosphere, soup};
use crate::experiments::check::world::{Part, World, inverse, transformed};
use crate::random::SplitMix64;
use anyhow::ensure;
use ash::vk;
use glam::Vec3;
use hedgerow::accel::{AccelOptions, Instance, REBRAID, Wide};
use vk::{GeometryFlagsKHR as GeometryFlags, GeometryInstanceFlagsKHR as Flags};

/// The world's reports are right, and enough rays hit for that to say something.
fn agrees(device: &'static Device, what: &str, world: &World, rays: &[ProbeRay], least_hits: usize) -> Found {
    let hits = assert_agrees(&Ours::on(device), what, world, rays);
    ensure!(hits >= least_hits, "{hits} rays hit, expected {least_hits} or more");
    Ok(())
}

fn triangles(corners: Corners, flags: GeometryFlags) -> Part {
    Part::Triangles(vec![(corners, flags)])
}

/// A matrix that turns, shears, mirrors, scales and moves; not so flat that float32 has little to say of where a ray goes.
fn any_matrix(random: &mut SplitMix64) -> Matrix {
    loop {
        let m: Matrix = [(); 3].map(|()| [random.signed(), random.signed(), random.signed(), 4.0 * random.signed()]);
        if inverse(&m).iter().flatten().fold(0f64, |a, b| a.max(b.abs())) < 12.0 {
            return m;
        }
    }
}

/// Three parts of triangles and boxes, opaque or not, seen thirty times.
fn mixed_world(seed: u64) -> World {
    let mut random = SplitMix64::new(seed);
    let none = GeometryFlags::empty();
    let parts = vec![
        Part::Triangles(vec![(soup(20, 0.5, seed), GeometryFlags::OPAQUE), (soup(15, 0.5, seed + 1), none)]),
        triangles(soup(40, 0.4, seed + 2), GeometryFlags::OPAQUE),
        Part::Boxes(vec![
            (random_boxes(6, 0.2, seed + 3), none),
            (random_boxes(5, 0.2, seed + 4), GeometryFlags::OPAQUE),
        ]),
    ];
    let kinds = [
        Flags::empty(),
        Flags::TRIANGLE_FACING_CULL_DISABLE,
        Flags::TRIANGLE_FLIP_FACING,
        Flags::FORCE_OPAQUE,
        Flags::FORCE_NO_OPAQUE,
        Flags::TRIANGLE_FLIP_FACING | Flags::FORCE_NO_OPAQUE,
    ];
    let instances = (0..30)
        .map(|i| {
            let part = 1 + random.bits() % 3;
            let structure = if i % 7 == 6 { 0 } else { part };
            let (index, mask) = (random.bits() as u32 & 0xff_ffff, 1 << (random.bits() % 8));
            let (offset, flags) = (random.bits() as u32 & 0xff_ffff, kinds[random.bits() as usize % 6]);
            let transform = if i == 3 { Instance::IDENTITY } else { any_matrix(&mut random) };
            Instance::new(structure, transform).with_index_and_mask(index, mask).with_offset_and_flags(offset, flags)
        })
        .collect();
    World::new(parts, instances)
}

fn rays_of(seed: u64, count: usize) -> Vec<ProbeRay> {
    let mut random = SplitMix64::new(seed);
    let ray = |_| {
        let (origin, target) = (random.around(6.0), random.around(3.0));
        let scale = 10f32.powf(2.0 * random.signed());
        ProbeRay::new(origin, std::array::from_fn(|k| scale * (target[k] - origin[k])))
    };
    (0..count).map(ray).collect()
}

pub fn flags_and_decisions(cases: &mut Cases<'_>) {
    let ray_flags = [
        flags::NONE,
        flags::OPAQUE,
        flags::NO_OPAQUE,
        flags::FIRST_HIT,
        flags::CULL_BACK,
        flags::CULL_FRONT,
        flags::CULL_OPAQUE,
        flags::CULL_NO_OPAQUE,
        flags::SKIP_TRIANGLES,
        flags::SKIP_BOXES,
        flags::CULL_BACK | flags::NO_OPAQUE,
        flags::SKIP_BOXES | flags::CULL_FRONT | flags::FIRST_HIT,
    ];
    let worlds = [(false, 1, false), (true, 2, true), (true, 2, false), (false, 1, true)];
    let each = if cases.quick { 5 } else { 20 };
    for (by_pointers, seed, rebraids) in worlds.into_iter().take(if cases.quick { 2 } else { 4 }) {
        let mut world = World { by_pointers, ..mixed_world(seed) };
        if rebraids {
            world.flags = REBRAID;
        }
        let mut base = rays_of(seed, 600).into_iter().cycle();
        let mut all = Vec::new();
        for flags in ray_flags {
            for decision in [IGNORE, CONFIRM, CONFIRM_ODD, TERMINATE] {
                for mask in [0xff, 0x0f, 0x81] {
                    all.extend(base.by_ref().take(each).enumerate().map(|(i, ray)| {
                        let t_max = [1e30, 0.9][i % 2];
                        ProbeRay { flags, decision, mask, t_max, generated_t: 0.25, ..ray }
                    }));
                }
            }
        }
        let what = format!("world {seed}, by pointers: {by_pointers}, re-braided: {rebraids}");
        cases.case(what.clone(), |device| agrees(device, &what, &world, &all, 20));
        cases.case(format!("{what}, rays in turn"), |device| in_turn(device, &world, &all));
        cases.case(format!("{what}, one level"), |device| one_level(device, &world, &all));
    }
    masks(cases);
}

/// What queries report does not depend on how many rays an invocation has, whichever goes on while others have ended, nor on how it loads.
fn in_turn(device: &'static Device, world: &World, rays: &[ProbeRay]) -> Found {
    reports_the_same(&Ours::on(device), &Probe::in_turn(device), world, rays, false)?;
    let Some(in_lanes) = Probe::in_lanes(device, Told::Nothing) else { return Ok(()) };
    [Wide::Never, Wide::ByFlags, Wide::Always].into_iter().try_for_each(|wide| {
        let options = AccelOptions { wide, ..AccelOptions::DEFAULT };
        reports_the_same(&Ours::with_options(device, options), &in_lanes, world, rays, true)
    })
}

/// As queries of one ray each report. Lanes that need nothing load from what turns are told of: another structure than their rays go into
/// will do, and of none nothing is met.
fn reports_the_same(ours: &Ours, probe: &Probe, world: &World, rays: &[ProbeRay], in_lanes: bool) -> Found {
    let built = world.build(ours);
    let top = ours.address(built.top.structure);
    let expected = ours.probe(built.top.structure, rays);
    same_reports("in turn", &probe.ask(top, rays), &expected, rays)?;
    let part = ours.address(built.parts[0].structure);
    same_reports("in turn, told of a part", &probe.ask_told(top, part, rays), &expected, rays)?;
    if in_lanes {
        meets_nothing(&probe.ask_told(top, 0, rays), "a top level, lanes told of none,")?;
    }
    let waited = expected.iter().filter(|report| report.candidate_count > 0).count();
    ensure!(waited > 20, "{waited} rays had candidates to decide on");
    Ok(())
}

/// A shader for bottom levels alone reports of each part what another one does, and nothing of a top level.
fn one_level(device: &'static Device, world: &World, rays: &[ProbeRay]) -> Found {
    let probe = Probe::of_one_level(device);
    let in_lanes: Vec<Probe> =
        [Told::OneLevel, Told::OneLevelBuilt].into_iter().filter_map(|told| Probe::in_lanes(device, told)).collect();
    for wide in [Wide::Never, Wide::Always] {
        let ours = Ours::with_options(device, AccelOptions { wide, ..AccelOptions::DEFAULT });
        let built = world.build(&ours);
        let top = ours.address(built.top.structure);
        let parts: Vec<u64> = built.parts.iter().map(|part| ours.address(part.structure)).collect();
        let mut hits = 0;
        for (i, part) in built.parts.iter().enumerate() {
            let expected = ours.probe(part.structure, rays);
            same_reports("of one level", &probe.ask(parts[i], rays), &expected, rays)?;
            hits += expected.iter().filter(|report| report.committed.kind != 0).count();
            let others = [parts[(i + 1) % parts.len()], top, 0];
            // None is no structure that is built.
            for (in_lanes, others) in in_lanes.iter().zip([&others[..], &others[..2]]) {
                same_reports("of one level, lane by lane", &in_lanes.ask(parts[i], rays), &expected, rays)?;
                for &told in others {
                    meets_nothing(
                        &in_lanes.ask_told(parts[i], told, rays),
                        "a part, lanes told of another structure or none,",
                    )?;
                }
            }
        }
        ensure!(hits > 20, "{hits} rays hit a part");
        for probe in [&probe].into_iter().chain(&in_lanes) {
            meets_nothing(&probe.ask(top, rays), "a top level")?;
        }
    }
    Ok(())
}

fn same_reports(how: &str, found: &[ProbeReport], expected: &[ProbeReport], rays: &[ProbeRay]) -> Found {
    for (i, (found, expected)) in found.iter().zip(expected).enumerate() {
        ensure!(found == expected, "ray {i}, {:?}: {found:?} {how}, {expected:?} by itself", rays[i]);
    }
    Ok(())
}

fn meets_nothing(reports: &[ProbeReport], what: &str) -> Found {
    let met = reports.iter().filter(|report| report.committed.kind != 0 || report.candidate_count != 0).count();
    ensure!(met == 0, "{what} was met by {met} rays");
    Ok(())
}

/// A ray sees the instances whose mask shares a bit with its own, whatever lies beside the mask.
fn masks(cases: &mut Cases<'_>) {
    let masks = [0u8, 1, 2, 4, 8, 0x10, 0x20, 0x40, 0x80, 0xff, 0x5a, 0xfe];
    let triangle = vec![[[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]]];
    for (index, offset, kind) in [(0xff_ffff, 0xff_ffff, Flags::FORCE_OPAQUE), (0, 0, Flags::empty())] {
        let place = |(i, &mask): (usize, &u8)| {
            Instance::new(1, moved(Instance::IDENTITY, [4.0 * i as f32, 0.0, 0.0]))
                .with_index_and_mask(index, mask)
                .with_offset_and_flags(offset, kind)
        };
        let part = triangles(triangle.clone(), GeometryFlags::empty());
        let world = World::new(vec![part], masks.iter().enumerate().map(place).collect());
        let to = |i: usize| ProbeRay::new([4.0 * i as f32 + 0.1, 0.05, -3.0], [0.0, 0.0, 1.0]);
        let rays: Vec<ProbeRay> = (0..masks.len())
            .flat_map(|i| masks.map(|mask| ProbeRay { mask: u32::from(mask), ..to(i) }))
            // Of a ray's mask eight bits count.
            .chain((0..masks.len()).map(|i| ProbeRay { mask: !0xff, ..to(i) }))
            .collect();
        let what = format!("masks beside index {index:#x}");
        cases.case(what.clone(), |device| {
            let hits = assert_agrees(&Ours::on(device), &what, &world, &rays);
            let shared = |mask: u8| masks.iter().filter(|&&other| other & mask != 0).count();
            same("hits", &hits, &masks.iter().map(|&mask| shared(mask)).sum())
        });
    }
}

/// A sphere shows its front outside and its back inside, however its instance is mirrored; and culling goes by that.
pub fn facing(cases: &mut Cases<'_>) {
    let outward = |[a, b, c]: [[f32; 3]; 3]| {
        let volume = Vec3::from(a).dot(Vec3::from(b).cross(c.into()));
        if volume > 0.0 { [a, b, c] } else { [a, c, b] }
    };
    let sphere: Corners = icosphere(2).into_iter().map(outward).collect();
    let kinds = [Flags::empty(), Flags::TRIANGLE_FLIP_FACING, Flags::TRIANGLE_FACING_CULL_DISABLE];
    let mirrored = scaled(rotation(2), [-1.0, 1.0, 1.0]);
    let mut random = SplitMix64::new(6);
    let rays: Vec<ProbeRay> = (0..180)
        .map(|i| {
            let way = random.around(1.0);
            let flags = [flags::NONE, flags::CULL_BACK, flags::CULL_FRONT][i % 3];
            ProbeRay { flags, ..ProbeRay::new(way.map(|x| -6.0 * x), way.map(|x| 1.01 * x + 0.003)) }
        })
        .collect();
    for (name, matrix) in [("plain", rotation(1)), ("mirrored", mirrored), ("inverted", scaled(rotation(3), [-2.0; 3]))]
    {
        for kind in kinds {
            let instance = Instance::new(1, matrix).with_offset_and_flags(0, kind);
            let world = World::new(vec![triangles(sphere.clone(), GeometryFlags::OPAQUE)], vec![instance]);
            let what = format!("{name}, {kind:?}");
            cases.case(what.clone(), |device| agrees(device, &what, &world, &rays, 60));
        }
    }
}

/// Rays in the space of an object in −1..1, brought to the world by its matrix.
fn rays_at(matrix: &Matrix, count: usize) -> Vec<ProbeRay> {
    let mut random = SplitMix64::new(5);
    let to_world = matrix.map(|row| row.map(f64::from));
    let bring = |p: [f32; 3], w| transformed(&to_world, p.map(f64::from), w).map(|x| x as f32);
    let ray = |i: usize| {
        let (origin, target) = (random.around([3.0, 0.7][i / 2 % 2]), random.around(0.8));
        let way = std::array::from_fn(|k| target[k] - origin[k]);
        let (flags, decision) = [(flags::SKIP_BOXES, CONFIRM), (flags::NO_OPAQUE, IGNORE)][i % 2];
        ProbeRay { flags, decision, ..ProbeRay::new(bring(origin, 1.0), bring(way, 0.0)) }
    };
    (0..count).map(ray).collect()
}

pub fn transforms(cases: &mut Cases<'_>) {
    let turned = |by: [f32; 3]| scaled(rotation(11), by);
    let mut sheared = rotation(12);
    sheared.iter_mut().for_each(|row| row[0] += 3.0 * row[1]);
    let matrices = [
        ("identity", Instance::IDENTITY),
        ("moved", moved(Instance::IDENTITY, [3.0, -20.0, 0.5])),
        ("turned", turned([1.0; 3])),
        ("axes exchanged", [[0.0, 0.0, 1.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]]),
        ("millionfold", turned([1e6; 3])),
        ("a millionth", turned([1e-6; 3])),
        ("flat", turned([1.0, 1.0, 0.01])),
        ("mirrored", turned([-1.0, 1.0, 1.0])),
        ("sheared", sheared),
        ("sheared, mirrored and moved", moved(scaled(sheared, [1.0, -0.5, 1.0]), [5.0, 6.0, -7.0])),
        ("large and far away", moved(turned([1e4; 3]), [1e6, -2e6, 1e6])),
    ];
    let none = GeometryFlags::empty();
    let parts =
        vec![triangles(soup(40, 0.5, 3), GeometryFlags::OPAQUE), Part::Boxes(vec![(random_boxes(12, 0.3, 4), none)])];
    for (name, matrix) in matrices {
        let world = World::new(parts.clone(), vec![Instance::new(1, matrix), Instance::new(2, matrix)]);
        cases.case(name, |device| agrees(device, name, &world, &rays_at(&matrix, 300), 20));
    }
    forest(cases);
}

/// Thousands of instances, each a different size, turned and moved.
fn forest(cases: &mut Cases<'_>) {
    let count = if cases.quick { 1000 } else { 20_000 };
    let tree = vec![
        [[-0.3, -0.3, 0.0], [0.3, -0.3, 0.0], [0.0, 0.0, 2.0]],
        [[0.3, -0.3, 0.0], [0.0, 0.3, 0.0], [0.0, 0.0, 2.0]],
        [[0.0, 0.3, 0.0], [-0.3, -0.3, 0.0], [0.0, 0.0, 2.0]],
    ];
    let mut random = SplitMix64::new(21);
    let mut place = |i: u64| {
        let (s, c) = (std::f32::consts::PI * random.signed()).sin_cos();
        let size = 1.0 + 0.5 * random.signed();
        let [x, y, _] = random.around(150.0);
        let rows = [[c * size, -s * size, 0.0, x], [s * size, c * size, 0.0, y], [0.0, 0.0, size, 0.0]];
        Instance::new(1 + i % 2, rows).with_index_and_mask(i as u32, 1 << (i % 3))
    };
    let instances: Vec<Instance> = (0..count).map(&mut place).collect();
    let opaque = GeometryFlags::OPAQUE;
    let world = World::new(vec![triangles(tree, opaque), triangles(soup(4, 0.6, 2), opaque)], instances);
    let mut random = SplitMix64::new(22);
    let rays: Vec<ProbeRay> = (0..100)
        .map(|i| {
            let aim = world.instances[random.bits() as usize % count as usize].transform;
            let [x, y] = [0, 1].map(|k| aim[k][3] + 0.1 * random.signed());
            let origin = [[x + 4.0, y - 3.0, 0.5], [x + 9.0, y + 5.0, 90.0]][i % 2];
            let ray = ProbeRay::to(origin, [x, y, 0.3]);
            ProbeRay { mask: [1, 0xff, 6][i % 3], t_max: [1.0, 2.0][i % 2], ..ray }
        })
        .collect();
    cases.case(format!("{count} instances"), |device| agrees(device, "forest", &world, &rays, 20));
}

/// Boxes as candidates, hits that the shader generates among triangles, and primitives and instances that are left out.
pub fn boxes(cases: &mut Cases<'_>) {
    let none = GeometryFlags::empty();
    let mut random = SplitMix64::new(12);
    let rays: Vec<ProbeRay> = (0..600)
        .map(|i| {
            let (decision, generated_t) = ([CONFIRM, IGNORE][i / 6 % 2], [0.0, 0.4, 0.6, 0.8, 1.0, 4.0][i % 6]);
            ProbeRay { decision, generated_t, ..ProbeRay::to(random.around(3.0), random.around(0.7)) }
        })
        .collect();
    let lists =
        vec![(random_boxes(30, 0.3, 1), GeometryFlags::OPAQUE), (Vec::new(), none), (random_boxes(40, 0.1, 3), none)];
    let parts = vec![triangles(soup(25, 0.7, 31), GeometryFlags::OPAQUE), Part::Boxes(lists)];
    let instances = [(1, 7), (2, 8), (2, 9)].map(|(part, turn)| Instance::new(part, rotation(turn))).to_vec();
    let mixed = World::new(parts, instances);
    cases.case("boxes among triangles", |device| agrees(device, "boxes among triangles", &mixed, &rays, 50));

    let mut inactive = random_boxes(30, 0.4, 6);
    inactive.iter_mut().step_by(3).for_each(|b| b[0][0] = f32::NAN);
    let mut broken = soup(30, 0.5, 7);
    broken.iter_mut().step_by(3).for_each(|triangle| triangle[0][0] = f32::NAN);
    let parts = vec![Part::Boxes(vec![(inactive, none)]), triangles(broken, none), Part::Triangles(Vec::new())];
    let instances = [1, 0, 2, 3, 2].map(|part| Instance::new(part, rotation(part))).to_vec();
    let world = World::new(parts, instances);
    cases.case("inactive primitives and instances", |device| agrees(device, "inactive", &world, &rays, 20));
    let empty = World::new(Vec::new(), vec![Instance::new(0, Instance::IDENTITY); 3]);
    cases.case("a top level of nothing", |device| agrees(device, "nothing", &empty, &rays, 0));
}
