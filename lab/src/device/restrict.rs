//! A device that has less than it has: limits and optional features are taken away, so that tests run on one device what another
//! would.

use hedgerow::gpu::{Limits, Optional};
use std::str::FromStr;

/// What is taken away from a device. The default takes nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Restrict {
    /// The subgroup size that is reported: the real one, or a larger one, which makes sizes inexact.
    pub subgroup_size: Option<u32>,
    /// Nothing optional is enabled, and subgroups may be of any size up to the reported one.
    pub inexact: bool,
    /// Bytes of shared memory a workgroup, at most.
    pub shared_memory: Option<u32>,
    /// Invocations a workgroup, at most.
    pub workgroup_invocations: Option<u32>,
    /// Workgroups of a dispatch, at most.
    pub workgroup_count: Option<u32>,
    /// Valid bits of a timestamp, at most; 0 for a queue family without timestamps.
    pub timestamp_bits: Option<u32>,
    /// Gathers are taken to be fast where they are slow, and slow where they are fast.
    pub other_gathers: bool,
    /// Buffers are filled and read through staging memory, as on a GPU with memory of its own.
    pub staged: bool,
    /// Command buffers are recorded and not submitted: what memory holds means nothing. For tests of what recording makes, as a driver
    /// may compile a pipeline when it first runs, and take minutes for all. Has no word in a list.
    pub unsubmitted: bool,
}

impl Restrict {
    /// Takes nothing away.
    pub const NONE: Restrict = Restrict {
        subgroup_size: None,
        inexact: false,
        shared_memory: None,
        workgroup_invocations: None,
        workgroup_count: None,
        timestamp_bits: None,
        other_gathers: false,
        staged: false,
        unsubmitted: false,
    };

    /// What is left of what may be enabled.
    pub(super) fn optional(&self, optional: Optional) -> Optional {
        if self.inexact { Optional::NONE } else { optional }
    }

    /// What is left of the limits.
    pub(super) fn limit(&self, limits: &mut Limits) {
        let at_most = |limit: &mut u32, most: Option<u32>| *limit = most.map_or(*limit, |most| most.min(*limit));
        at_most(&mut limits.shared_memory, self.shared_memory);
        at_most(&mut limits.workgroup_invocations, self.workgroup_invocations);
        at_most(&mut limits.workgroup_count, self.workgroup_count);
        at_most(&mut limits.timestamp_bits, self.timestamp_bits);
        limits.gathers_words_fast ^= self.other_gathers;
        let size = self.subgroup_size.unwrap_or(limits.subgroup_size);
        if self.inexact || size != limits.subgroup_size {
            limits.subgroup_is_exact = false;
            limits.subgroup_min = 1;
            limits.subgroup_max = size;
        }
        limits.subgroup_size = size;
    }
}

impl FromStr for Restrict {
    type Err = String;

    /// Reads a list such as `subgroup=32,inexact,shared=16384,invocations=128,groups=65535,timestamps=0,gathers,staged`.
    fn from_str(text: &str) -> Result<Restrict, String> {
        let mut restrict = Restrict::default();
        for part in text.split(',').map(str::trim).filter(|part| !part.is_empty()) {
            let (name, value) = part.split_once('=').unwrap_or((part, ""));
            let number = || match value.parse() {
                Ok(number) => Ok(Some(number)),
                Err(_) => Err(format!("{part:?}: {value:?} is not a number")),
            };
            match name {
                "subgroup" => restrict.subgroup_size = number()?,
                "shared" => restrict.shared_memory = number()?,
                "invocations" => restrict.workgroup_invocations = number()?,
                "groups" => restrict.workgroup_count = number()?,
                "timestamps" => restrict.timestamp_bits = number()?,
                "inexact" if value.is_empty() => restrict.inexact = true,
                "gathers" if value.is_empty() => restrict.other_gathers = true,
                "staged" if value.is_empty() => restrict.staged = true,
                _ => {
                    return Err(format!(
                        "{part:?} restricts nothing; take subgroup=, shared=, invocations=, groups=, timestamps=, inexact, gathers or staged"
                    ));
                }
            }
        }
        Ok(restrict)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn restrictions_are_read_from_a_list() {
        assert_eq!("".parse(), Ok(Restrict::default()));
        let some =
            Restrict { subgroup_size: Some(32), inexact: true, shared_memory: Some(16384), ..Default::default() };
        assert_eq!("subgroup=32, inexact,shared=16384".parse(), Ok(some));
        for wrong in ["subgroup", "shared=x", "inexact=1", "nothing"] {
            assert!(wrong.parse::<Restrict>().is_err(), "{wrong}");
        }
    }
}
