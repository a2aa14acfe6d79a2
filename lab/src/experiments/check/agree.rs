//! What queries report, held against brute force.
#![allow(missing_docs, reason = "names and types say it all: groups and tests are the only readers")]

use super::backend::Backend;
use super::probe::{IGNORE, ProbeRay, ProbeReport, TERMINATE, flags};
use super::world::{Met, World, inverse, transform_error, transformed};

/// Builds the world and asks of every ray.
pub fn probed(backend: &dyn Backend, world: &World, rays: &[ProbeRay]) -> Vec<ProbeReport> {
    let built = world.build(backend);
    let reports = backend.probe(built.top.structure, rays);
    backend.destroy(built.top.structure);
    built.parts.iter().for_each(|part| backend.destroy(part.structure));
    reports
}

/// Builds the world and checks every report. Returns how many rays committed to a hit.
#[track_caller]
pub fn assert_agrees(backend: &dyn Backend, what: &str, world: &World, rays: &[ProbeRay]) -> usize {
    let reports = probed(backend, world, rays);
    assert_reports(&format!("{}, {what}", backend.name()), world, rays, &reports)
}

/// A report is what brute force says; rays that rounding may decide are left out, and are few. Returns how many committed to
/// a hit.
#[track_caller]
pub fn assert_reports(name: &str, world: &World, rays: &[ProbeRay], reports: &[ProbeReport]) -> usize {
    let mut hits = 0;
    let mut compared = 0;
    for (i, (ray, report)) in rays.iter().zip(reports).enumerate() {
        let what = format!("{name}: ray {i} {ray:?}");
        let told = (report.t_min, report.flags, report.origin, report.direction);
        assert_eq!(told, (ray.t_min, ray.flags, ray.origin, ray.direction), "{what}");
        let Some(expected) = world.expected(ray) else { continue };
        compared += 1;
        let got = &report.committed;
        let place = [got.instance, got.geometry, got.primitive];
        hits += usize::from(got.kind != 0);
        if ray.flags & flags::FIRST_HIT != 0 || ray.decision == TERMINATE {
            // Any of the meetings may be the first.
            assert!(got.kind == 0 || expected.meetings.iter().any(|met| met.place == place), "{what}: {got:?}");
            if ray.decision == TERMINATE {
                assert!(report.candidate_count <= 1, "{what}: goes on after its end");
            } else {
                assert_eq!(got.kind != 0, expected.committed.is_some(), "{what}: {got:?}");
            }
            continue;
        }
        if ray.decision == IGNORE && expected.meetings.iter().all(|met| met.is_box || !met.is_opaque) {
            assert_candidates(&what, report, &expected.meetings);
        }
        let Some(met) = expected.committed else {
            assert_eq!(got.kind, 0, "{what}: {got:?}");
            continue;
        };
        assert_eq!(got.kind, if met.is_box { 2 } else { 1 }, "{what}: {got:?} {met:?}");
        assert_instance(&what, world, ray, report);
        if met.is_box {
            // All that are generated are equally near: any of them may be it.
            assert!(expected.meetings.iter().any(|m| m.is_box && m.place == place), "{what}: {got:?}");
            assert_eq!(got.t, ray.generated_t, "{what}");
            continue;
        }
        assert_eq!(place, met.place, "{what}: {got:?} {met:?}");
        assert_close(&[got.t], &[met.t], met.t_error, &what);
        assert_close(&got.barycentrics, &met.weights, met.weight_error, &what);
        assert_eq!(got.is_front != 0, met.is_front, "{what}: which side");
    }
    assert!(compared * 10 > rays.len() * 7, "{name}: only {compared} of {} rays tell anything", rays.len());
    hits
}

/// Nothing shortens the ray: everything that it meets is a candidate once.
#[track_caller]
fn assert_candidates(what: &str, report: &ProbeReport, meetings: &[Met]) {
    if report.candidate_count > 8 {
        return;
    }
    let place = |met: &Met| [u32::from(met.is_box), met.place[0], met.place[1], met.place[2]];
    let mut expected: Vec<[u32; 4]> = meetings.iter().map(place).collect();
    expected.sort_unstable();
    let mut got = report.sorted_candidates();
    // Boxes may be candidates though the ray passes by.
    got.retain(|candidate| candidate[0] == 0 || expected.contains(candidate));
    assert_eq!(got, expected, "{what}: candidates");
}

/// What is known of the instance that was hit.
#[track_caller]
fn assert_instance(what: &str, world: &World, ray: &ProbeRay, report: &ProbeReport) {
    let got = &report.committed;
    let instance = &world.instances[got.instance as usize];
    assert_eq!(got.custom_index, instance.index_and_mask & 0xff_ffff, "{what}");
    assert_eq!(got.offset, instance.offset_and_flags & 0xff_ffff, "{what}");
    let to_object = inverse(&instance.transform);
    for (got, p, w) in [(got.object_origin, ray.origin, 1.0), (got.object_direction, ray.direction, 0.0)] {
        let p = p.map(f64::from);
        let error = transform_error(&instance.transform, p, w);
        assert_close(&got, &transformed(&to_object, p, w), error, what);
    }
    for column in 0..4 {
        assert_eq!(got.object_to_world[column], instance.transform.map(|row| row[column]), "{what}: column {column}");
        let unit = std::array::from_fn(|k| f64::from(u8::from(k == column)));
        let w = if column == 3 { 1.0 } else { 0.0 };
        // More than in what is made with it: lavapipe's inverse is that much worse.
        let error = 3.0 * transform_error(&instance.transform, unit, w);
        assert_close(&got.world_to_object[column], &to_object.map(|row| row[column]), error, what);
    }
}

#[track_caller]
pub fn assert_close(got: &[f32], expected: &[f64], error: f64, what: &str) {
    let close = got.iter().zip(expected).all(|(&g, &e)| (f64::from(g) - e).abs() <= error);
    assert!(close && got.len() == expected.len(), "{what}: {got:?}, expected {expected:?} within {error:e}");
}
