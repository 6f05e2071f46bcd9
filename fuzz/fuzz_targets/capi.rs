//! The functions of the C header: the bytes decide which are called and how a valid call is changed.
#![no_main]

#[path = "../src/capi.rs"]
mod capi;

use libfuzzer_sys::fuzz_target;
use std::sync::OnceLock;

struct Bytes<'a>(std::slice::Iter<'a, u8>);

impl capi::Source for Bytes<'_> {
    fn byte(&mut self) -> u8 {
        self.0.next().copied().unwrap_or(0)
    }
}

/// Handles, which any number of threads may use.
struct Shared(capi::World);

unsafe impl Send for Shared {}
unsafe impl Sync for Shared {}

fuzz_target!(|bytes: &[u8]| {
    static WORLD: OnceLock<Shared> = OnceLock::new();
    let scratch = || std::env::temp_dir().join(format!("capi-{}", std::process::id()));
    let world = &WORLD.get_or_init(|| Shared(capi::world(&scratch()))).0;
    capi::execute(world, &mut Bytes(bytes.iter()));
});
