//! Turns of threads at the Vulkan loader.
//!
//! The loader links all instances and devices of a process in lists. It changes some of them without a lock: when devices are
//! made and destroyed (KhronosGroup/Vulkan-Loader issue 2018), and since 1.3.283 when devices are enumerated, as it then
//! unloads drivers without any. Whoever names an object or asks for a function goes over these lists, also where instance and
//! device are its own. So threads that open devices of their own crashed, although the specification allows it.

use std::sync::{PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

static LISTS: RwLock<()> = RwLock::new(());

/// Waits until no other thread is at the lists, for a call that changes them. Must not be taken twice by a thread.
pub(super) fn change() -> RwLockWriteGuard<'static, ()> {
    LISTS.write().unwrap_or_else(PoisonError::into_inner)
}

/// Waits until no other thread changes the lists, for a call that goes over them.
pub(super) fn read() -> RwLockReadGuard<'static, ()> {
    LISTS.read().unwrap_or_else(PoisonError::into_inner)
}
