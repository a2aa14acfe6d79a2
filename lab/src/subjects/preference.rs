//! What the builds of acceleration structures prefer, by a name.

use crate::named::named;
use ash::vk::BuildAccelerationStructureFlagsKHR as Flags;
use serde::{Deserialize, Serialize};

/// What a build prefers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Preference {
    /// `PREFER_FAST_TRACE`.
    FastTrace,
    /// `PREFER_FAST_BUILD`.
    FastBuild,
    /// Neither.
    None,
}

named!(Preference, "preference": FastTrace = "fast-trace", FastBuild = "fast-build", None = "none");

impl Preference {
    /// The flag that says so, if there is one.
    pub fn flags(self) -> Flags {
        match self {
            Preference::FastTrace => Flags::PREFER_FAST_TRACE,
            Preference::FastBuild => Flags::PREFER_FAST_BUILD,
            Preference::None => Flags::empty(),
        }
    }
}
