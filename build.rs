//! How the C library is linked: by which name programs load it, and that its code stays in memory.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let os = std::env::var("CARGO_CFG_TARGET_OS").unwrap_or_default();
    match os.as_str() {
        "linux" | "android" | "freebsd" | "netbsd" | "openbsd" => {
            // The number of the binary interface.
            println!("cargo::rustc-cdylib-link-arg=-Wl,-soname,libvg.so.0");
            // When a thread that called the library ends, it runs the library's destructors of thread-local memory, possibly
            // after dlclose, so the code must stay in memory.
            println!("cargo::rustc-cdylib-link-arg=-Wl,-z,nodelete");
        }
        "macos" => println!("cargo::rustc-cdylib-link-arg=-Wl,-install_name,@rpath/libvg.0.dylib"),
        _ => {}
    }
}
