//! `hedgerow check`: whether everything is right on a device that nobody has tried.
//!
//! A group is a table of [`cases`] over one part of the library: device against host twin, byte for byte, or hits against brute
//! force. [`GROUPS`] lists them from the simplest pass to whole top levels, so that the first failure says most. Each runs in a
//! process of its own ([`supervise`]): a crash, a hang or a lost device is one failed group.
//!
//! The tests share what the groups are made of: meshes that hurt ([`corpus`], [`shapes`]), trees from both sides ([`twins`]),
//! rays through them ([`traced`]), worlds of instances built through a [`backend`], queries in a shader that is not ours
//! ([`probe`]), and what they should report ([`world`], [`agree`]).

pub mod agree;
pub mod backend;
pub mod cases;
pub(crate) mod command;
pub mod corpus;
mod groups;
pub mod matrices;
pub mod mixture;
pub mod probe;
pub mod shapes;
pub mod supervise;
pub mod traced;
pub mod twins;
pub mod world;

use crate::device::Device;
use crate::measure::provenance;
use cases::Cases;
pub use groups::GROUPS;
use hedgerow::gpu::{Tuning, TuningChoice};
use serde::{Deserialize, Serialize};

/// A part of the library, checked by itself.
#[derive(Debug, Clone, Copy)]
pub struct Group {
    /// Its name, as `--groups` takes it.
    pub name: &'static str,
    /// What is held against what.
    pub what: &'static str,
    /// Its cases.
    pub run: fn(&mut Cases<'_>),
}

/// What the groups run on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Ground {
    /// The device's name.
    pub device: String,
    /// Driver and version as it says them; of one that says nothing the number of its version.
    pub driver: String,
    /// Vulkan version.
    pub vulkan: String,
    /// The limits that decide how work is cut.
    pub limits: CheckLimits,
    /// The tuning that was asked for: `auto`, `cpu` or `gpu`.
    pub tuning: String,
    /// The one that was taken: `cpu` or `gpu`.
    pub tuned_as: String,
}

/// The part of [`hedgerow::gpu::Limits`] that a report needs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct CheckLimits {
    /// Lanes of a subgroup.
    pub subgroup_size: u32,
    /// Invocations of a workgroup, at most.
    pub workgroup_invocations: u32,
    /// Workgroups of a dispatch, at most.
    pub workgroup_count: u32,
    /// Bytes of shared memory.
    pub shared_memory: u32,
    /// Bytes of the largest device-local heap.
    pub memory: u64,
}

impl Ground {
    /// What `device` is, opened with the tuning `choice`.
    pub fn of(device: &Device, choice: TuningChoice) -> Ground {
        let (found, limits) = (device.found(), &device.limits);
        let version = found.api_version;
        let is_as_cpu = device.tuning == Tuning::cpu(limits);
        Ground {
            device: found.name.clone(),
            driver: match found.driver.trim() {
                "" => format!("version {:#x}", limits.driver_version),
                driver => driver.to_owned(),
            },
            vulkan: format!(
                "{}.{}.{}",
                ash::vk::api_version_major(version),
                ash::vk::api_version_minor(version),
                ash::vk::api_version_patch(version)
            ),
            limits: CheckLimits {
                subgroup_size: limits.subgroup_size,
                workgroup_invocations: limits.workgroup_invocations,
                workgroup_count: limits.workgroup_count,
                shared_memory: limits.shared_memory,
                memory: found.memory,
            },
            tuning: choice.to_string(),
            tuned_as: if is_as_cpu { "cpu" } else { "gpu" }.to_owned(),
        }
    }
}

/// What `--json` writes: one check of a device.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct CheckRecord {
    /// [`crate::measure::record::SCHEMA`].
    pub schema: u32,
    /// Commit of the program.
    pub commit: String,
    /// When, RFC 3339 UTC.
    pub when: String,
    /// Whether only a part of the cases was tried.
    pub quick: bool,
    /// The device; `None` if no group got so far.
    pub ground: Option<Ground>,
    /// Groups that passed.
    pub passed: usize,
    /// Groups that failed.
    pub failed: usize,
    /// Every group.
    pub groups: Vec<supervise::Outcome>,
}

impl CheckRecord {
    /// Before anything was tried.
    pub fn new(quick: bool) -> CheckRecord {
        CheckRecord {
            schema: crate::measure::record::SCHEMA,
            commit: provenance::commit(),
            when: provenance::now(),
            quick,
            ..CheckRecord::default()
        }
    }

    /// Adds how a group went.
    pub fn add(&mut self, outcome: supervise::Outcome) {
        *(if outcome.passed { &mut self.passed } else { &mut self.failed }) += 1;
        self.groups.push(outcome);
    }
}

/// The groups to run: all, with those for tests of the check itself where the environment asks for them.
pub fn groups() -> impl Iterator<Item = &'static Group> {
    GROUPS.iter().chain(groups::faults::asked_for())
}
