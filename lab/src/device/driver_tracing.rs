//! How rays are traced through the driver's own acceleration structures: by ray queries, or by a ray-tracing pipeline.
//!
//! NVIDIA's data-centre GPUs and older cards have acceleration structures and pipelines, but no queries.

use super::{Device, properties};
use crate::named::named;
use ash::vk;
use hedgerow::gpu::requirements::Offered;
use std::ffi::CStr;

/// What walks the driver's structures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum DriverTracing {
    /// A compute shader, by `VK_KHR_ray_query`.
    Query,
    /// A ray-generation shader and a shader binding table, by `VK_KHR_ray_tracing_pipeline`.
    Pipeline,
}

named!(DriverTracing, "way to trace": Query = "query", Pipeline = "pipeline");

/// What a device must have for either.
const STRUCTURES: [&CStr; 2] = [ash::khr::acceleration_structure::NAME, ash::khr::deferred_host_operations::NAME];

impl DriverTracing {
    /// What a device has of them. In their order, for the query compares best with ours.
    pub(super) fn of(instance: &ash::Instance, physical_device: vk::PhysicalDevice) -> Vec<DriverTracing> {
        let offered = Offered::by(instance, physical_device);
        if !STRUCTURES.iter().all(|name| offered.has(name)) {
            return Vec::new();
        }
        let is_there =
            |way: &DriverTracing| offered.has(way.extension()) && way.has_features(instance, physical_device);
        DriverTracing::ALL.into_iter().filter(is_there).collect()
    }

    /// The way to take of those that a device has, where this one is asked for. A query may be replaced by a pipeline, which is all
    /// that some devices have; a pipeline that is asked for is meant.
    pub(super) fn among(self, there: &[DriverTracing]) -> Option<DriverTracing> {
        match self {
            DriverTracing::Query => there.first().copied(),
            DriverTracing::Pipeline => there.contains(&self).then_some(self),
        }
    }

    /// The stage that reads the structures.
    pub fn stage(self) -> vk::PipelineStageFlags {
        match self {
            DriverTracing::Query => vk::PipelineStageFlags::COMPUTE_SHADER,
            DriverTracing::Pipeline => vk::PipelineStageFlags::RAY_TRACING_SHADER_KHR,
        }
    }

    /// The device extensions to enable.
    pub(super) fn extensions(self) -> impl Iterator<Item = &'static CStr> {
        STRUCTURES.into_iter().chain([self.extension()])
    }

    fn extension(self) -> &'static CStr {
        match self {
            DriverTracing::Query => ash::khr::ray_query::NAME,
            DriverTracing::Pipeline => ash::khr::ray_tracing_pipeline::NAME,
        }
    }

    fn has_features(self, instance: &ash::Instance, physical_device: vk::PhysicalDevice) -> bool {
        let mut has = DriverFeatures::default();
        let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut has.structures);
        features = match self {
            DriverTracing::Query => features.push_next(&mut has.query),
            DriverTracing::Pipeline => features.push_next(&mut has.pipeline),
        };
        // SAFETY: the handles are live; the device has the extensions of what is chained, which outlives the call.
        unsafe { instance.get_physical_device_features2(physical_device, &mut features) };
        let traces = match self {
            DriverTracing::Query => has.query.ray_query,
            DriverTracing::Pipeline => has.pipeline.ray_tracing_pipeline,
        };
        has.structures.acceleration_structure & traces != vk::FALSE
    }
}

/// The features of both ways.
#[derive(Default)]
pub(super) struct DriverFeatures {
    structures: vk::PhysicalDeviceAccelerationStructureFeaturesKHR<'static>,
    query: vk::PhysicalDeviceRayQueryFeaturesKHR<'static>,
    pipeline: vk::PhysicalDeviceRayTracingPipelineFeaturesKHR<'static>,
}

impl DriverFeatures {
    /// Chains what `way` needs behind `info`.
    pub fn push_into<'a>(&'a mut self, way: DriverTracing, info: vk::DeviceCreateInfo<'a>) -> vk::DeviceCreateInfo<'a> {
        self.structures = self.structures.acceleration_structure(true);
        let info = info.push_next(&mut self.structures);
        match way {
            DriverTracing::Query => {
                self.query = self.query.ray_query(true);
                info.push_next(&mut self.query)
            }
            DriverTracing::Pipeline => {
                self.pipeline = self.pipeline.ray_tracing_pipeline(true);
                info.push_next(&mut self.pipeline)
            }
        }
    }
}

/// The driver has no structures, or the device was opened without.
pub fn driver_is_missing(device: &Device) -> hedgerow::Error {
    let missing =
        "VK_KHR_acceleration_structure with VK_KHR_ray_query or VK_KHR_ray_tracing_pipeline (or was opened without)";
    hedgerow::Error::Unsupported { device: device.found().name.clone(), missing: vec![missing.into()] }
}

impl Device {
    /// Primitives of a structure of the driver's, at most.
    pub fn most_primitives_of_driver(&self) -> u64 {
        let limits: vk::PhysicalDeviceAccelerationStructurePropertiesKHR<'_> =
            properties(self.ash_instance(), self.physical_device());
        limits.max_primitive_count.min(u64::from(u32::MAX))
    }
}

#[cfg(test)]
mod tests {
    use super::DriverTracing::{Pipeline, Query};

    #[test]
    fn a_pipeline_stands_in_for_a_query_and_not_the_other_way_round() {
        assert_eq!(Query.among(&[Query, Pipeline]), Some(Query));
        assert_eq!(Query.among(&[Pipeline]), Some(Pipeline));
        assert_eq!(Pipeline.among(&[Query, Pipeline]), Some(Pipeline));
        assert_eq!(Pipeline.among(&[Query]), None);
        assert_eq!(Query.among(&[]), None);
    }
}
