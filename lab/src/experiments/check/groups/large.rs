//! Counts beyond what one dispatch of one item an invocation holds: 65,535 workgroups are all that Vulkan promises.

use super::passes::{reduction_is_right, scan_is_right, sort_is_right};
use crate::experiments::check::cases::{Cases, same_all};
use crate::experiments::check::corpus;
use crate::experiments::check::shapes::{hard_rays, icosphere, tree_with};
use crate::experiments::check::twins::{compare, on_device, on_host};
use crate::random::SplitMix64;
use crate::subjects::device_rays::RayBuffers;
use hedgerow::bvh::builder::BuildOptions;
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::sah::Collapse;
use hedgerow::trace::tracer::{self, TraceShape};
use hedgerow::trace::twin::tracer as host;
use hedgerow::trace::{Hit, Query, Ray};
use rayon::prelude::*;

/// More workgroups than a dispatch is promised to have.
const WORKGROUPS: usize = 65_536;
/// Bytes that the largest of these cases takes for each of its items.
const BYTES_AN_ITEM: u64 = 256;
/// Items that a plain twin on the host sorts in seconds.
const MOST_ITEMS: usize = 20_000_000;

pub fn large(cases: &mut Cases<'_>) {
    let device = cases.device;
    let room = (device.found().memory / BYTES_AN_ITEM) as usize;
    // With --quick at one invocation an item; otherwise for workgroups of the device's own size.
    let invocations = if cases.quick { 1 } else { device.tuning.group as usize };
    let count = WORKGROUPS * invocations + 1;
    if count > room.min(MOST_ITEMS) {
        return cases.left_out(format!("{count} items: there is room for {room}"));
    }
    let mut random = SplitMix64::new(3);
    let keys: Vec<u64> = (0..count).map(|_| random.bits()).collect();
    let words: Vec<u32> = keys.iter().map(|key| (key >> 56) as u32).collect();
    cases.case(format!("scan of {count} words"), |device| scan_is_right(device, &words));
    cases.case(format!("{count} keys of 30 bits"), |device| sort_is_right(device, &keys, 30));
    let boxes: Vec<[[f32; 3]; 2]> = words.iter().map(|&w| [[w as f32; 3], [w as f32 + 1.0; 3]]).collect();
    cases.case(format!("bounds of {count} boxes"), |device| reduction_is_right(device, &boxes));
    let triangles = count.min(WORKGROUPS * 64 + 1);
    let mesh = corpus::random(&format!("{triangles} triangles"), triangles, [-0.5; 3], [1.0; 3]);
    let options = BuildOptions { codes: Some(Code::Mc63.full()), ..BuildOptions::DEFAULT };
    cases.case(format!("{triangles} triangles"), |device| {
        compare(&on_device(device, &mesh, &options), &on_host(&mesh, &options))
    });
    many_rays(cases);
}

/// As many rays as there are invocations in this many workgroups, each with its own hit.
fn many_rays(cases: &mut Cases<'_>) {
    let corners = icosphere(2);
    let tree = tree_with(&corners, Collapse::SAH);
    let shape = TraceShape::of(cases.device);
    let count = WORKGROUPS * if cases.quick { 1 } else { shape.workgroup as usize } + 1;
    let some = hard_rays(&corners, 5000, 1.0, [0.0; 3], 6);
    let rays: Vec<Ray> = some.iter().copied().cycle().take(count).collect();
    cases.case(format!("{count} rays"), |device| {
        let structure = device.upload("structure", &tree.to_bytes())?;
        let traced = RayBuffers::new(device, &rays)?;
        let buffers = traced.buffers(structure.address(), None);
        device.run(None, |r| tracer::record(r, &shape, Query::ClosestHit, &buffers))?;
        let expected: Vec<Hit> = some.par_iter().map(|ray| host::closest_hit(&tree, ray)).collect();
        let expected: Vec<Hit> = expected.into_iter().cycle().take(rays.len()).collect();
        same_all("hit of ray", &traced.read_hits(), &expected)
    });
}
