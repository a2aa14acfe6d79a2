//! `hedgerow rays`: writes the rays of a kind to a file, for other tracers.

use super::{Bar, Common, Size};
use crate::rays::files;
use crate::rays::kinds::{self, RayKind};
use crate::report::numbers::grouped;
use hedgerow::bvh::twin::lbvh;
use hedgerow::bvh::{codes::Codes, sah::Collapse};
use hedgerow::trace::twin::tracer as host;
use rayon::prelude::*;
use std::io::Write;
use std::path::PathBuf;

/// Write the rays of a kind to a file, 32 bytes each
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The scene: a file, a bare name, or a generator
    scene: String,
    /// Kind of rays: primary, shadow, ao, diffuse1, diffuse2, reflection or random
    #[arg(long, value_name = "KIND")]
    kind: RayKind,
    /// The file
    #[arg(short, long, value_name = "RAYS")]
    output: PathBuf,
    /// Pixels of the picture that the rays belong to
    #[arg(long, value_name = "WxH", default_value = "640x480")]
    size: Size,
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> anyhow::Result<()> {
    let scene = common.load(&arguments.scene)?;
    let bar = Bar::new(common, &format!("tracing for {} rays", arguments.kind), 0);
    let mesh = &scene.mesh;
    let mut tree = None;
    // Hits are the same in every tree; one on the host needs no device.
    let mut closest_hits = |rays: &[hedgerow::trace::Ray]| {
        let tree = tree.get_or_insert_with(|| {
            let codes = Codes::for_count(mesh.triangles.len() as u32);
            lbvh::build(&mesh.positions, &mesh.triangles, codes, Collapse::SAH)
        });
        Ok(rays.par_iter().map(|ray| host::closest_hit(tree, ray)).collect())
    };
    let rays = kinds::generate(arguments.kind, &scene, &arguments.size.rays(common.seed), &mut closest_hits)?;
    files::write_rays(&arguments.output, &rays)?;
    drop(bar);
    let count = grouped(rays.len() as u64);
    writeln!(std::io::stdout(), "{count} {} rays in {}", arguments.kind, arguments.output.display())?;
    Ok(())
}
