//! What the calls check of the handles that they are given.

use crate::{Error, Result};
use ash::vk;
use ash::vk::Handle;

/// The address of a structure that a call cannot do without.
pub(super) fn not_null(field: &str, structure: vk::AccelerationStructureKHR) -> Result<u64> {
    match structure.as_raw() {
        0 => Err(Error::Argument(format!("{field} is null; create it first"))),
        address => Ok(address),
    }
}
