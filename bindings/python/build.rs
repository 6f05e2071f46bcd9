//! Keeps the extension module's code in memory: threads that called it run its destructors when they end.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let os = std::env::var("CARGO_CFG_TARGET_OS").unwrap_or_default();
    if let "linux" | "android" | "freebsd" | "netbsd" | "openbsd" = os.as_str() {
        println!("cargo::rustc-cdylib-link-arg=-Wl,-z,nodelete");
    }
}
