//! What the laboratory measures and asks, one folder each: its measuring, its records, its page and its command.

pub mod accel;
pub mod animate;
pub mod bench;
pub mod check;
pub mod choose;
pub mod codes;
pub mod compare;
pub mod cpu_builders;
pub mod fly;
pub mod navigate;
pub mod predict;
pub mod published;
pub mod report;
pub mod stability;

use crate::Result;
use crate::report::beside;
use std::path::Path;

/// Writes the page of each experiment but `bench` again whose records lie in `folder`, so that all name each other.
///
/// # Errors
/// Records cannot be read; a file cannot be written.
pub fn write_pages(folder: &Path) -> Result<()> {
    if beside::CPU_BUILDERS.is_in(folder) {
        cpu_builders::page::write(folder)?;
    }
    if beside::PREDICT.is_in(folder) {
        predict::page::write(folder)?;
    }
    if beside::CODES.is_in(folder) {
        codes::page::write(folder)?;
    }
    if beside::ACCEL.is_in(folder) {
        accel::page::write(folder)?;
    }
    if beside::ANIMATE.is_in(folder) {
        animate::page::write(folder)?;
    }
    if beside::FLY.is_in(folder) {
        fly::page::write(folder)?;
    }
    stability::page::write_all(folder)
}
