//! The most bytes of the heap that are held at once: a global allocator that counts, which the program `hedgerow` installs.
//!
//! It must not slow down what is measured. So each thread keeps a sum of its own and adds it to that of all in batches of
//! `BATCH` bytes, and the system's allocator zeroes and moves blocks by itself, as it does for programs that do not count.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicIsize, Ordering};

/// Bytes that a thread may have taken or given back before it says so: by as much per thread a figure may be off.
const BATCH: isize = 16 << 10;

/// Bytes that are held, by all threads.
static HELD: AtomicIsize = AtomicIsize::new(0);
/// The most that they were since [`most_held`] began, or ever.
static MOST: AtomicIsize = AtomicIsize::new(0);

thread_local! {
    /// Bytes of this thread that [`HELD`] does not have yet. Of a thread that ends they are lost.
    static PENDING: Cell<isize> = const { Cell::new(0) };
}

/// The system's allocator, with its bytes counted for [`most_held`]. A program makes it its `#[global_allocator]`.
#[derive(Debug, Clone, Copy, Default)]
pub struct CountingAllocator;

/// Bytes that are taken, or less than 0 that are given back: by the allocator, and by libraries of other languages that tell.
#[inline]
pub fn count(bytes: isize) {
    let pending = PENDING.get() + bytes;
    if pending.abs() < BATCH {
        PENDING.set(pending);
    } else {
        PENDING.set(0);
        add(pending);
    }
}

#[cold]
fn add(bytes: isize) {
    let held = HELD.fetch_add(bytes, Ordering::Relaxed) + bytes;
    if held > MOST.load(Ordering::Relaxed) {
        MOST.fetch_max(held, Ordering::Relaxed);
    }
}

// SAFETY: every call goes to the system's allocator as it came; counting allocates nothing.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller keeps the contract of `alloc`, which is the system's.
        let block = unsafe { System.alloc(layout) };
        if !block.is_null() {
            count(layout.size() as isize);
        }
        block
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as above.
        let block = unsafe { System.alloc_zeroed(layout) };
        if !block.is_null() {
            count(layout.size() as isize);
        }
        block
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        // SAFETY: as above; the block is the system's.
        unsafe { System.dealloc(block, layout) };
        count(-(layout.size() as isize));
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: as above.
        let moved = unsafe { System.realloc(block, layout, size) };
        if !moved.is_null() {
            count(size as isize - layout.size() as isize);
        }
        moved
    }
}

/// What `work` gives, and the most bytes of the heap that it held at once beyond those that were held before; `None` where the
/// program does not count. Other threads are counted, too, so nothing else should run meanwhile.
pub fn most_held<T>(work: impl FnOnce() -> T) -> (T, Option<u64>) {
    // A program that counts has told of a batch long before it comes here.
    let is_counted = MOST.load(Ordering::Relaxed) > 0;
    add(PENDING.replace(0));
    let before = HELD.load(Ordering::Relaxed);
    MOST.store(before, Ordering::Relaxed);
    let result = work();
    add(PENDING.replace(0));
    let most = MOST.load(Ordering::Relaxed) - before;
    (result, is_counted.then(|| most.max(0) as u64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_peak_is_the_most_that_was_held_at_once() {
        let layout = Layout::from_size_align(1 << 20, 64).expect("a power of two");
        let ((), most) = most_held(|| {
            for _ in 0..3 {
                // SAFETY: the block is freed with the layout that it was moved to.
                unsafe {
                    let block = CountingAllocator.alloc(layout);
                    let block = CountingAllocator.realloc(block, layout, 3 << 20);
                    let zeroed = CountingAllocator.alloc_zeroed(layout);
                    assert_eq!(*zeroed.add((1 << 20) - 1), 0);
                    CountingAllocator.dealloc(zeroed, layout);
                    CountingAllocator.dealloc(block, Layout::from_size_align(3 << 20, 64).expect("a power of two"));
                }
            }
        });
        assert_eq!(most, None, "this program's own allocator does not count");
        let ((), most) = most_held(|| {
            // SAFETY: as above.
            unsafe { CountingAllocator.dealloc(CountingAllocator.alloc(layout), layout) }
        });
        let least = 1 << 20;
        assert!(most.is_some_and(|most| (least..least + BATCH as u64).contains(&most)), "{most:?}");
    }
}
