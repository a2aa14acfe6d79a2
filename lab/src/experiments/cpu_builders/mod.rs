//! `hedgerow cpu-builders`: builders of BVHs on the host against each other and beside Frantál 2019, "Ray Tracing with Bounding
//! Volume Hierarchies on a CPU".
//!
//! [`choice`] says which builders there are, [`measured`] brings the records of one builder together, [`order`] asks whether a cost
//! orders the times of rays, [`frantal`] holds what was published, and [`page`] shows all of it. The records are those of
//! `hedgerow bench`.

pub mod choice;
pub(crate) mod command;
pub mod frantal;
pub mod measured;
pub mod order;
pub mod page;
