//! What the commands that build have in common: the device that the builders need, and figures of several in turn.

use super::{Bar, Common};
use crate::device::{Device, probe};
use crate::experiments::bench::matrix::{self, BenchPlan, Outcome};
use crate::scene::Scene;
use crate::subjects::builders::{Needs, Spec};
use anyhow::bail;
use std::io::Write;
use std::path::Path;

/// Opens the device if one of `builders` needs one.
///
/// # Errors
/// The device does not exist, or lacks what a builder needs.
pub fn device_for(common: &Common, builders: &[Spec]) -> anyhow::Result<Option<Device>> {
    device_for_those(common, builders, |_| true).map(|(device, _)| device)
}

/// Opens the device if one of `builders` needs one, and gives those that can work on it: a builder that `must` work and
/// cannot is an error, the others are left out.
///
/// # Errors
/// The device does not exist, or lacks what a builder needs that must work.
pub fn device_for_those<'b>(
    common: &Common,
    builders: &'b [Spec],
    must: impl Fn(&Spec) -> bool,
) -> anyhow::Result<(Option<Device>, Vec<&'b Spec>)> {
    let need = |needs: Needs| builders.iter().find(|spec| spec.needs() == needs);
    if need(Needs::Device).or(need(Needs::RayQuery)).is_none() {
        return Ok((None, builders.iter().collect()));
    }
    let device = common.open_device(need(Needs::RayQuery).is_some())?;
    let (possible, not): (Vec<&Spec>, Vec<&Spec>) = builders.iter().partition(|spec| spec.is_possible(Some(&device)));
    if let Some(spec) = not.into_iter().find(|spec| must(spec)) {
        bail!(
            "{spec} needs a device whose driver has VK_KHR_acceleration_structure, and VK_KHR_ray_query or \
             VK_KHR_ray_tracing_pipeline, {} has not; choose another device or another builder",
            device.found().name
        );
    }
    check_driver(&device, builders)?;
    Ok((Some(device), possible))
}

/// Asks the driver what no property says: a driver that fails here would give wrong figures in silence.
fn check_driver(device: &Device, builders: &[Spec]) -> anyhow::Result<()> {
    let findings = probe::probe(device)?;
    let found = device.found();
    if !findings.long_loops {
        bail!(
            "{} ({}) ends long loops before their end and gives wrong results; install a newer driver (lavapipe of Mesa 25 \
             or later: scripts/setup.sh) or choose another device",
            found.name,
            found.driver
        );
    }
    let is_pool = |spec: &&Spec| matches!(spec.option("schedule"), Some("persistent" | "across-levels"));
    let persistent = builders.iter().find(is_pool);
    if let (false, Some(spec)) = (findings.task_pool, persistent) {
        bail!("{spec}: on {} workgroups that wait for each other do not finish; take schedule=chain", found.name);
    }
    Ok(())
}

/// Measures `plan` on `scene`: the outcomes, and whether all went well. Failures go to stderr.
pub fn measured(common: &Common, scene: &Scene, device: Option<&Device>, plan: &BenchPlan) -> (Vec<Outcome>, bool) {
    let bar = Bar::new(common, &scene.name, 0);
    let (outcomes, failures) = matrix::measure(scene, device, plan, &mut |what| bar.say(what));
    drop(bar);
    for failure in &failures {
        eprintln!("hedgerow: {failure}");
    }
    for outcome in &outcomes {
        for fault in &outcome.faults {
            eprintln!("hedgerow: {} is wrong: {fault}", outcome.record.builder);
        }
    }
    let all_right = failures.is_empty() && outcomes.iter().all(|o| o.faults.is_empty());
    (outcomes, all_right)
}

/// Ends a command: messages of the validation layers and figures that are wrong are errors.
///
/// # Errors
/// One of both.
pub fn finish(device: Option<&Device>, all_right: bool) -> anyhow::Result<()> {
    if let Some(device) = device {
        device.validation_messages()?;
    }
    if !all_right {
        bail!("not everything went well, see above");
    }
    Ok(())
}

/// Ends an experiment: says where its page is; messages of the validation layers and failures are errors.
///
/// # Errors
/// One of them.
pub fn page_written(device: Option<&Device>, page: &Path, failures: usize) -> anyhow::Result<()> {
    writeln!(std::io::stdout().lock(), "{}", page.display())?;
    finish(device, true)?;
    if failures > 0 {
        bail!("{failures} failed or were wrong, see above and the page; the rest is measured");
    }
    Ok(())
}
