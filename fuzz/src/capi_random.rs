//! The target `capi` without libFuzzer: random calls for some time.
//!
//!     capi_random SECONDS SEED     prints the number of calls per result
//!     capi_random = SEED           repeats one execution, by the number that a failure printed

#[path = "capi.rs"]
mod capi;

use capi::Source;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

/// Splitmix64.
struct Random(u64);

impl Source for Random {
    fn byte(&mut self) -> u8 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) as u8
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [time, seed] = &arguments[..] else { panic!("capi_random SECONDS SEED") };
    let seed: u64 = seed.parse().expect("a seed");
    let scratch = std::env::temp_dir().join(format!("capi_random-{}", std::process::id()));
    let world = capi::world(&scratch);
    // After a crash, this file has the number of the execution.
    let running = scratch.join("running");
    let mut results: BTreeMap<(&str, String), u64> = BTreeMap::new();
    let mut slowest = (Duration::ZERO, 0);
    let (mut executions, mut failures) = (0u64, 0);
    let start = Instant::now();
    loop {
        let this = if time == "=" { seed } else { seed.wrapping_mul(1_000_000_007) + executions };
        std::fs::write(&running, this.to_string()).expect("the scratch folder");
        let begin = Instant::now();
        let mut source = Random(this);
        match catch_unwind(AssertUnwindSafe(|| capi::execute(&world, &mut source))) {
            Ok(log) => {
                log.into_iter().for_each(|(f, s)| *results.entry((f, format!("{s:?}"))).or_default() += 1)
            }
            Err(_) => {
                eprintln!("again: capi_random = {this}");
                failures += 1;
            }
        }
        slowest = slowest.max((begin.elapsed(), this));
        executions += 1;
        let over = time.parse().is_ok_and(|seconds: f64| start.elapsed().as_secs_f64() > seconds);
        if time == "=" || over || failures > 20 {
            break;
        }
    }
    for ((function, status), count) in &results {
        println!("{count:8} {function} {status}");
    }
    let calls: u64 = results.values().sum();
    println!("{executions} executions, {calls} calls, {failures} failures");
    println!("the slowest took {:?}: capi_random = {}", slowest.0, slowest.1);
    drop(world);
    std::fs::remove_dir_all(&scratch).expect("the scratch folder can be removed");
    std::process::exit(i32::from(failures > 0));
}
