//! Pointers and handles of C: null where something must be is an error that names the parameter.

use crate::vulkan::VkAccelerationStructureBuildGeometryInfoKHR;
use hedgerow::ash::vk::Handle;
use hedgerow::{Error, Result};
use std::mem::MaybeUninit;

fn null(name: &str) -> Error {
    Error::Argument(format!("{name} is null"))
}

/// What `pointer` points to.
///
/// # Safety
/// `pointer` is null or points to a `T` that lives and changes only by this reference's leave while it is used.
pub(crate) unsafe fn reference<'a, T>(pointer: *const T, name: &str) -> Result<&'a T> {
    // SAFETY: the caller's promise.
    unsafe { pointer.as_ref() }.ok_or_else(|| null(name))
}

/// What `pointer` points to, to be changed.
///
/// # Safety
/// `pointer` is null or points to a `T` that lives and that nobody else looks at while the reference is used.
pub(crate) unsafe fn reference_mut<'a, T>(pointer: *mut T, name: &str) -> Result<&'a mut T> {
    // SAFETY: the caller's promise.
    unsafe { pointer.as_mut() }.ok_or_else(|| null(name))
}

/// Where a result goes.
///
/// # Safety
/// `pointer` is null or points to memory for a `T` that nobody else looks at while the reference is used.
pub(crate) unsafe fn place<'a, T>(pointer: *mut T, name: &str) -> Result<&'a mut MaybeUninit<T>> {
    // SAFETY: the caller's promise; memory without a value is what MaybeUninit stands for.
    unsafe { reference_mut(pointer.cast(), name) }
}

/// The `count` elements at `pointer`, which may be null if there are none.
///
/// # Safety
/// `pointer` is null or points to `count` elements that live and stay as they are while the slice is used.
pub(crate) unsafe fn slice<'a, T>(pointer: *const T, count: u32, name: &str) -> Result<&'a [T]> {
    match (pointer.is_null(), count) {
        (_, 0) => Ok(&[]),
        (true, _) => Err(Error::Argument(format!("{name} is null; {count} elements were announced"))),
        // SAFETY: the caller's promise.
        (false, _) => Ok(unsafe { std::slice::from_raw_parts(pointer, count as usize) }),
    }
}

/// For each of `infos`, what the pointer of the same place points to: an element for each geometry.
///
/// # Safety
/// As [`slice`], for the pointers and for what they point to.
pub(crate) unsafe fn slices<'a, T>(
    pointers: *const *const T,
    infos: &[VkAccelerationStructureBuildGeometryInfoKHR<'_>],
    name: &str,
) -> Result<Vec<&'a [T]>> {
    // SAFETY: the caller's promise.
    let pointers = unsafe { slice(pointers, infos.len() as u32, name)? };
    let of_geometries = |(i, &pointer): (usize, &*const T)| {
        // SAFETY: the caller's promise.
        unsafe { slice(pointer, infos[i].geometry_count, &format!("{name}[{i}]")) }
    };
    pointers.iter().enumerate().map(of_geometries).collect()
}

/// `handle`, if it is one.
pub(crate) fn handle<H: Handle + Copy>(handle: H, name: &str) -> Result<H> {
    if handle.is_null() { Err(null(name)) } else { Ok(handle) }
}
