//! What the commands of the program share, and the commands that print and keep nothing else, one file each. The commands of an
//! [experiment](crate::experiments) stand with it.

pub(crate) mod build;
pub(crate) mod devices;
pub(crate) mod options;
mod output;
pub(crate) mod rays;
pub(crate) mod render;
pub(crate) mod tables;
pub(crate) mod trace;
pub(crate) mod work;

pub use options::{Builders, Common, Costs, Kinds, Size};
pub use output::{Bar, Json};
