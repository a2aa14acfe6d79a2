//! `auto`: the builder that the table of costs expects to be best.

use crate::device::Device;
use crate::experiments::choose::{Cost, SceneClass, cache};
use crate::scene::Mesh;
use crate::subjects::builders::{BuilderPlan, Spec, TaughtTree};
use crate::subjects::device_bvh::DeviceBvh;
use crate::{Error, Result};

/// Rays per build by default: some frames of a game.
pub const DEFAULT_RAYS: f64 = 1e7;

/// The value of the option `rays`: a number of rays a build.
///
/// # Errors
/// [`Error::Argument`] if it is not a number from 0 on.
pub fn rays_of(option: Option<&str>) -> Result<f64> {
    let Some(text) = option else { return Ok(DEFAULT_RAYS) };
    let rays = text.parse().ok().filter(|rays: &f64| *rays >= 0.0 && rays.is_finite());
    rays.ok_or_else(|| {
        Error::Argument(format!("auto:rays={text} is not a number of rays per build; write auto:rays=1e6"))
    })
}

/// The builder that is chosen for `mesh` and `rays` rays per build, under the name `builder`. The choice follows from the table
/// of costs of `device`, which is measured first if there is none yet.
///
/// # Errors
/// The device can build no candidate; those of the chosen one.
pub fn chosen<'a>(device: &'a Device, builder: &str, mesh: &Mesh, rays: f64) -> Result<DeviceBvh<'a>> {
    let table = cache::table_of(device, false, &mut |what| log::info!("{what}"))?;
    let Cost { builder: name, build_ms, ray_ns } = table
        .choose(&SceneClass::of(mesh), rays)
        .ok_or_else(|| Error::NoVulkan("no candidate of auto could be measured on this device".into()))?;
    let BuilderPlan::Device(plan) = name.parse::<Spec>()?.plan()? else {
        return Err(Error::Argument(format!("{name} builds no BVH on the device, so auto cannot take it")));
    };
    let mut subject = plan.make(device, &name, mesh, &TaughtTree::default())?;
    let own = subject.choice.map_or(String::new(), |choice| format!(" ({choice})"));
    subject.choice =
        Some(format!("{name}{own} for {rays:e} rays a build, expected {build_ms:.3} ms and {ray_ns:.0} ns a ray"));
    subject.builder = builder.to_owned();
    Ok(subject)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_are_a_number_from_zero_on() {
        assert_eq!(rays_of(None).expect("the default"), DEFAULT_RAYS);
        assert_eq!(rays_of(Some("1e6")).expect("a number"), 1e6);
        for wrong in ["", "-1", "nan", "inf", "many"] {
            assert!(rays_of(Some(wrong)).expect_err(wrong).to_string().contains("auto:rays=1e6"), "{wrong}");
        }
    }
}
