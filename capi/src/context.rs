//! The library's state on the caller's device.

use crate::loader;
use crate::pointers::{handle, place, reference};
use crate::requirements::{HedgerowOptional, optional_of};
use crate::status::{status, value_or};
use crate::vulkan::*;
use hedgerow::accel::Wide;
use hedgerow::ash::vk;
use hedgerow::bvh::codes::Codes;
use hedgerow::gpu::{Context, ContextDesc, TuningChoice};
use hedgerow::{Error, Result, accel};
use std::ffi::{CStr, c_char};

/// What hedgerow_create_context takes.
#[repr(C)]
pub struct HedgerowContextCreateInfo {
    /// `vkGetInstanceProcAddr`: all of Vulkan's functions are found by it.
    pub pfn_get_instance_proc_addr: PFN_vkGetInstanceProcAddr,
    /// The instance that the device came from.
    pub instance: VkInstance,
    /// The device's physical device.
    pub physical_device: VkPhysicalDevice,
    /// The device, created with everything that hedgerow_create_requirements asks for.
    pub device: VkDevice,
    /// Where pipelines are cached; null for none. Stays the caller's.
    pub pipeline_cache: VkPipelineCache,
    /// Whether phases are labelled in command buffers: `VK_TRUE` wants `VK_EXT_debug_utils` enabled in the instance.
    pub debug_labels: VkBool32,
    /// Whether calls check what takes memory of what was created and built, as Vulkan's validation would: `VK_TRUE` for
    /// debugging.
    pub checked: VkBool32,
    /// What the device was created with of `HedgerowRequirements::optional`; 0 is always right.
    pub optional: HedgerowOptional,
    /// Entries of a top level that opens instances, as a multiple of its instances; at 1 none is opened, and 0 stands for 4.
    pub rebraid_budget: f32,
    /// Which structures get nodes of eight children. Shaders that meet none may leave them out by `HEDGEROW_FORMS`
    /// (`trace/query_walk.glsl`).
    pub wide: HedgerowWide,
    /// The name of the codes that bottom levels are sorted by, as `hedgerow bench` takes it: "emc64var", "mc63/40", "bin4a4+robust";
    /// null for those that flags and numbers choose.
    pub p_bottom_codes: *const c_char,
    /// The same of top levels.
    pub p_top_codes: *const c_char,
}

/// Which structures that allow no update get quantised nodes of eight children, and none of two: one of HEDGEROW_WIDE_*.
pub type HedgerowWide = u32;
/// All of `PREFER_FAST_TRACE`, and bottom levels of 4,096 primitives and more without a preference: they take less memory, and rays are
/// faster.
pub const HEDGEROW_WIDE_BY_FLAGS: HedgerowWide = 0;
/// None.
pub const HEDGEROW_WIDE_NEVER: HedgerowWide = 1;
/// All, but for top levels of `PREFER_FAST_BUILD` and bottom levels that are built in haste.
pub const HEDGEROW_WIDE_ALWAYS: HedgerowWide = 2;

fn wide_of(wide: HedgerowWide) -> Result<Wide> {
    match wide {
        HEDGEROW_WIDE_BY_FLAGS => Ok(Wide::ByFlags),
        HEDGEROW_WIDE_NEVER => Ok(Wide::Never),
        HEDGEROW_WIDE_ALWAYS => Ok(Wide::Always),
        _ => Err(Error::Argument(format!("wide is {wide}; it must be one of HEDGEROW_WIDE_*"))),
    }
}

/// The codes of a name; none of null.
///
/// # Safety
/// `name` is null or a string that ends with a zero.
unsafe fn codes(name: *const c_char, parameter: &str) -> Result<Option<Codes>> {
    if name.is_null() {
        return Ok(None);
    }
    // SAFETY: the caller's promise.
    let name = unsafe { CStr::from_ptr(name) }.to_string_lossy();
    name.parse().map(Some).map_err(|error| Error::Argument(format!("{parameter}: {error}")))
}

/// The library's state on one device: pipelines, made when first recorded. Threads may share it.
pub struct HedgerowContext {
    // Dropped first: it refers to the context, which stays where it is.
    structures: accel::Device<'static>,
    context: Box<Context>,
}

/// The context behind a pointer.
///
/// # Safety
/// `context` is null or was made by [`hedgerow_create_context`] and not destroyed.
pub(crate) unsafe fn context_of<'a>(context: *const HedgerowContext) -> Result<&'a Context> {
    // SAFETY: the caller's promise.
    Ok(unsafe { &reference(context, "context")?.context })
}

/// What an engine calls in place of the driver's functions.
///
/// # Safety
/// As [`context_of`].
pub(crate) unsafe fn structures_of<'a>(context: *const HedgerowContext) -> Result<&'a accel::Device<'static>> {
    // SAFETY: the caller's promise.
    Ok(unsafe { &reference(context, "context")?.structures })
}

/// Wraps a device.
///
/// # Safety
/// The device was created from `instance` and `physicalDevice` with what hedgerow_create_requirements returned, and outlives
/// the context.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hedgerow_create_context(
    p_create_info: *const HedgerowContextCreateInfo,
    p_context: *mut *mut HedgerowContext,
) -> VkResult {
    // SAFETY: the caller's promises are those of each of these.
    status(|| unsafe {
        let info = reference(p_create_info, "pCreateInfo")?;
        let place = place(p_context, "pContext")?;
        let get = info.pfn_get_instance_proc_addr;
        let instance = loader::instance(get, info.instance)?;
        let device = loader::device(&instance, info.device)?;
        let labels = (info.debug_labels != vk::FALSE).then(|| loader::labels(get, &instance, &device)).transpose()?;
        let context = Context::new(&ContextDesc {
            instance: &instance,
            physical_device: handle(info.physical_device, "physicalDevice")?,
            device: &device,
            pipeline_cache: info.pipeline_cache,
            debug_utils: labels.as_ref(),
            optional: optional_of(info.optional)?,
            tuning: TuningChoice::Auto,
        })?;
        let context = Box::new(context);
        // The box is neither moved out of nor dropped before the structures that refer to what it holds.
        let shared: &'static Context = &*std::ptr::from_ref(&*context);
        let defaults = accel::AccelOptions::DEFAULT;
        let options = accel::AccelOptions {
            rebraid_budget: if info.rebraid_budget == 0.0 { defaults.rebraid_budget } else { info.rebraid_budget },
            bottom_codes: codes(info.p_bottom_codes, "pBottomCodes")?,
            top_codes: codes(info.p_top_codes, "pTopCodes")?,
            wide: wide_of(info.wide)?,
            checked: info.checked != vk::FALSE,
        };
        let structures = accel::Device::with_options(shared, options);
        place.write(Box::into_raw(Box::new(HedgerowContext { structures, context })));
        Ok(())
    })
}

/// Destroys a context and its pipelines; null is ignored.
///
/// # Safety
/// All command buffers that it recorded into have finished. Its device still lives.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hedgerow_destroy_context(context: *mut HedgerowContext) {
    if !context.is_null() {
        value_or((), || {
            // SAFETY: `hedgerow_create_context` gave it out, and nothing uses it any more.
            drop(unsafe { Box::from_raw(context) });
            Ok(())
        });
    }
}
