//! What C gets to see of an error: a `VkResult`, and a text.

use crate::vulkan::VkResult;
use hedgerow::{Error, Result};
use std::any::Any;
use std::cell::RefCell;
use std::ffi::{CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

thread_local! {
    static LAST_ERROR: RefCell<CString> = RefCell::default();
}

/// What was wrong in the last call on this thread that failed, and what to do: UTF-8, empty if none has.
///
/// The text stays until another call fails on this thread.
#[unsafe(no_mangle)]
pub extern "C" fn hedgerow_last_error_message() -> *const c_char {
    // Without a thread's own values, in its last moments, there is no text either.
    LAST_ERROR.try_with(|text| text.borrow().as_ptr()).unwrap_or(c"".as_ptr())
}

/// `call`, for a function that returns a `VkResult`.
pub(crate) fn status(call: impl FnOnce() -> Result<()>) -> VkResult {
    match guarded(call) {
        Ok(()) => VkResult::SUCCESS,
        Err(result) => result,
    }
}

/// `call`, for a function that returns a value, or none: `failed` stands for an error.
pub(crate) fn value_or<T>(failed: T, call: impl FnOnce() -> Result<T>) -> T {
    guarded(call).unwrap_or(failed)
}

/// Runs `call`, keeps the text of its error, and lets no panic out: unwinding into C would abort.
fn guarded<T>(call: impl FnOnce() -> Result<T>) -> Result<T, VkResult> {
    // What `call` leaves half done is a context's pipelines, whose lock recovers from it, and the caller's own memory.
    match catch_unwind(AssertUnwindSafe(call)) {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(error)) => {
            remember(error.to_string());
            Err(code(&error))
        }
        Err(panic) => {
            remember(format!(
                "hedgerow panicked: {}; this is a mistake in hedgerow, please report it",
                text_of(&*panic)
            ));
            Err(VkResult::ERROR_UNKNOWN)
        }
    }
}

/// The `VkResult` that says most nearly the same.
fn code(error: &Error) -> VkResult {
    match error {
        Error::Vulkan { result, .. } => *result,
        Error::Argument(_) => VkResult::ERROR_VALIDATION_FAILED_EXT,
        Error::Unsupported { .. } => VkResult::ERROR_FEATURE_NOT_PRESENT,
        _ => VkResult::ERROR_UNKNOWN,
    }
}

fn remember(text: String) {
    let text = CString::new(text.replace('\0', " ")).expect("its zero bytes were replaced");
    let _ = LAST_ERROR.try_with(|last| last.replace(text));
}

fn text_of(panic: &(dyn Any + Send)) -> &str {
    (panic.downcast_ref::<&str>().copied())
        .or_else(|| panic.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("for a reason that is not text")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::ffi::CStr;

    fn last_error() -> String {
        // SAFETY: the text stays until the next error.
        unsafe { CStr::from_ptr(hedgerow_last_error_message()) }.to_str().expect("UTF-8").into()
    }

    #[test]
    fn a_thread_without_errors_has_an_empty_message() {
        assert_eq!(last_error(), "");
        assert_eq!(status(|| Ok(())), VkResult::SUCCESS);
        assert_eq!(last_error(), "");
    }

    #[test]
    fn an_error_is_a_result_and_a_message_until_the_next() {
        let argument = || Err(Error::Argument("mode is 7".into()));
        assert_eq!(status(argument), VkResult::ERROR_VALIDATION_FAILED_EXT);
        assert_eq!(status(|| Ok(())), VkResult::SUCCESS);
        assert_eq!(last_error(), "mode is 7");
        let memory = || Err(Error::vulkan("vkCreateShaderModule")(VkResult::ERROR_OUT_OF_HOST_MEMORY));
        assert_eq!(status(memory), VkResult::ERROR_OUT_OF_HOST_MEMORY);
        assert_eq!(last_error(), "vkCreateShaderModule failed: ERROR_OUT_OF_HOST_MEMORY");
        let lacking = || Err(Error::Unsupported { device: "D".into(), missing: vec!["Vulkan 1.2".into()] });
        assert_eq!(status(lacking), VkResult::ERROR_FEATURE_NOT_PRESENT);
        assert_eq!(value_or(7, || Err(Error::Argument("a\0b".into()))), 7);
        assert_eq!(last_error(), "a b");
    }

    #[test]
    fn a_panic_is_an_error() {
        assert_eq!(status(|| panic!("no reason")), VkResult::ERROR_UNKNOWN);
        assert!(last_error().starts_with("hedgerow panicked: no reason; "), "{}", last_error());
        assert_eq!(value_or(0, || panic!("{} reasons", 1 + 1)), 0);
        assert!(last_error().starts_with("hedgerow panicked: 2 reasons; "), "{}", last_error());
    }
}
