//! The records of a builder on a scene: built by all threads and by one, traced on the host and on the device.

use super::choice::BASE;
use crate::measure::record::{QualityRecord, Record, TraceRecord};
use crate::report::names::distinct;
use crate::subjects::builders::BUILDERS;
use crate::subjects::retraced::TreeTracer;

/// Behind the name of a builder that one thread runs.
pub const ONE_THREAD: &str = ":threads=1";
/// Behind the name of a builder whose tree our tracer takes on the host: of peers, which have tracers of their own.
pub const BY_HOST: &str = ":trace=host";
/// Behind the name of a builder whose tree our tracer takes on the device.
pub const BY_DEVICE: &str = ":trace=device";

/// Families of builders that are somebody else's.
const PEERS: [&str; 2] = ["obvhs", "embree"];

/// A builder on a scene.
#[derive(Debug, Clone)]
pub struct Measured<'r> {
    /// Its name, without what tells its records apart.
    pub builder: String,
    /// Built by all threads, traced by its own tracer.
    own: Option<&'r Record>,
    /// Built by one thread, and not traced.
    one_thread: Option<&'r Record>,
    by_host: Option<&'r Record>,
    by_device: Option<&'r Record>,
}

impl<'r> Measured<'r> {
    /// Built by all threads, with its own tracer.
    pub fn own(&self) -> Option<&'r Record> {
        self.own
    }

    /// Built by one thread.
    pub fn one_thread(&self) -> Option<&'r Record> {
        self.one_thread
    }

    /// Its tree, however many threads built it.
    pub fn quality(&self) -> Option<&'r QualityRecord> {
        self.own.or(self.by_device).or(self.one_thread).map(|record| &record.quality)
    }

    /// The record of our tracer.
    pub fn traced(&self, tracer: TreeTracer) -> Option<&'r Record> {
        match tracer {
            TreeTracer::Host => self.by_host.or(self.own.filter(|_| !self.has_own_tracer())),
            TreeTracer::Device => self.by_device,
        }
    }

    /// Rays of a kind by our tracer.
    pub fn rays(&self, tracer: TreeTracer, kind: &str) -> Option<&'r TraceRecord> {
        self.traced(tracer)?.rays(kind)
    }

    /// Whether it is somebody else's.
    pub fn is_peer(&self) -> bool {
        PEERS.contains(&self.family()) || self.has_own_tracer()
    }

    /// Whether it comes with a tracer of its own, and a layout that ours does not walk.
    pub fn has_own_tracer(&self) -> bool {
        self.own.is_some_and(|record| record.kind == "host")
    }

    /// Milliseconds of a build by all threads.
    pub fn build_ms(&self) -> Option<f64> {
        Some(self.own?.build.median_ms)
    }

    /// Milliseconds of a build by one thread.
    pub fn one_thread_ms(&self) -> Option<f64> {
        Some(self.one_thread?.build.median_ms)
    }

    /// The builder's name without its options, for colours: presets of one method are alike.
    pub fn family(&self) -> &str {
        family(&self.builder)
    }
}

/// The method behind a name: `aac-hq:codes=mc63` is `aac`.
pub fn family(builder: &str) -> &str {
    let name = builder.split(':').next().unwrap_or_default();
    // Presets are told by a suffix; twins are no presets.
    let is_own = BUILDERS.iter().any(|b| b.name == name) && name.ends_with("-host");
    if is_own { name } else { name.split('-').next().unwrap_or_default() }
}

/// A scene with all builders on it, in the order in which they were measured.
#[derive(Debug, Clone)]
pub struct OnScene<'r> {
    /// Its name.
    pub scene: &'r str,
    /// Its triangles.
    pub triangles: u64,
    /// The builders.
    pub builders: Vec<Measured<'r>>,
}

impl<'r> OnScene<'r> {
    /// The builder of this name.
    pub fn of(&self, builder: &str) -> Option<&Measured<'r>> {
        self.builders.iter().find(|measured| measured.builder == builder)
    }

    /// That against which the others are held: the first where there is no [`BASE`].
    pub fn base(&self) -> Option<&Measured<'r>> {
        self.of(BASE).or(self.builders.first())
    }

    /// The kinds of rays that were traced.
    pub fn kinds(&self) -> Vec<&'r str> {
        let records = self.builders.iter().flat_map(|b| [b.own, b.by_host, b.by_device]).flatten();
        distinct(records.flat_map(|record| record.trace.iter().map(|trace| trace.rays.as_str())))
    }
}

/// The records scene by scene and builder by builder.
pub fn by_scene(records: &[Record]) -> Vec<OnScene<'_>> {
    let scenes = distinct(records.iter().map(|record| record.scene.as_str()));
    let on = |scene| {
        let of_scene: Vec<&Record> = records.iter().filter(|record| record.scene == scene).collect();
        let mut builders: Vec<Measured<'_>> = Vec::new();
        for record in &of_scene {
            let suffix = [ONE_THREAD, BY_HOST, BY_DEVICE].into_iter().find(|suffix| record.builder.ends_with(suffix));
            let name = record.builder.strip_suffix(suffix.unwrap_or_default()).unwrap_or(&record.builder);
            let at = builders.iter().position(|known| known.builder == name).unwrap_or_else(|| {
                let builder = name.to_owned();
                builders.push(Measured { builder, own: None, one_thread: None, by_host: None, by_device: None });
                builders.len() - 1
            });
            let measured = &mut builders[at];
            let place = match suffix {
                Some(ONE_THREAD) => &mut measured.one_thread,
                Some(BY_HOST) => &mut measured.by_host,
                Some(BY_DEVICE) => &mut measured.by_device,
                _ => &mut measured.own,
            };
            *place = Some(record);
        }
        OnScene { scene, triangles: of_scene.first().map_or(0, |record| record.triangles), builders }
    };
    scenes.into_iter().map(on).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_of_a_method_are_a_family() {
        assert_eq!(
            ["aac-hq:codes=mc63/30", "aac-fast", "bonsai-p2", "ploc-host:radius=10"].map(family),
            ["aac", "aac", "bonsai", "ploc-host"]
        );
        assert_eq!(["sweep:optimise=high", "host-fast"].map(family), ["sweep", "host"]);
    }
}
