//! A tree from both sides: built on the device of the tests, and by the twins on the host with the same options.

use super::corpus::Mesh;
use super::device;
use hedgerow::bvh::builder::{BuildOptions, Input};
use hedgerow::bvh::layout::Bvh2;
use hedgerow_lab::experiments::check::twins;
pub use hedgerow_lab::experiments::check::twins::{PLENTY, PLENTY_TO_MERGE, on_host};

/// The device's tree over `input`.
pub fn built(options: &BuildOptions, input: &Input) -> Bvh2 {
    twins::built(device(), options, input)
}

/// The device's tree of a mesh.
pub fn on_device(mesh: &Mesh, options: &BuildOptions) -> Bvh2 {
    twins::on_device(device(), mesh, options)
}

/// The same bytes; otherwise tells what differs first.
#[track_caller]
pub fn assert_same(got: &Bvh2, expected: &Bvh2, what: &str) {
    twins::compare(got, expected).unwrap_or_else(|wrong| panic!("{what}: {wrong}"));
}
