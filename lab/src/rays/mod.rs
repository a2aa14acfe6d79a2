//! Rays that are measured, and files of rays and hits.

pub mod files;
pub mod kinds;
pub mod sample;
