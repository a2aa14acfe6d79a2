//! `hedgerow predict`: which static figure of a tree tells how fast it is traced (van Kralingen 2023, sections 3.1.2, 3.1.3 and 5.2;
//! Aila, Karras, Laine 2013, "On Quality Metrics of Bounding Volume Hierarchies").
//!
//! [`choice`] says which trees are compared, [`measured`] builds and traces them, [`own`] asks each heuristic what a finished tree
//! costs, and [`record`] keeps all of it. [`samples`] sets a tree beside the reference of its scene, [`predictor`] lists what might
//! tell its time, [`fit`] finds the free weights of some, and [`found`] correlates. [`pay`] asks how many rays a build pays for,
//! [`published`] holds the thesis' figures, and [`page`] shows all.

pub mod choice;
pub(crate) mod command;
pub mod fit;
pub mod found;
pub mod measured;
pub mod own;
pub mod page;
pub mod pay;
pub mod predictor;
pub mod published;
pub mod record;
pub mod samples;
