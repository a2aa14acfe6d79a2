//! What ray queries report, and what the header for kd-trees does: shaders in pipelines of their own, as an engine would have them.

use super::device;
use hedgerow::trace::{Hit, Ray};
pub use hedgerow_lab::experiments::check::probe::*;
use hedgerow_lab::{arguments, shaders};

/// Of the driver's structures.
pub fn of_the_driver() -> Probe {
    Probe::of(device(), &shaders::MEASURE_DRIVER_PROBE)
}

/// What a ray meets by the header for kd-trees, and by a query of a BVH in the same shader.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct KdReport {
    pub of_kd_tree: Hit,
    pub of_query: Hit,
    pub is_hit: u32,
    /// Index, first primitive and flags of the geometry that is hit.
    pub geometry: [u32; 3],
}

/// Traces every ray through both.
pub fn ask_kd_tree(kd_tree: u64, bvh: u64, rays: &[Ray]) -> Vec<KdReport> {
    let probe = Probe::of(device(), &shaders::MEASURE_KD_PROBE);
    let ray_buffer = device().upload("rays", rays).expect("memory");
    let reports = device().buffer("reports", size_of::<KdReport>() as u64 * rays.len() as u64).expect("memory");
    let count = rays.len() as u32;
    let push = arguments::KdProbe { kd_tree, bvh, rays: ray_buffer.address(), reports: reports.address(), count };
    probe.dispatch(&push, count);
    reports.read(rays.len())
}
