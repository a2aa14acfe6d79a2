//! `auto`: the builder that the table of costs expects to be best, as a subject.

use crate::device::Device;
use crate::experiments::choose::{Cost, SceneClass, cache};
use crate::measure::overlap::Epo;
use crate::measure::record;
use crate::scene::Mesh;
use crate::subjects::builders::Spec;
use crate::subjects::{BuildRun, Subject};
use crate::{Error, Result};
use hedgerow::bvh::layout::Bvh2;
use hedgerow::trace::{Hit, Query, Ray, Work};

/// Rays a build where nobody says: some frames of a game.
pub const DEFAULT_RAYS: f64 = 1e7;

/// The value of the option `rays`: a number of rays a build.
///
/// # Errors
/// [`Error::Argument`] if it is no number from 0 on.
pub fn rays_of(option: Option<&str>) -> Result<f64> {
    let Some(text) = option else { return Ok(DEFAULT_RAYS) };
    let rays = text.parse().ok().filter(|rays: &f64| *rays >= 0.0 && rays.is_finite());
    rays.ok_or_else(|| Error::Argument(format!("auto:rays={text} is no number of rays a build; write auto:rays=1e6")))
}

/// What was chosen, under the name of the choice.
pub struct Auto<'a> {
    builder: String,
    chosen: Cost,
    rays: f64,
    subject: Box<dyn Subject + 'a>,
}

impl<'a> Auto<'a> {
    /// Chooses for `mesh` and `rays` rays a build, by the table of costs of `device`, which is measured first where it is not known.
    ///
    /// # Errors
    /// The device can build no candidate; those of the chosen one.
    pub fn new(device: &'a Device, builder: &str, mesh: &'a Mesh, rays: f64) -> Result<Auto<'a>> {
        let table = cache::table_of(device, false, &mut |what| log::info!("{what}"))?;
        let chosen = table
            .choose(&SceneClass::of(mesh), rays)
            .ok_or_else(|| Error::NoVulkan("no candidate of auto could be measured on this device".into()))?;
        let subject = chosen.builder.parse::<Spec>()?.make(Some(device), mesh)?;
        Ok(Auto { builder: builder.to_owned(), chosen, rays, subject })
    }
}

impl Subject for Auto<'_> {
    fn builder(&self) -> &str {
        &self.builder
    }

    fn kind(&self) -> &'static str {
        self.subject.kind()
    }

    fn timer(&self) -> &'static str {
        self.subject.timer()
    }

    fn choice(&self) -> Option<String> {
        let Cost { builder, build_ms, ray_ns } = &self.chosen;
        let own = self.subject.choice().map_or(String::new(), |choice| format!(" ({choice})"));
        let rays = self.rays;
        Some(format!("{builder}{own} for {rays:e} rays a build, expected {build_ms:.3} ms and {ray_ns:.0} ns a ray"))
    }

    fn traffic(&self, phase: &str) -> Option<u64> {
        self.subject.traffic(phase)
    }

    fn build(&mut self) -> Result<BuildRun> {
        self.subject.build()
    }

    fn memory(&self) -> record::MemoryRecord {
        self.subject.memory()
    }

    fn quality(&mut self, c_t: f64, c_i: f64) -> Result<record::QualityRecord> {
        self.subject.quality(c_t, c_i)
    }

    fn epo(&mut self, c_t: f64, c_i: f64, epo: Epo) -> Result<Option<f64>> {
        self.subject.epo(c_t, c_i, epo)
    }

    fn tree(&mut self) -> Result<Option<Bvh2>> {
        self.subject.tree()
    }

    fn set_rays(&mut self, rays: &[Ray]) -> Result<()> {
        self.subject.set_rays(rays)
    }

    fn trace(&mut self, query: Query) -> Result<f64> {
        self.subject.trace(query)
    }

    fn hits(&mut self) -> Result<Vec<Hit>> {
        self.subject.hits()
    }

    fn work(&mut self, query: Query) -> Result<Option<Vec<Work>>> {
        self.subject.work(query)
    }
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
